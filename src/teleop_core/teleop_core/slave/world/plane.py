"""Plane: everything below a flat surface through the middle."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.base.parameters import parameter
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.portable import length
from teleop_core.slave.world import WorldObject

_DRAWN = 0.05  # half of what is drawn of it [m]


@dataclass(frozen=True, kw_only=True)
class PlaneParameters:
    """A flat surface."""

    normal: tuple[float, ...] = parameter(
        (0.0, 0.0, 1.0), lower=-1.0, upper=1.0, length=3, doc="out of the object, of any length"
    )

    def __post_init__(self) -> None:
        if not math.hypot(*self.normal) > 0.0:
            raise ParameterError("plane.normal", self.normal, "a direction")


@kernel
def plane_distance(offset: Array, shape: Array, normal: Array) -> float:
    """Write the plane's normal (3,); returns how far a point (3,) [m] is above it."""
    size = math.sqrt(shape[0] * shape[0] + shape[1] * shape[1] + shape[2] * shape[2])
    above = 0.0
    for i in range(3):
        normal[i] = shape[i] / size
        above += normal[i] * offset[i]
    return above


def across(normal: Array) -> tuple[Array, Array]:
    """Two vectors (3,) of length 1 at right angles to a normal (3,) and to each other."""
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= length(first)
    return first, np.cross(normal, first)


def square(normal: Array) -> Array:
    """A square of 100 mm around the middle, (5, 3) [m], across a normal (3,) of length 1."""
    first, second = across(normal)
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    return _DRAWN * np.array([a * first + b * second for a, b in corners])


def plane_outline(parameters: PlaneParameters) -> Array:
    """A square of 100 mm around the middle, (5, 3) [m]."""
    return square(np.array(parameters.normal) / length(parameters.normal))


PLANE = WorldObject("plane", PlaneParameters, plane_distance, plane_outline)
