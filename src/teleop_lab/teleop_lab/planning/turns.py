"""Turns: the maps of axes onto axes."""

import itertools
import math
from functools import cache

import numpy as np

from teleop_core.kernels.axes import AXES


@cache
def turns() -> tuple[tuple[str, ...], ...]:
    """The 24 maps of axes that do not mirror, as ``motion_scaling.axes`` takes them."""
    found = []
    for axes in itertools.product(AXES, repeat=3):
        matrix = np.zeros((3, 3))
        for row, axis in enumerate(axes):
            matrix[row, "xyz".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
        if math.isclose(float(np.linalg.det(matrix)), 1.0):
            found.append(axes)
    return tuple(found)
