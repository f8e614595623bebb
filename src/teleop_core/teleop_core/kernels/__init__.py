"""Kernels: small pure functions over float64 arrays and records, compiled the same way everywhere.

A kernel is written as plain Python and decorated with :func:`kernel`, or with :func:`inner` when
only other kernels call it::

    @kernel
    def spring(position: Array, stiffness: float, force: Array) -> None:
        for i in range(3):
            force[i] = -stiffness * position[i]

A kernel is compiled when it is first called, for the types of that call, and stored on disk. The stored code becomes
invalid when one of its sources changes: the kernel's file, a kernel that it calls, the value of a constant in one of
them, numba or this package. There is no ``fastmath`` and no reordering: results are the same in all modes, and on
every x86-64 processor since 2013 with the same C library.

With ``NUMBA_DISABLE_JIT=1`` in the environment all kernels stay Python functions: a debugger steps
through them, coverage counts their lines, and everything is some hundred times slower.
"""

import linecache
import os
from collections.abc import Callable, Mapping
from functools import partial
from types import FunctionType
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol, TypeVar

import lazy_loader
import numpy as np

from teleop_core.kernels.callables import raise_pending
from teleop_core.kernels.compiled_kernel import CompiledKernel, pointer_to
from teleop_core.kernels.dependencies import Tokens, hexdigest
from teleop_core.kernels.layout import record_dtype, records

__all__ = [
    "IS_COMPILED",
    "Kernel",
    "bound",
    "direct",
    "inner",
    "is_kernel",
    "kernel",
    "kernel_from_source",
    "pointer",
    "raise_pending",
    "record_dtype",
    "records",
]

IS_COMPILED: bool = os.environ.get("NUMBA_DISABLE_JIT", "0") in {"", "0"}
"""Whether kernels are compiled; False in pure-Python mode."""

P = ParamSpec("P")
R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)

_written: dict[str, tuple[Mapping[str, object], Any]] = {}


class Kernel(Protocol[P, R_co]):
    """A kernel; it is called like the function from which it was made."""

    @property
    def __name__(self) -> str: ...

    @property
    def py_func(self) -> Callable[P, R_co]:
        """The Python function before compilation."""

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R_co:
        """Call the compiled function."""


def kernel(function: Callable[P, R_co]) -> Kernel[P, R_co]:
    """Compile a pure function over float64 arrays and records.

    The kernel releases the interpreter lock, so that other threads run in parallel. Arrays must be writable: numba
    compiles a second time for read-only arrays. If no file can be written beside the source, or the function was
    entered interactively, it is compiled in every process.

    Raises:
        KernelError: The function cannot be compiled. This is raised not here, but when the kernel is first called,
            compiled for other arguments or made a pointer.
    """
    return _made(function)


def inner(function: Callable[P, R_co]) -> Kernel[P, R_co]:
    """Compile a kernel that only other kernels call; compilation is about a quarter faster than with :func:`kernel`.

    A call from Python raises TypeError, except in pure-Python mode.
    """
    return _made(function, is_inner=True)


def is_kernel(value: object) -> bool:
    """Whether a value was made by :func:`kernel`, :func:`inner` or :func:`kernel_from_source`."""
    if IS_COMPILED:
        return isinstance(value, CompiledKernel)
    return isinstance(value, FunctionType) and getattr(value, "py_func", None) is value


def kernel_from_source(text: str, name: str, names: Mapping[str, object]) -> Any:
    """Kernel from source text that the program generated.

    The kernel is cached on disk like other kernels: the same text that calls the same kernels with the same constants
    is compiled once. Tracebacks show the lines of the text.

    Args:
        text: Python source that defines a function. The function must not make arrays, but kernels that it calls may.
        name: Name of that function.
        names: Objects to which the text refers: kernels, constants, modules.
    """
    tokens = Tokens()
    values = [f"{key}={tokens.of(value)}" for key, value in sorted(names.items())]
    key = hexdigest((text, name, *values))
    if key in _written:  # kernels may have been redefined under the same names
        before, made = _written[key]
        if all(before[known] is value for known, value in names.items()):
            return made
    function = _executed(text, name, names, key)
    made = _made(function, is_generated=True)
    _written[key] = (dict(names), made)
    return made


def _executed(text: str, name: str, names: Mapping[str, object], key: str) -> FunctionType:
    """Function of a source text; its qualified name is unique for each text and meaning of names."""
    file = f"<{name} {key}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    space: dict[str, Any] = {**names, "__name__": __name__}
    exec(compile(text, file, "exec"), space)
    function: FunctionType = space[name]
    function.__qualname__ = f"{name}_{key}"
    return function


