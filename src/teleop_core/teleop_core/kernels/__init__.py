"""Compiled kernels: one decorator, so that every kernel is compiled in the same way.

Kernels are cached on disk. numba compiles a cached kernel again when *its* file changes, not when
a kernel that it calls changes; a stale caller would silently go on with old formulas. Here the
stamp of a cached kernel therefore covers the files of all kernels it calls.
"""

import gc
import linecache
import sys
import warnings
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numba
import numpy as np
from numba.core import types
from numba.core.caching import FunctionCache, IndexDataCacheFile, NullCache
from numba.core.ccallback import CFunc
from numba.core.errors import NumbaExperimentalFeatureWarning
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature

from teleop_core import __version__
from teleop_core.kernels.dependencies import Tokens, digest, hexdigest, source_digest

# Function pointers as arguments are what lets one compiled graph run any robot.
warnings.filterwarnings("ignore", "First-class function", NumbaExperimentalFeatureWarning)

# Division by zero gives infinity or NaN as in NumPy, not an exception in the middle of a loop;
# pointers (below) make their own C wrapper, so kernels compile faster without one.
_ERRORS: dict[str, Any] = {"error_model": "numpy"}
_OPTIONS = {"nopython": True, "nogil": True, "no_cfunc_wrapper": True, **_ERRORS}

_kernels: set[Any] = set()
_generated: set[Any] = set()


def _roomy(function: Callable[..., Any]) -> Callable[..., Any]:
    """Function whose frame is so large that all it calls finds room beside it.

    CPython keeps frames in chunks of 16 KiB. A deep compiler crosses the end of a chunk thousands
    of times, each time with a system call: a quarter of its time. A large frame gets a large
    chunk, the rest of which serves the frames after it.
    """
    function.__code__ = function.__code__.replace(co_stacksize=70_000)  # 560 KB of 1 MiB
    return function


class _Kernel(CPUDispatcher):
    """Compiles a kernel once, in as little time as numba lets it.

    Numbers that are written in a call count as any number of their type, where numba would
    compile again for each of their values.
    """

    _has_cache = False

    @_roomy
    def compile(self, sig: Any) -> Any:
        if not self._has_cache:
            self._cache, self._has_cache = _cache(self.py_func), True
        # Millions of objects are made and kept: looking through them for garbage is for nothing.
        is_enabled = gc.isenabled()
        gc.disable()
        try:
            return super().compile(sig)
        finally:
            if is_enabled:
                gc.enable()

    def get_call_template(self, args: Any, kws: Any) -> Any:
        plain = [types.unliteral(kind) for kind in args]
        return super().get_call_template(
            plain, {name: types.unliteral(kind) for name, kind in kws.items()}
        )


class _InnerKernel(_Kernel):
    """Has no way in from Python; numba would crash where this raises."""

    def __call__(self, *_: Any, **__: Any) -> Any:
        raise TypeError(
            f"{self.py_func.__name__} is called by kernels only: decorate it with kernel"
        )


def _compiled(kind: Any, function: Callable[..., Any], **options: bool) -> Any:
    """Lazily compiled function; its cache is opened when it is first compiled."""
    _kernels.add(function)
    return kind(function, targetoptions={**_OPTIONS, **options})


def _cache(function: Callable[..., Any]) -> Any:
    """Cache on disk of a function, none where it has no file to stand beside."""
    stamp = (numba.__version__, __version__, source_digest(__file__), digest(function))
    if function in _generated:
        name = f"generated.{function.__qualname__}-py{sys.version_info[0]}{sys.version_info[1]}"
        cache = FunctionCache(_cache)  # beside this package's own
        cache._py_func = function
        cache._cache_file = IndexDataCacheFile(cache.cache_path, name, stamp)
        return cache
    try:
        cache = FunctionCache(function)
    except RuntimeError:  # no source file: typed in, or python -c
        return NullCache()
    cache._cache_file._source_stamp = stamp
    return cache


def kernel_from_source(text: str, name: str, names: Mapping[str, Any]) -> Any:
    """Kernel from source text that the program wrote itself.

    It is cached on disk like others: the same text, calling the same kernels on the same constants,
    is compiled once. Tracebacks show its lines.

    Args:
        text: Python source that defines a function.
        name: Name of that function.
        names: What the text refers to: kernels, constants, modules.
    """
    tokens = Tokens()
    values = [f"{key}={tokens.of(value)}" for key, value in sorted(names.items())]
    values += [f"{f.__module__}.{f.__qualname__}" for f in tokens.functions]
    key = hexdigest((text, name, *values))
    file = f"<{name} {key}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    space: dict[str, Any] = {**names, "__name__": __name__}
    exec(compile(text, file, "exec"), space)
    function = space[name]
    function.__qualname__ = f"{name}_{key}"  # names the machine code: one for each text
    _generated.add(function)
    return kernel(function)


def _is_kernel(value: object) -> bool:
    return callable(value) and getattr(value, "py_func", None) in _kernels


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a pure function over float64 arrays and records.

    No ``fastmath``: results are the same on every machine and in every run mode. The kernel
    releases the interpreter lock, so that other threads run beside it. Arrays must be writable:
    numba compiles a second time for read-only ones.
    """
    return _compiled(_Kernel, function)


def inner(function: Callable[..., Any]) -> Any:
    """Compile a kernel that only other kernels call: about a quarter less work than :func:`kernel`.

    A call from Python raises TypeError.
    """
    return _compiled(_InnerKernel, function, no_cpython_wrapper=True)


def pointer(compiled: Any, signature: Any) -> Any:
    """Kernel as a first-class value of a fixed signature, which other kernels take as argument.

    Args:
        compiled: A function made by :func:`kernel`.
        signature: numba signature, the same for all kernels that may stand in this place.

    Returns:
        The callable to hand to a kernel.
    """
    # What numba.cfunc does, but with our stamp: both live in one cache file, and with different
    # stamps each would throw the other away.
    function = compiled.py_func
    callback = CFunc(function, normalize_signature(signature), locals={}, options=_ERRORS)
    callback._cache = _cache(function)
    callback.compile()
    return callback


def records(fields: Any, count: int = 1) -> Any:
    """Zeroed records (count,) whose fields are attributes, for kernels and for plain Python.

    Args:
        fields: What :class:`numpy.dtype` takes: pairs of name and type, or a dtype.
        count: Number of records.

    Returns:
        Array of :class:`numpy.record`; take ``[0]`` for one record that shares its memory.
    """
    return np.zeros(count, np.dtype((np.record, np.dtype(fields))))


def bound(compiled: Any, *arguments: Any) -> Callable[[], Any]:
    """Kernel on arguments that stay the same objects, without the cost of looking at their types.

    Numbers keep the value they have now; what changes from call to call travels in arrays and
    records. With function pointers among the arguments this saves two thirds of a call.
    """
    entry = compiled.compile(tuple(numba.typeof(argument) for argument in arguments))
    return partial(entry, *arguments)
