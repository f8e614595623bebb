"""Plain Python callables as compiled functions: slower, but called in the same way.

Compiled code calls them through ctypes, which holds the interpreter's lock during the call.
"""

import ctypes
import inspect
import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from teleop_core.base.errors import KernelError
from teleop_core.kernels.callables import keep
from teleop_core.kernels.compiler.mistakes import place_of

Array = NDArray[np.float64]

_MOST_VIEWS = 256  # largest number of arrays that are cached for each callable
_SCALARS: dict[Any, Any] = {types.float64: ctypes.c_double, types.int64: ctypes.c_int64, types.boolean: ctypes.c_bool}
_ARRAYS = (types.float64[::1], types.float64[:, ::1])
_TAKEN = "float64, int64, bool or a C-contiguous array of float64, 1-D or 2-D"
_RESULTS: dict[Any, tuple[Any, Callable[[Any], Any]]] = {
    types.void: (None, lambda _: None),
    types.float64: (ctypes.c_double, float),
    types.int64: (ctypes.c_int64, operator.index),
}

# C arrays do not contain their lengths. Therefore an array is passed as its address and its lengths.
_TEXT = """
def callback({flat}):
    try:
        return converted(function({seen}))
    except BaseException as error:
        keep(error)
        return 0

call = c_type(callback)

def entry({names}):
    return call({passed})
"""


def entry_of(function: Callable[..., Any], arguments: tuple[Any, ...], result: Any) -> Any:
    """Function for the compiler that calls a plain Python function.

    Args:
        function: Python function. It gets scalars unchanged and arrays as writable views of the kernel's memory, which
            are valid during the call. If it raises an exception, the kernel gets 0.
        arguments: numba types: float64, int64, boolean, C-contiguous float64 arrays (n,), (n, m).
        result: numba type: void, float64 or int64.

    Raises:
        KernelError: A type is not supported, or the function takes another number of arguments.
    """
    _check(function, arguments, result)
    c_result, converted = _RESULTS[result]
    c_arguments, flat, seen, passed = [], [], [], []
    for i, kind in enumerate(arguments):
        sizes = [f"n{i}_{axis}" for axis in range(getattr(kind, "ndim", 0))]
        c_arguments += [_SCALARS.get(kind, ctypes.c_size_t), *[ctypes.c_ssize_t] * len(sizes)]
        flat += [f"a{i}", *sizes]
        seen.append(f"view(a{i}, {', '.join(sizes)})" if sizes else f"a{i}")
        passed.append(f"a{i}.ctypes.data" if sizes else f"a{i}")
        passed += [f"a{i}.shape[{axis}]" for axis in range(len(sizes))]
    lists = {"flat": flat, "seen": seen, "passed": passed}
    lists["names"] = [f"a{i}" for i in range(len(arguments))]
    space = {
        "function": function,
        "converted": converted,
        "keep": keep,
        "view": _views(),
        "c_type": ctypes.CFUNCTYPE(c_result, *c_arguments),
    }
    exec(_TEXT.format(**{key: ", ".join(items) for key, items in lists.items()}), space)
    return space["entry"]


def _views() -> Callable[..., Array]:
    """Function that makes arrays at given addresses and caches these arrays.

    A kernel passes the same few arrays in every tick; to make an array takes 2 µs.
    """
    known: dict[tuple[int, ...], Array] = {}

    def view(*place: int) -> Array:
        found = known.get(place)
        if found is None:
            if len(known) >= _MOST_VIEWS:
                known.clear()
            address, *shape = place
            memory: Any = (ctypes.c_double * math.prod(shape)).from_address(address)
            found = known[place] = np.ndarray(shape, np.float64, memory)
        return found

    return view


def _check(function: Any, arguments: tuple[Any, ...], result: Any) -> None:
    name, place = getattr(function, "__name__", type(function).__name__), place_of(function)
    for i, kind in enumerate(arguments, 1):
        if kind not in _SCALARS and kind not in _ARRAYS:
            raise KernelError(place, f"argument {i} of {name!r} is {kind}, must be {_TAKEN}")
    if result not in _RESULTS:
        expected = "void, float64 or int64"
        raise KernelError(place, f"result of {name!r} is {result}, must be {expected}")
    try:
        inspect.signature(function).bind(*arguments)
    except TypeError as error:
        count = f"{len(arguments)} argument" + "s" * (len(arguments) != 1)
        raise KernelError(place, f"{name!r} must take {count} ({error})") from error
    except ValueError:  # a builtin whose signature is unknown
        return
