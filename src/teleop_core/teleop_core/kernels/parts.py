"""Parts: the numbers that a part's kernel takes, and arrays to try it with.

Compiled code checks no index. What lies behind an array in a session is another part's memory; in
a trial it is a fence of NaN, which is seen in the result when it is read, and gone when written.
"""

import numpy as np

from teleop_core.base.parameters import values_of
from teleop_core.kernels.geometry import Array

_FENCE = 256


def numbers_of(parameters: object) -> Array:
    """Numbers of a parameter group in their order, tuples one by one, as its kernel takes them."""
    row: list[float] = []
    for value in values_of(parameters).values():
        row.extend(value if isinstance(value, tuple) else (value,))  # type: ignore[arg-type]
    return np.array(row, dtype=np.float64)


def fenced(values: Array) -> tuple[Array, Array]:
    """Copy of an array in front of a fence, and the fence.

    Args:
        values: Array of any shape.

    Returns:
        C-contiguous copy, and the NaN (256,) that follow it in memory.
    """
    whole = np.full(values.size + _FENCE, np.nan)
    array = whole[: values.size].reshape(values.shape)
    array[...] = values
    return array, whole[values.size :]


def is_whole(fence: Array) -> bool:
    """Whether nothing was written beyond the array in front of a fence."""
    return bool(np.isnan(fence).all())
