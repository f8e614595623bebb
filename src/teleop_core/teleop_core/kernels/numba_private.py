"""Numba's internals, which any version may change; only this module and its neighbours in this folder use them.

The public interface of numba cannot stamp a cache, compile without a wrapper for Python, treat literals as plain
numbers, or report a mistake in one line.
"""

import os
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from pickle import UnpicklingError
from types import FunctionType
from typing import Any, cast

import numba
import numpy as np
from numba.core import cgutils, types
from numba.core.caching import FunctionCache, IndexDataCacheFile, NullCache
from numba.core.ccallback import CFunc
from numba.core.errors import ForceLiteralArg, NumbaError, NumbaExperimentalFeatureWarning, UnsupportedBytecodeError
from numba.core.imputils import lower_cast
from numba.core.pythonapi import NativeValue, _unboxers
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.experimental import function_type
from numba.extending import overload
from numba.np import arrayobj

from teleop_core import __version__
from teleop_core.kernels import borrowing, inner_library, joint_records, layout, room, store
from teleop_core.kernels.borrowing import Pipeline
from teleop_core.kernels.callables import entry_of
from teleop_core.kernels.dependencies import digest, source_digest
from teleop_core.kernels.mistakes import kernel_error
from teleop_core.kernels.shipped import places

# Function pointers as arguments allow one compiled graph to run any robot; numba warns of them.
warnings.filterwarnings("ignore", "First-class function", NumbaExperimentalFeatureWarning)

# Division by zero gives infinity or NaN as in NumPy, not an exception in the middle of a loop.
_ERRORS: dict[str, Any] = {"error_model": "numpy"}
# ``_nrt`` is set explicitly, although this is numba's default, because a kernel without this option inherits its
# caller's option. Pointers (below) make their own C wrapper, so kernels compile faster without one.
_OPTIONS = {"nopython": True, "nogil": True, "no_cfunc_wrapper": True, "_nrt": True, **_ERRORS}

# Exceptions that numba raises for a function that it cannot compile; many are not its own error types.
_MISTAKES = (
    NumbaError,
    UnsupportedBytecodeError,
    LookupError,
    AttributeError,
    TypeError,
    ValueError,
    NotImplementedError,
    AssertionError,
)

_generated: set[FunctionType] = set()


def _roomy(function: Callable[..., Any]) -> Callable[..., Any]:
    """Function with a frame so large that the frames of all functions it calls fit into the same memory chunk.

    CPython keeps frames in chunks of 16 KiB. A deeply nested compiler crosses the end of a chunk thousands of times,
    each time with a system call. A large frame gets a large chunk, and later frames use the rest of this chunk.
    Measured on Python 3.11 without a cache, as the mean of three: the kernels of rcrt1 and mma take 3.9 s of processor
    time with a large frame and 4.4 s without. The system's part is 0.17 s with it and 0.79 s without.
    """
    function.__code__ = function.__code__.replace(co_stacksize=70_000)  # 560 KB of 1 MiB
    return function


class Dispatcher(CPUDispatcher):
    """Compiles a kernel once, as fast as numba allows.

    Literal numbers in a call are treated as any number of their type; numba itself would compile again for each value.
    The cache is opened when the kernel is first compiled, because all constants of its module have their values by
    then.
    """

    _has_cache = False

    @_roomy
    def compile(self, sig: Any) -> Any:
        """Compile for one signature, or load the compiled code from the disk."""
        try:
            if not self._has_cache:
                self._cache, self._has_cache = _cache(self.py_func), True
            return super().compile(sig)
        except ForceLiteralArg:  # not a mistake: a request of numba to compile again
            raise
        except _MISTAKES as error:
            raise kernel_error(error, self.py_func, normalize_signature(sig)[0]) from error

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Type of a call from another kernel."""
        plain = [_general(kind) for kind in args]
        return super().get_call_template(plain, {name: _general(kind) for name, kind in kws.items()})


def _general(kind: Any) -> Any:
    """Type without the value of a literal, or the shape of an array in a record."""
    if isinstance(kind, types.NestedArray):
        return types.Array(kind.dtype, kind.ndim, "C")
    return types.unliteral(kind)


@lower_cast(types.NestedArray, types.Array)
def _as_array(_context: Any, _builder: Any, _from: Any, _to: Any, value: Any) -> Any:
    """Array in a record as an array of any shape: both have the same memory layout."""
    return value


def _mismatch(_source: Any, _target: Any) -> None:
    """Replaces numba's code for the assignment of a wrong number of values to a slice."""


