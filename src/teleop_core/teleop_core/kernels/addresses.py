"""Addresses: kernels as numbers that compiled code calls, so that a list of numbers is a program.

A kernel that calls another kernel by name is compiled for the types of that kernel's arguments. A kernel that calls an
address knows neither these types nor the kernel: it is compiled once. :func:`addressed` makes the address of a kernel,
and a block of words with the values of its arguments; :func:`call_address` calls it.
"""

import ctypes
from collections.abc import Callable
from functools import cache, partial
from itertools import count
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from teleop_core import kernels
from teleop_core.base.errors import KernelError
from teleop_core.kernels.callables import keep
from teleop_core.kernels.compiled_kernel import CompiledKernel, Pointer, the_compiler
from teleop_core.kernels.dependencies import hexdigest
from teleop_core.kernels.images import Code
from teleop_core.kernels.kinds import Kinds, kinds_of

__all__ = ["Addressed", "addressed", "call_address", "held"]

Words = NDArray[np.int64]


class Addressed:
    """A kernel with its arguments, which compiled code calls by address; made by :func:`addressed`.

    The object must live for as long as the address is in use.

    Attributes:
        address: Address of compiled code that unpacks a block and calls the kernel. Only :func:`call_address` can call
            it: errors are returned in the way of the compiler.
        block: Words of the arguments: addresses of records and arrays, sizes, and the values of numbers.
    """

    address: int
    block: Words

    def __init__(self, function: Callable[..., object], arguments: tuple[Any, ...]) -> None:
        self._held: Any = (function, arguments)
        if isinstance(function, CompiledKernel):
            self._compile(function, arguments)
        elif kernels.IS_COMPILED:
            self._wrap(function, arguments)
        else:
            self.address, self.block = next(_serial), np.zeros(1, np.int64)
            _plain[self.address] = self

    @property
    def block_address(self) -> int:
        """Address of the block, the second argument of :func:`call_address`."""
        return int(self.block.ctypes.data)

    def run(self) -> None:
        """Call the kernel as a Python function."""
        function, arguments = self._held[:2]
        function(*arguments)

    def _compile(self, function: CompiledKernel, arguments: tuple[Any, ...]) -> None:
        kinds = kinds_of(arguments)
        code = function.code(kinds, lambda: the_compiler().types_of(arguments))
        entry = _entry(function, kinds, code.result, arguments)
        self.address = entry.address
        self.block = np.array([code.address, *_words_of(arguments)], np.int64)
        self._held = (*self._held, code, entry)

    def _wrap(self, function: Callable[..., object], arguments: tuple[Any, ...]) -> None:
        """Make compiled code call a plain Python function."""

        def call() -> None:
            try:
                function(*arguments)
            except BaseException as error:
                keep(error)

        callback, entry = ctypes.CFUNCTYPE(None)(call), _plain_entry()
        self.address = entry.address
        self.block = np.array([ctypes.cast(callback, ctypes.c_void_p).value], np.int64)
        self._held = (*self._held, callback, entry)


_serial = count(1)
_plain: "WeakValueDictionary[int, Addressed]" = WeakValueDictionary()


def addressed(function: Callable[..., object], *arguments: object) -> Addressed:
    """Kernel with its arguments as an address and a block of words.

    Numbers keep their present value; pass changing values in arrays and records. The kernel is compiled here, so that a
    mistake in it is reported here. Code that unpacks a block is compiled once for each tuple of argument types.

    Args:
        function: A kernel; its result is ignored. A plain Python function is called through ctypes;
            :func:`~teleop_core.kernels.raise_pending` raises its first exception.
        arguments: All arguments, in order: numbers, arrays, records, function pointers, and tuples of these.

    Raises:
        KernelError: The kernel cannot be compiled for these arguments.
    """
    return Addressed(function, arguments)


