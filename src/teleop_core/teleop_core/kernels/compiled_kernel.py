"""Kernel: a function whose machine code is loaded from the disk or made by the compiler at its first call.

The compiler is loaded only when some code must be made.
"""

from collections.abc import Callable
from functools import update_wrapper
from importlib import import_module
from inspect import signature
from typing import Any

from teleop_core.kernels import images
from teleop_core.kernels.kinds import UNKNOWN, Kinds, declared, kernel_kind, kinds_of, pointer_kind


def the_compiler() -> Any:
    """The module that compiles, which takes half a second and 70 MB when it is first used."""
    return import_module("teleop_core.kernels.compiler")  # by name: that module knows this one


class CompiledKernel:
    """A kernel; it is called like the function from which it was made.

    Args:
        function: Function without side effects on anything but its arguments.
        is_inner: Whether only other kernels call it.
        keeps_lock: Whether it keeps the interpreter's lock while it runs.
        is_generated: Whether its source text was made by the program; it must make no arrays.

    Attributes:
        py_func: The Python function.
        codes: Machine code for each tuple of kinds with which it was called.
        hits: Number of codes that came from the disk.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        *,
        is_inner: bool = False,
        keeps_lock: bool = False,
        is_generated: bool = False,
    ) -> None:
        update_wrapper(self, function)
        self.py_func: Any = function
        self.is_inner, self.keeps_lock, self.is_generated = is_inner, keeps_lock, is_generated
        self.codes: dict[Kinds, images.Code] = {}
        self.hits = 0
        self._entries: dict[Kinds, Callable[..., Any]] = {}
        self._pointers: dict[tuple[Kinds, str], Pointer] = {}
        self._count = function.__code__.co_argcount
        self._dispatcher: Any = None
        self._kind: str | None = None

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the compiled function."""
        if named or len(arguments) != self._count:
            arguments = self._ordered(arguments, named)
        kinds = kinds_of(arguments)
        entry = self._entries.get(kinds)
        if entry is None:
            entry = self.entry(arguments, kinds)
        return entry(*arguments)

    def _ordered(self, arguments: tuple[Any, ...], named: dict[str, Any]) -> tuple[Any, ...]:
        found = signature(self.py_func).bind(*arguments, **named)
        found.apply_defaults()
        return found.args

    def entry(self, arguments: tuple[Any, ...], kinds: Kinds | None = None) -> Callable[..., Any]:
        """Function for calls with arguments of the same types as these, without a check of the types.

        Raises:
            TypeError: Only other kernels may call this one.
            KernelError: The kernel cannot be compiled for these arguments.
        """
        kinds = kinds_of(arguments) if kinds is None else kinds
        return self._entry(kinds, lambda: the_compiler().types_of(arguments))

    def entry_of(self, signature: Any) -> Callable[..., Any]:
        """Function for calls with arguments of the types of a signature, without a check of the types."""
        return self._entry(declared(signature)[0], lambda: the_compiler().arguments_of(signature))

    def _entry(self, kinds: Kinds, types: Callable[[], tuple[Any, ...]]) -> Callable[..., Any]:
        if self.is_inner:
            raise TypeError(f"{self.py_func.__name__} is called by kernels only: decorate it with kernel")
        entry = self.code(kinds, types).entry
        assert entry is not None
        if UNKNOWN not in kinds:
            self._entries[kinds] = entry
        return entry

    def code(self, kinds: Kinds, types: Callable[[], tuple[Any, ...]]) -> images.Code:
        """Machine code for arguments of some kinds.

        Args:
            kinds: Kinds of the arguments.
            types: Their types for the compiler, if it is needed.

        Raises:
            KernelError: The kernel cannot be compiled for these arguments.
        """
        found = self.codes.get(kinds)
        if found is None:
            found = None if self.is_inner else images.load(self.py_func, kinds)
            self.hits += found is not None
            if found is None:
                found = the_compiler().code(self, kinds, types())
            if UNKNOWN in kinds:
                return found
            self.codes[kinds] = found
        return found

    def pointer(self, signature: Any) -> "Pointer":
        """The kernel as a value of a fixed signature."""
        arguments, result = declared(signature)
        made = self._pointers.get((arguments, result))
        if made is None:
            made = self._pointers[arguments, result] = self._pointer(signature, arguments, result)
        return made

    def _pointer(self, signature: Any, arguments: Kinds, result: str) -> "Pointer":
        if not self.is_inner:
            code = self.code(arguments, lambda: the_compiler().arguments_of(signature))
            if code.result == result:
                return Pointer(self.py_func, signature, code)
        kinds = (*arguments, f"to {result}")  # code in the way of C, which converts the result
        code = (
            self.codes.get(kinds) or images.load(self.py_func, kinds) or the_compiler().c_code(self, kinds, signature)
        )
        self.codes[kinds] = code
        return Pointer(self.py_func, signature, code)

    @property
    def dispatcher(self) -> Any:
        """What numba has in place of this kernel."""
        if self._dispatcher is None:
            self._dispatcher = the_compiler().dispatcher(self)
        return self._dispatcher

    @property
    def _numba_type_(self) -> Any:
        return the_compiler().dispatcher_type(self)

    @property
    def kernel_kind(self) -> str:
        """Kind of this kernel as an argument of another one."""
        if self._kind is None:
            self._kind = kernel_kind(self.py_func)
        return self._kind


class Pointer:
    """Function of a fixed signature, as a value that kernels accept as an argument and call."""

    def __init__(self, function: Callable[..., Any], signature: Any, code: images.Code) -> None:
        self.signature, self._function, self._code = signature, function, code
        self._code_address, self._wrapper_address = code.address, code.c_address
        self.kernel_kind = pointer_kind(*declared(signature))
        self.__name__ = getattr(function, "__name__", type(function).__name__)

    @property
    def _numba_type_(self) -> Any:
        return the_compiler().pointer_type(self.signature)

    def __call__(self, *arguments: Any) -> Any:
        """Run the Python function."""
        return self._function(*arguments)


def pointer_to(function: Any, signature: Any) -> Pointer:
    """Function of a fixed signature, kernel or not."""
    if isinstance(function, CompiledKernel):
        return function.pointer(signature)
    return Pointer(function, signature, the_compiler().plain_code(function, signature))