@overload(_mismatch)
def _raise_mismatch(_source: Any, _target: Any) -> Callable[..., None]:
    def raise_it(_source: Any, _target: Any) -> None:
        raise ValueError("cannot assign slice from input of different size")

    return raise_it


# numba's code writes both shapes into the message: this takes forty text functions and two seconds to compile.
arrayobj.raise_with_shape_context = _mismatch


def _unbox_function(kind: Any, value: Any, c: Any) -> NativeValue:
    """Addresses of a function with a fixed signature; here the function is a :class:`Pointer` or a :class:`Code`."""
    kind = kind.get_precise()
    function = cgutils.create_struct_proxy(kind)(c.context, c.builder)
    for field, name in (("c_addr", "_wrapper_address"), ("jit_addr", "_code_address")):
        address = c.pyapi.object_getattr_string(value, name)
        setattr(function, field, c.pyapi.long_as_voidptr(address))
        c.pyapi.decref(address)
    function.py_addr = c.builder.ptrtoint(value, c.context.get_value_type(types.voidptr))
    return NativeValue(function._getvalue())


# numba's code calls Python functions for each pointer in each call, which takes 5 µs.
assert function_type.unbox_function_type is _unboxers.functions[types.FunctionType]
_unboxers.functions[types.FunctionType] = _unbox_function


class InnerDispatcher(Dispatcher):
    """Kernel that Python cannot call: a call raises an exception, where numba itself would crash."""

    def __call__(self, *_: Any, **__: Any) -> Any:
        """Refuse the call."""
        raise TypeError(f"{self.py_func.__name__} is called by kernels only: decorate it with kernel")


def dispatcher(function: Callable[..., Any], *, is_inner: bool = False, keeps_lock: bool = False) -> Any:
    """Kernel that is compiled when it is first called."""
    if keeps_lock:
        return Dispatcher(function, targetoptions={**_OPTIONS, "nogil": False}, pipeline_class=Pipeline)
    if is_inner:
        options = {**_OPTIONS, "no_cpython_wrapper": True}
        return InnerDispatcher(function, targetoptions=options, pipeline_class=Pipeline)
    return Dispatcher(function, targetoptions=_OPTIONS, pipeline_class=Pipeline)


def generated_dispatcher(function: FunctionType) -> Any:
    """Kernel without a source file; its qualified name is the key of the cache.

    The function must make no arrays. Without reference counting of its array arguments, a tick is a fifth faster.
    """
    _generated.add(function)
    return Dispatcher(function, targetoptions={**_OPTIONS, "_nrt": False})


class Pointer(CFunc):
    """Function of a fixed signature; numba does not compare the signature in every call to which it is passed."""

    _code_address = 0

    def __wrapper_address__(self) -> int:
        """Address of the compiled function."""
        return self.address or 0


def c_function(function: Any, signature: Any) -> Any:
    """Function of a fixed signature, kernel or not, as a value that kernels call.

    Like :func:`numba.cfunc`, but with this package's stamp. The value shares a cache file with the kernel of the same
    function; with different stamps, each would invalidate the cache of the other.
    """
    arguments, result = normalize_signature(signature)
    is_compiled = isinstance(function, CPUDispatcher)
    # Loading a function from disk takes 5 ms, and every robot requests the functions of its kernels again.
    made = vars(function).setdefault("_pointers", {}) if is_compiled else {}
    if (arguments, result) in made:
        return made[arguments, result]
    target = function.py_func if is_compiled else entry_of(function, arguments, result)
    callback: Any = Pointer(target, (arguments, result), locals={}, options=_ERRORS, pipeline_class=Pipeline)
    if is_compiled:
        callback._cache = _cache(target)
    try:
        callback.compile()
    except _MISTAKES as error:
        raise kernel_error(error, target, arguments) from error
    if not is_compiled:
        callback._entry, callback._pyfunc = target, function  # keeps the entry function alive
    made[arguments, result] = callback
    return callback


