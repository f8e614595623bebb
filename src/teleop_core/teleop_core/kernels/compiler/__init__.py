"""Compiler: makes machine code of kernels with numba; loaded only when a kernel must be compiled.

Only this folder imports numba, and uses its internals, which any version may change: the public interface of numba
cannot stamp a cache, compile without a wrapper for Python, treat literals as plain numbers, or report a mistake in one
line.
"""

import os
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from pickle import UnpicklingError
from types import FunctionType
from typing import Any

import numba
import numpy as np
from numba.core import cgutils, event, types
from numba.core.caching import FunctionCache, IndexDataCacheFile, NullCache
from numba.core.ccallback import CFunc
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import ForceLiteralArg, NumbaError, NumbaExperimentalFeatureWarning, UnsupportedBytecodeError
from numba.core.imputils import lower_cast
from numba.core.pythonapi import NativeValue, _unboxers
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.experimental import function_type
from numba.extending import overload
from numba.np import arrayobj

from teleop_core.kernels import images, progress, store
from teleop_core.kernels.compiled_kernel import CompiledKernel
from teleop_core.kernels.compiler import joint_records, natives, objects  # noqa: F401
from teleop_core.kernels.compiler.blocks import unpacking
from teleop_core.kernels.compiler.borrowing import Pipeline
from teleop_core.kernels.compiler.mistakes import kernel_error
from teleop_core.kernels.compiler.plain import entry_of
from teleop_core.kernels.kinds import Kinds
from teleop_core.kernels.shipped import places

SUPPORTED = ((0, 68), (0, 69))
"""The first supported version of numba and the first later version that is unsupported. Also declared in setup.py."""


def check_version(found: str = numba.__version__) -> None:
    """Refuse unsupported versions of numba.

    Raises:
        ImportError: An unsupported version is installed; the error text names the supported versions.
    """
    first, beyond = SUPPORTED
    if not first <= tuple(int(part) for part in found.split(".")[:2]) < beyond:
        lower, upper = (".".join(map(str, version)) for version in SUPPORTED)
        raise ImportError(f"numba is {found}, must be >= {lower} and < {upper}")


check_version()


class _Progress(event.Listener):  # type: ignore[misc]
    """Tells of kernels whose compilation begins and ends; kernels that they call begin during their compilation."""

    def on_start(self, event: object) -> None:
        """Count a kernel whose compilation begins."""
        progress.begun()

    def on_end(self, event: object) -> None:
        """Count a kernel whose compilation is finished or has failed."""
        progress.ended()


event.register("numba:compile", _Progress())

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
    is_generated = False

    @_roomy
    def compile(self, sig: Any) -> Any:
        """Compile for one signature, or load the compiled code from the disk."""
        try:
            if not self._has_cache:
                self._cache, self._has_cache = _cache(self.py_func, self.is_generated), True
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
    """Addresses of a :class:`~teleop_core.kernels.compiled_kernel.Pointer`."""
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


def dispatcher(kernel: CompiledKernel) -> Dispatcher:
    """What numba has in place of a kernel.

    Without reference counting of the array arguments of generated kernels, a tick is a fifth faster.
    """
    if kernel.is_generated:
        made = Dispatcher(kernel.py_func, targetoptions={**_OPTIONS, "_nrt": False})
        made.is_generated = True
        return made
    more = {"no_cpython_wrapper": True} if kernel.is_inner else {"nogil": not kernel.keeps_lock}
    return Dispatcher(kernel.py_func, targetoptions={**_OPTIONS, **more}, pipeline_class=Pipeline)


def dispatcher_type(kernel: CompiledKernel) -> Any:
    """Type of a kernel in the code of another one."""
    return types.Dispatcher(kernel.dispatcher)


@cache
def pointer_type(signature: Any) -> Any:
    """Type of pointers to functions of a signature."""
    arguments, result = normalize_signature(signature)
    return types.FunctionType(result(*arguments))


def arguments_of(signature: Any) -> tuple[Any, ...]:
    """Types of the arguments of a signature."""
    found: tuple[Any, ...] = normalize_signature(signature)[0]
    return found


def types_of(arguments: tuple[object, ...]) -> tuple[Any, ...]:
    """Types of arguments."""
    return tuple(_type_of(_bare(argument)) for argument in arguments)


def _type_of(value: Any) -> Any:
    """Type of a value; types of records are cached, since a look-up takes a millisecond for a hundred fields."""
    if isinstance(value, np.void):
        return _record_type(value.dtype)
    if type(value) is tuple:
        return types.BaseTuple.from_types([_type_of(_bare(one)) for one in value])
    with suppress(NumbaError, ValueError):
        return numba.typeof(value)
    return types.pyobject  # kernels refuse it, with the name of the argument


def _bare(value: Any) -> Any:
    """View of a record without attributes, because looking up attributes costs 1 µs; other values are unchanged."""
    return value.view(np.dtype((np.void, value.dtype))) if isinstance(value, np.record) else value


@cache
def _record_type(dtype: np.dtype[Any]) -> Any:
    return numba.typeof(np.zeros(1, dtype)[0])