def _made(function: Any, **options: bool) -> Any:
    """Kernel of a function; in pure-Python mode the function itself."""
    if IS_COMPILED:
        return CompiledKernel(function, **options)
    function.py_func = function
    return function


def pointer(function: Callable[P, R], signature: Any) -> Callable[P, R]:
    """Function as a value of a fixed signature, which kernels accept as an argument and call.

    A plain Python function also works, if the signature has only float64, int64, bool and C-contiguous float64 arrays
    (n,) or (n, m), and returns void, float64 or int64. A Python function gets views of the kernel's arrays and may
    write to them. If it raises an exception, the kernel continues with 0, and :func:`raise_pending` raises the first
    such exception after the block.

    With three arrays as arguments, the call of a compiled kernel takes 0.005 µs. The call of a Python function takes
    0.5 µs plus its own work: with ``out[:] = a * b`` 1.2 µs in all. Making the pointer of a Python function takes 40
    ms.

    Args:
        function: A kernel, or a plain Python function or other callable.
        signature: Types as in ``"float64(float64[::1], int64)"``; all functions that may be passed for this argument
            have the same.

    Returns:
        The callable to pass to a kernel, one for each kernel and signature. If Python calls it, it runs the Python
        function.

    Raises:
        KernelError: The function cannot be compiled, or called, with this signature.
    """
    made: Any = pointer_to(function, signature) if IS_COMPILED else function
    return made


def bound(compiled: Callable[P, R], *arguments: P.args, **_: P.kwargs) -> Callable[[], R]:
    """Kernel with bound arguments, whose types are therefore not checked at each call.

    The bound arguments stay the same objects. Numbers keep their present value; pass changing values in arrays and
    records. With function pointers among the arguments this saves two thirds of the time of a call. The kernel is
    compiled here, so that a mistake in it is reported here.

    Args:
        compiled: A kernel; a plain Python function is bound unchanged.
        arguments: All arguments of the kernel, in order.

    Raises:
        KernelError: The kernel cannot be compiled for these arguments.
    """
    if not isinstance(compiled, CompiledKernel):
        return partial(compiled, *arguments)
    return partial(compiled.entry(arguments), *map(_memory, arguments))


def _memory(value: Any) -> Any:
    """Memory of a record, also of records in a tuple.

    Numba looks up a record's attributes at every call, which takes 1 µs each.
    """
    if isinstance(value, np.void):
        return _Memory(value)
    return tuple(map(_memory, value)) if isinstance(value, tuple) else value


def direct(compiled: Callable[P, R], signature: Any) -> Callable[P, R]:
    """Kernel for arguments of one signature, called without a check of their types.

    This saves 0.15 µs per call. The caller must pass the right types: arguments of other types are misread. A plain
    Python function is returned unchanged.

    Args:
        compiled: A kernel.
        signature: Types of the kernel's result and arguments, as for :func:`pointer`.

    Raises:
        KernelError: The kernel cannot be compiled for these arguments.
    """
    if not isinstance(compiled, CompiledKernel):
        return compiled
    found: Callable[P, R] = compiled.entry_of(signature)
    return found


class _Memory:
    """Array interface of a record, for compiled code; it describes only the bytes of the record.

    NumPy's own interface also describes all fields at each call, which takes 5 µs for a record of a hundred fields.
    """

    __slots__ = ("data",)

    def __init__(self, record: Any) -> None:
        self.data = memoryview(record).cast("B")


if TYPE_CHECKING:
    from teleop_core.kernels.addresses import *  # noqa: F403
    from teleop_core.kernels.fields import *  # noqa: F403
    from teleop_core.kernels.geometry import *  # noqa: F403
    from teleop_core.kernels.groups import *  # noqa: F403
    from teleop_core.kernels.parts import *  # noqa: F403
    from teleop_core.kernels.portable import *  # noqa: F403
else:  # imported when they are first used
    _NAMES = {
        "addresses": ("Addressed", "addressed", "call_address", "held"),
        "fields": ("Fields", "IntegerPerJoint", "Integers", "PerJoint", "PoseRow", "Quaternion", "Vector3", "Wrench",
            "fields_of", "record", "record_array"),
        "geometry": ("Array", "checked_array", "is_rigid", "multiply_quaternions", "pose_from_transform", "rotation",
            "rotations_from_quaternions", "transform", "turn_by"),
        "groups": ("group_fields",),
        "parts": ("fenced", "is_whole", "numbers_of"),
        "portable": ("arctangent", "dot", "inverse_motion", "length", "product"),
    }  # fmt: skip
    __getattr__ = lazy_loader.attach(__name__, None, _NAMES)[0]