class Code(types.WrapperAddressProtocol):  # type: ignore[misc]
    """Machine code of a kernel for one tuple of types; other kernels call it by its address."""

    _wrapper_address = 0

    def __init__(self, kernel: Any, arguments: tuple[Any, ...]) -> None:
        kernel.compile(arguments)
        self._made = kernel.overloads[arguments]  # keeps the code alive
        self._code_address = self._made.library.get_pointer_to_function(self._made.fndesc.llvm_func_name)

    def __wrapper_address__(self) -> int:
        """Address for calls from C; there are no such calls."""
        return self._wrapper_address

    def signature(self) -> Any:
        """Types of the kernel's arguments and of its return value."""
        return self._made.signature


def entry(kernel: Any, arguments: tuple[Any, ...]) -> Callable[..., Any]:
    """Compiled function behind a kernel for one tuple of types."""
    found: Callable[..., Any] = kernel.compile(arguments)
    return found


# Exceptions for damaged files, for example after a loss of power, and for files of other versions.
_BROKEN = (OSError, EOFError, UnpicklingError, AttributeError, ImportError)


class _Cache(FunctionCache):
    """Cache on disk; files that are damaged or cannot be written count as missing."""

    shipped_name = ""
    """Name of the cache files that a wheel contains beside a source."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Stored code for a signature, from the cache or from the wheel; None if there is none."""
        try:
            found = super().load_overload(sig, target_context)
            if found is not None:
                with suppress(OSError):  # the store keeps code that is used
                    os.utime(self._cache_file._index_path)
        except _BROKEN:
            with suppress(OSError):
                self.flush()
            found = None
        return found or self._shipped(sig, target_context)

    def _shipped(self, sig: Any, target_context: Any) -> Any:
        """Code in the wheel for a signature, if this processor can run it."""
        _, (triple, *_), code = self._index_key(sig, target_context.codegen())
        own, file = self._cache_file, self._py_func.__code__.co_filename
        source = Path(__file__ if self._py_func in _generated else file)
        for tier, folder in places(source):
            shipped = IndexDataCacheFile(str(folder), self.shipped_name, own._source_stamp)
            with suppress(*_BROKEN):
                data = shipped.load((sig, (triple, tier, ""), code))
                if data is not None:
                    return self._impl.rebuild(target_context, data)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the compiled code for a signature, if the disk allows it."""
        with suppress(OSError):
            folder = Path(self._cache_file._index_path).parent
            folder.mkdir(parents=True, exist_ok=True)
            with store.locked(folder):
                try:
                    super().save_overload(sig, data)
                except _BROKEN:  # written by another version of the package after this version checked the file
                    self.flush()
                    super().save_overload(sig, data)

    def keep(self, function: FunctionType, name: str, stamp: tuple[str, ...]) -> "_Cache":
        """Store a function in the store, or, if there is no store, in a named file beside its source."""
        self.shipped_name = name
        place = store.place(function, stamp) or Path(self.cache_path) / name
        self._cache_file = IndexDataCacheFile(str(place.parent), place.name, stamp)
        return self


def _cache(function: Any) -> Any:
    """Cache on disk of a function; None if the function has no source file."""
    ours = (borrowing, room, joint_records, layout, inner_library)
    files = (__file__, digest.__code__.co_filename, *(cast(str, module.__file__) for module in ours))
    own = [source_digest(file) for file in files]
    config: Any = numba.config
    checked = str(config.BOUNDSCHECK)  # NUMBA_BOUNDSCHECK=1 gives different code
    versions = (numba.__version__, np.__version__, __version__)
    stamp = (*versions, checked, *own, digest(function))
    if function in _generated:
        cache: Any = _Cache(_cache)  # cache in addition to this package's own
        name = f"generated.{function.__qualname__}-py{sys.version_info[0]}{sys.version_info[1]}"
        cache._py_func = function
        return cache.keep(function, name, stamp)
    try:
        cache = _Cache(function)
    except RuntimeError:  # the function was typed in, or given to python -c
        return NullCache()
    return cache.keep(function, cache._cache_file._index_name.removesuffix(".nbi"), stamp)
