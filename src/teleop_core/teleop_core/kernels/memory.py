"""Memory: arrays at addresses and calls of C functions, for kernels that exchange bytes with a C library.

An address is a plain integer in a record. Whoever stores it there keeps the memory alive. Nothing is checked: a wrong
address ends the process.
"""

import ctypes
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import float64, int32, int64, types, uint8
from numba.core import cgutils
from numba.extending import intrinsic, overload

from teleop_core.kernels import IS_COMPILED
from teleop_core.kernels.fields import Integers
from teleop_core.kernels.geometry import Array

__all__ = ["Octets", "call", "floats", "integers", "octets", "shorts"]

Octets = np.ndarray[Any, np.dtype[np.uint8]]

if IS_COMPILED:

    @intrinsic
    def _pointer(_context: Any, address: Any) -> Any:
        """Address as an untyped pointer."""

        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], cgutils.voidptr_t)

        return types.voidptr(address), generate

    @intrinsic
    def _call(_context: Any, function: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
        """Call of a C function of up to four arguments; the calling convention ignores further ones."""

        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            word = ir.IntType(64)
            kind = ir.FunctionType(ir.IntType(32), [word] * 4)
            return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

        return types.int32(types.int64, types.int64, types.int64, types.int64, types.int64), generate


def _array(address: int, count: int, kind: Any) -> Any:
    return np.ctypeslib.as_array((kind * count).from_address(address))


def floats(address: int, count: int) -> Array:
    """Array (count,) of float64 at an address."""
    found: Array = _array(address, count, ctypes.c_double)
    return found


def integers(address: int, count: int) -> Integers:
    """Array (count,) of int64 at an address."""
    found: Integers = _array(address, count, ctypes.c_int64)
    return found


def shorts(address: int, count: int) -> Any:
    """Array (count,) of int32 at an address."""
    return _array(address, count, ctypes.c_int32)


def octets(address: int, count: int) -> Octets:
    """Array (count,) of bytes at an address."""
    found: Octets = _array(address, count, ctypes.c_uint8)
    return found


def call(function: int, a: int, b: int, c: int, d: int) -> int:
    """Call a C function of up to four integer or pointer arguments at an address; returns its int32."""
    of = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_size_t] * 4)
    return of(int(function))(int(a), int(b), int(c), int(d))


if IS_COMPILED:
    for _plain, _kind in ((floats, float64), (integers, int64), (shorts, int32), (octets, uint8)):

        def _compiled(kind: Any) -> Any:
            return lambda address, count: lambda address, count: numba.carray(_pointer(address), count, kind)  # type: ignore[call-arg, attr-defined]

        overload(_plain)(_compiled(_kind))

    # numba compares the signatures of both functions, annotations too.
    overload(call)(lambda function, a, b, c, d: lambda function, a, b, c, d: _call(function, a, b, c, d))  # type: ignore[call-arg]  # noqa: PLW0108