def code(kernel: CompiledKernel, kinds: Kinds, wanted: tuple[Any, ...]) -> images.Code:
    """Machine code of a kernel, from numba's files or made; its image is stored.

    Args:
        kernel: The kernel.
        kinds: Kinds of its arguments.
        wanted: Their types.

    Raises:
        KernelError: The kernel cannot be compiled for these types.
    """
    made = kernel.dispatcher
    made.compile(wanted)
    kernel.hits += made.stats.cache_hits[wanted] > 0
    found = made.overloads[wanted]
    address = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)
    entry = None if kernel.is_inner else found.entry_point
    if not kernel.is_inner and not isinstance(made._cache, NullCache):
        _save(kernel.py_func, kinds, found, is_c=False)
    return images.Code(address, 0, entry, str(found.signature.return_type), found)


def _save(function: Any, kinds: Kinds, found: Any, *, is_c: bool) -> None:
    if next(images.places(function, images.stamp_of(function), kinds), None) is not None:
        image = objects.image(found, is_c=is_c)
        if image is not None:
            images.save(function, kinds, image)


def c_code(kernel: CompiledKernel, kinds: Kinds, signature: Any) -> images.Code:
    """Machine code of a kernel in the way of C, with a result of the type that a signature names.

    It is compiled like :func:`numba.cfunc`, but with this package's stamp: it shares a cache file with the kernel of
    the same function; with different stamps, each would invalidate the cache of the other.

    Args:
        kernel: The kernel.
        kinds: Kinds by which the code is stored.
        signature: The signature.

    Raises:
        KernelError: The kernel cannot be compiled for this signature.
    """
    cached = _cache(kernel.py_func, kernel.is_generated)
    made, found = _c_function(kernel.py_func, signature, cached)
    if not isinstance(cached, NullCache):
        _save(kernel.py_func, kinds, found, is_c=True)
    return made


def plain_code(function: Callable[..., Any], signature: Any) -> images.Code:
    """Machine code that calls a plain Python function.

    Raises:
        KernelError: The function cannot be called with this signature.
    """
    arguments, result = normalize_signature(signature)
    return _c_function(entry_of(function, arguments, result), signature, NullCache())[0]


class _CFunction(CFunc):  # type: ignore[misc]
    """Function in the way of C; keeps what the compiler made."""

    def compile(self) -> None:
        """Compile, or load from the cache."""
        made: Any = self
        self.found = made._cache.load_overload(made._sig, made._targetdescr.target_context)
        if self.found is None:
            self.found = made._compile_uncached()
            made._cache.save_overload(made._sig, self.found)


@global_compiler_lock  # type: ignore[misc]
def _c_function(target: Any, signature: Any, cached: Any) -> tuple[images.Code, Any]:
    arguments, result = normalize_signature(signature)
    made: Any = _CFunction(target, (arguments, result), locals={}, options=_ERRORS, pipeline_class=Pipeline)
    made._cache = cached
    try:
        made.compile()
    except _MISTAKES as error:
        raise kernel_error(error, target, arguments) from error
    library, names = made.found.library, made.found.fndesc
    address = library.get_pointer_to_function(names.llvm_cfunc_wrapper_name)
    return images.Code(0, address, None, str(result), (made, target)), made.found


def set_unpacking(enter: CompiledKernel, kernel: CompiledKernel, arguments: tuple[object, ...]) -> tuple[Any, ...]:
    """Prepare a kernel that unpacks a block for compilation; returns the types of its arguments.

    Args:
        enter: Kernel that calls ``run`` with the address of a block.
        kernel: Kernel whose address comes first in the block.
        arguments: Arguments of that kernel, which follow in the block.
    """
    kinds = types_of(arguments)
    kernel.dispatcher.compile(kinds)
    result = kernel.dispatcher.overloads[kinds].signature.return_type
    enter.py_func.__globals__["run"] = unpacking(kinds, result)
    return (types.int64,)


# Exceptions for damaged files, for example after a loss of power, and for files of other versions.
_BROKEN = (OSError, EOFError, UnpicklingError, AttributeError, ImportError)


class _Cache(FunctionCache):
    """Cache on disk; files that are damaged or cannot be written count as missing."""

    shipped_name = ""
    """Name of the cache files that a wheel contains beside a source."""
    is_generated = False

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
        source = Path(images.__file__ if self.is_generated else file)
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


def _cache(function: Any, is_generated: bool) -> Any:
    """Cache on disk of a function; None if the function has no source file."""
    stamp = images.stamp_of(function)
    if is_generated:
        cached: Any = _Cache(images.load)  # cache in addition to this package's own
        name = f"generated.{function.__qualname__}-py{sys.version_info[0]}{sys.version_info[1]}"
        cached._py_func, cached.is_generated = function, True
        return cached.keep(function, name, stamp)
    try:
        cached = _Cache(function)
    except RuntimeError:  # the function was typed in, or given to python -c
        return NullCache()
    return cached.keep(function, cached._cache_file._index_name.removesuffix(".nbi"), stamp)
