"""Compiled kernels: one decorator, so that every kernel is compiled in the same way.

Kernels are cached on disk. numba compiles a cached kernel again when *its* file changes, not when
a kernel that it calls changes; a stale caller would silently go on with old formulas. Here the
stamp of a cached kernel therefore covers the files of all kernels it calls.
"""

import gc
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core import types
from numba.core.caching import NullCache
from numba.core.ccallback import CFunc
from numba.core.errors import NumbaExperimentalFeatureWarning
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature

# Function pointers as arguments are what lets one compiled graph run any robot.
warnings.filterwarnings("ignore", "First-class function", NumbaExperimentalFeatureWarning)

# Division by zero gives infinity or NaN as in NumPy, not an exception in the middle of a loop;
# pointers (below) make their own C wrapper, so kernels compile faster without one.
_ERRORS: dict[str, Any] = {"error_model": "numpy"}
_OPTIONS = {"nopython": True, "nogil": True, "no_cfunc_wrapper": True, **_ERRORS}

_sources: dict[Any, frozenset[str]] = {}


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

    @_roomy
    def compile(self, sig: Any) -> Any:
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
    """Lazily compiled function, whose cache depends on every file its kernels come from."""
    compiled = kind(function, targetoptions={**_OPTIONS, **options})
    compiled.enable_caching()
    code, names = function.__code__, function.__globals__
    called: list[Any] = [names.get(name) for name in code.co_names]
    inner = [_sources[value.py_func] for value in called if _is_kernel(value)]
    files = frozenset([code.co_filename, __file__]).union(*inner)
    _sources[function] = files
    _stamp(compiled, files)
    return compiled


def _stamp(compiled: Any, files: frozenset[str]) -> None:
    if not isinstance(compiled._cache, NullCache):
        stats = [Path(file).stat() for file in sorted(files)]
        stamp = tuple((s.st_mtime, s.st_size) for s in stats)  # older files count as changed too
        compiled._cache._cache_file._source_stamp = stamp


def _is_kernel(value: object) -> bool:
    return callable(value) and getattr(value, "py_func", None) in _sources


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
    callback.enable_caching()
    _stamp(callback, _sources[function])
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
