"""Empty: nothing to touch."""

import numpy as np

from teleop_core.base import NoParameters
from teleop_core.kernels import Array, kernel
from teleop_core.shapes import Shape


@kernel
def empty_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the distance to a plane far below; the simulator never calls this function."""
    out[0], out[1], out[2] = 0.0, 0.0, 1.0
    return offset[2] + 1e3


def empty_outline(_: NoParameters) -> Array:
    """No lines, (0, 3)."""
    return np.empty((0, 3))


EMPTY = Shape("empty", NoParameters, empty_distance, empty_outline)
