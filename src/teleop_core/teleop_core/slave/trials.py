"""Trials: arrays to try a part with, which show what it reads or writes beyond their ends.

Compiled code checks no index. What lies behind an array in a session is another part's memory; in
a trial it is a fence of NaN, which is seen in the result when it is read, and gone when written.
"""

import numpy as np

from teleop_core.kernels.geometry import Array

_FENCE = 256


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
