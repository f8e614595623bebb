"""Memory: arrays at addresses and calls of C functions, for kernels that exchange bytes with a C library.

An address is a plain integer in a record. Whoever stores it there keeps the memory alive. Nothing is checked: a wrong
address ends the process.
"""

import ctypes
from typing import Any

import numpy as np

from teleop_core.kernels.fields import Integers
from teleop_core.kernels.geometry import Array

__all__ = ["Octets", "call", "floats", "integers", "octets", "shorts"]

Octets = np.ndarray[Any, np.dtype[np.uint8]]


def _array(address: int, count: int, kind: Any) -> Any:
    return np.ctypeslib.as_array((kind * int(count)).from_address(int(address)))


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
