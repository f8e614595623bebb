"""Plane: everything below a flat surface through the middle, such as a table."""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.kernels import Array, kernel
from teleop_core.shapes import Shape
from teleop_core.shapes.basis import directions, drawing


@dataclass(frozen=True, kw_only=True)
class PlaneParameters:
    """A flat surface."""

    normal: tuple[float, ...] = parameter(
        (0.0, 0.0, 1.0),
        Within(-1.0, 1.0),
        "normal of the plane, pointing out of the shape; its length does not matter",
        length=3,
    )

    def __post_init__(self) -> None:
        directions.require_direction("plane.normal", self.normal)


@kernel
def plane_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the unit normal of a plane to ``out`` (3,); return the height [m] of the point ``offset`` (3,) above it.

    ``numbers``: the normal, of any length, and the plane's height above the middle [m].
    """
    normal = directions.unit(numbers[0], numbers[1], numbers[2])
    out[0], out[1], out[2] = normal
    return directions.part_along(offset, normal) - numbers[3]


def plane_numbers(parameters: PlaneParameters) -> Array:
    """Numbers that :func:`plane_distance` takes."""
    return np.array((*parameters.normal, 0.0))


def plane_outline(parameters: PlaneParameters) -> Array:
    """A square of 100 mm around the middle, (5, 3) [m]."""
    return drawing.square(drawing.unit_vector(parameters.normal))


PLANE = Shape("plane", PlaneParameters, plane_distance, plane_outline, plane_numbers)
