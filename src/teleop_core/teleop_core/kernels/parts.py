"""Parts: the numbers that are passed to a part's kernel, and arrays for trial calls.

Compiled code does not check indices. In a session, the memory after an array belongs to another part. In a trial,
there is a fence of NaN after the array: if the kernel reads the fence, NaN appears in the result; if the kernel writes
to the fence, a NaN of the fence is overwritten.
"""

import numpy as np

from teleop_core.base.parameters import values_of
from teleop_core.kernels.geometry import Array

_FENCE = 256


def numbers_of(parameters: object) -> Array:
    """Numbers of a parameter group in order, with tuples flattened, as its kernel expects them."""
    row: list[float] = []
    for value in values_of(parameters).values():
        row.extend(value if isinstance(value, tuple) else (value,))  # type: ignore[arg-type]
    return np.array(row, dtype=np.float64)


def fenced(values: Array) -> tuple[Array, Array]:
    """Copy of an array in front of a fence, and the fence.

    Args:
        values: Array of any shape.

    Returns:
        C-contiguous copy, and the 256 NaN values (256,) that follow it in memory.
    """
    whole = np.full(values.size + _FENCE, np.nan)
    array = whole[: values.size].reshape(values.shape)
    array[...] = values
    return array, whole[values.size :]


def is_whole(fence: Array) -> bool:
    """Whether nothing was written beyond the array in front of a fence."""
    return bool(np.isnan(fence).all())