def held(function: Callable[..., object], *arguments: object) -> Callable[[], None]:
    """Kernel with its arguments as a Python function that keeps the interpreter's lock while the kernel runs.

    For a loop that must not be late: a kernel that releases the lock for some µs may wait 0.2 ms and more to get it
    back, if another thread of the process works. The result of the kernel is ignored.

    Args:
        function: A kernel, or a plain Python function.
        arguments: As in :func:`addressed`.

    Raises:
        KernelError: The kernel cannot be compiled for these arguments.
    """
    if not kernels.is_kernel(function):
        return partial(_run_plain, function, arguments)
    made = addressed(function, *arguments)
    if not kernels.IS_COMPILED:
        return made.run
    call: Any = partial(_enter_code(), made.address, made.block_address)
    call.made = made  # keeps the block alive
    found: Callable[[], None] = call
    return found


def _run_plain(function: Callable[..., object], arguments: tuple[object, ...]) -> None:
    function(*arguments)


@cache
def _enter_code() -> Callable[[int, int], None]:
    """Compiled form of :func:`_enter`, without a check of the types of its arguments."""
    return CompiledKernel(_enter, keeps_lock=True).entry((0, 0))


def _enter(address: int, block_address: int) -> None:
    """Call an address from Python."""
    call_address(address, block_address)


def call_address(address: int, _block_address: int) -> None:
    """Call the address of an :class:`Addressed` with the address of its block; for kernels.

    An exception of the called kernel is an exception of the caller.
    """
    _plain[address].run()


def copy_memory(source: int, target: int, size: int) -> None:
    """Copy some bytes from an address to another one; for kernels."""
    ctypes.memmove(int(target), int(source), int(size))


def word_at(address: int) -> int:
    """Word of eight bytes at an address, as an integer; for kernels."""
    return ctypes.c_int64.from_address(int(address)).value


def call_c(block: int) -> None:
    """Call the C function without arguments whose address is the first word of a block; for kernels."""
    ctypes.CFUNCTYPE(None)(word_at(block))()


def _unpacked(block: int) -> None:
    """Stands for the code that the compiler generates: it unpacks a block and calls the kernel in its first word."""


def _words_of(values: tuple[Any, ...]) -> list[int]:
    """Words of some values, in the order in which compiled code unpacks them."""
    return [word for value in values for word in _words(value)]


def _words(value: Any) -> list[int]:
    if isinstance(value, tuple):
        return _words_of(value)
    if isinstance(value, np.void):
        return [np.asarray(value).ctypes.data]
    if isinstance(value, np.ndarray):
        return [value.ctypes.data, value.itemsize, *value.shape, *value.strides]
    if isinstance(value, Pointer):
        return [value._wrapper_address, id(value), value._code_address]
    if value is None or kernels.is_kernel(value):  # the kind says it all
        return []
    if isinstance(value, bool | int | float | np.generic):
        return [int.from_bytes(np.asarray(value).tobytes().ljust(8, b"\0"), "little", signed=True)]
    raise KernelError("argument", f"{value!r} must be a number, an array, a record or a pointer")


def _entry(function: CompiledKernel, kinds: Kinds, result: str, arguments: tuple[Any, ...]) -> Code:
    """Code that unpacks a block for arguments of some kinds and calls the kernel whose address comes first."""
    enter = _enter_of("run", _unpacked, hexdigest((*kinds, result)))
    return enter.code(("int64",), lambda: the_compiler().set_unpacking(enter, function, arguments))


@cache
def _plain_entry() -> Code:
    """Code that calls the C function whose address is in a block."""
    enter = _enter_of("call_c", call_c, "C")
    return enter.code(("int64",), lambda: the_compiler().types_of((0,)))


@cache
def _enter_of(name: str, run: Any, key: str) -> CompiledKernel:
    """Kernel that takes the address of a block; its symbol contains the key, as no two may be the same."""
    made: CompiledKernel = kernels.kernel_from_source(
        f"def enter(block):\n    {name}(block)  # {key}\n", "enter", {name: run}
    )
    return made
