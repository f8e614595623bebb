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
from teleop_core.kernels.callables import keep
from teleop_core.kernels.dependencies import hexdigest

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
        if kernels.IS_COMPILED and kernels.is_kernel(function):
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

    def _compile(self, function: Any, arguments: tuple[Any, ...]) -> None:
        kinds = kernels.types_of(arguments)
        code = kernels._compiler.Code(function, kinds)
        entry = _entry(kinds, code.signature().return_type)
        self.address = entry._code_address
        self.block = np.array([code._code_address, *_blocks.packed(arguments, kinds)], np.int64)
        self._held = (*self._held, code, entry)

    def _wrap(self, function: Callable[..., object], arguments: tuple[Any, ...]) -> None:
        """Make compiled code call a plain Python function."""

        def call() -> None:
            try:
                function(*arguments)
            except BaseException as error:
                keep(error)

        callback, entry = ctypes.CFUNCTYPE(None)(call), _plain_entry()
        self.address = entry._code_address
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
    made = kernels._compiler.dispatcher(_enter, keeps_lock=True)
    return kernels._compiler.entry(made, kernels.types_of((0, 0)))


def _enter(address: int, block_address: int) -> None:
    """Call an address from Python."""
    call_address(address, block_address)


def _call_plain(address: int, _block_address: int) -> None:
    """Call an address in pure-Python mode."""
    _plain[address].run()


def _copy_plain(source: int, target: int, size: int) -> None:
    """Copy bytes in pure-Python mode."""
    ctypes.memmove(int(target), int(source), int(size))


def _word_plain(address: int) -> int:
    """Word in memory in pure-Python mode."""
    return ctypes.c_int64.from_address(int(address)).value


call_address: Callable[[int, int], None] = _call_plain
"""Call the address of an :class:`Addressed` with the address of its block; for kernels.

An exception of the called kernel is an exception of the caller.
"""
copy_memory: Callable[[int, int, int], None] = _copy_plain
"""Copy some bytes from an address to another one; for kernels."""
word_at: Callable[[int], int] = _word_plain
"""Word of eight bytes at an address, as an integer; for kernels."""

if kernels.IS_COMPILED:
    from teleop_core.kernels import blocks as _blocks

    _native: Any = _blocks
    call_address, copy_memory, word_at = _native.call_address, _native.copy_memory, _native.word_at


@cache
def _entry(kinds: tuple[Any, ...], result: Any) -> Any:
    """Code that unpacks a block for arguments of some types and calls the kernel whose address comes first."""
    return _code_of(_blocks.unpacking(kinds, result), hexdigest(map(str, (*kinds, result))))


@cache
def _plain_entry() -> Any:
    """Code that calls the C function whose address is in a block."""
    return _code_of(_blocks.call_c, "C")


def _code_of(run: Any, key: str) -> Any:
    """Code of a function that takes the address of a block; its symbol contains the key, as no two may be the same."""
    made = kernels.kernel_from_source(f"def enter(block):\n    run(block)  # {key}\n", "enter", {"run": run})
    return kernels._compiler.Code(made, kernels.types_of((0,)))
