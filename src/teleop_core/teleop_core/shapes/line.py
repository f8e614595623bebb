"""Line: all points within a radius of a straight line; for guidance along the line, or as a wire."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.kernels import Array, kernel, numbers_of
from teleop_core.shapes import Shape
from teleop_core.shapes.basis import directions, drawing


@dataclass(frozen=True, kw_only=True)
class LineParameters:
    """A line."""

    radius: float = parameter(
        0.001,
        Within(0.0, 0.1, "m"),
        "points up to this distance from the line are inside the shape",
        source="assumed: deviation of a relaxed hand without a guiding force",
    )
    length: float = parameter(
        0.0, Within(0.0, 2.0, "m"), "length of the line, with the middle at half of it; 0: infinite, without ends"
    )
    direction: tuple[float, ...] = parameter(
        (1.0, 0.0, 0.0), Within(-1.0, 1.0), "direction of the line; its length does not matter", length=3
    )

    def __post_init__(self) -> None:
        directions.require_direction("line.direction", self.direction)


@kernel
def rod_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Distance [m] of a point from the surface of a rod; negative inside.

    ``offset`` (3,) is the point, relative to the middle of the rod. ``out`` (3,) receives the vector from the nearest
    point of the rod's axis to the point. ``numbers`` are the rod's radius and length [m], and its direction.
    """
    axis = directions.unit(numbers[2], numbers[3], numbers[4])
    along = directions.between_ends(directions.part_along(offset, axis), numbers[1])
    for i in range(3):
        out[i] = offset[i]
    distance = directions.take_along(out, along, axis)
    if distance <= directions.ON_AXIS:
        directions.look_across(axis, out)
    return distance - numbers[0]


def endless_if_zero(parameters: object) -> Array:
    """Numbers of a shape whose number 1 (counted from 0) is a length; a length of 0 becomes infinite."""
    numbers = numbers_of(parameters)
    numbers[1] = numbers[1] or math.inf
    return numbers


def line_outline(parameters: LineParameters) -> Array:
    """End points of the line, (2, 3) [m] relative to the middle."""
    length = parameters.length or drawing.DRAWN
    half = 0.5 * length * drawing.unit_vector(parameters.direction)
    return np.stack((-half, half))


LINE = Shape("line", LineParameters, rod_distance, line_outline, endless_if_zero)
