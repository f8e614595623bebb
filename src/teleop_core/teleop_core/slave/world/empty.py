"""Empty: nothing to touch."""

import numpy as np

from teleop_core.base.parameters import NoParameters
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array
from teleop_core.slave.world import WorldObject


@kernel
def empty_distance(offset: Array, shape: Array, normal: Array) -> float:
    """As of a plane far below, which the simulator never asks for."""
    normal[0] = normal[1] = 0.0
    normal[2] = 1.0
    return offset[2] + 1e3


def empty_outline(_: NoParameters) -> Array:
    """No lines, (0, 3)."""
    return np.empty((0, 3))


EMPTY = WorldObject("empty", NoParameters, empty_distance, empty_outline)
