"""Cone: a funnel that leads to its tip, for example to a port."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.kernels import Array, dot, kernel
from teleop_core.shapes import Shape
from teleop_core.shapes.basis import directions, drawing

_LEAST = 0.01  # half of the drawn height of a cone whose tip is at the middle [m]


@dataclass(frozen=True, kw_only=True)
class ConeParameters:
    """A cone, open without end on the side away from its tip."""

    apex: tuple[float, ...] = parameter(
        (0.0, -0.03, 0.0),
        Within(-0.5, 0.5, "m"),
        "distance from the middle of the cone to its tip",
        length=3,
        source="assumed: the width of the published box",
    )
    axis: tuple[float, ...] = parameter(
        (0.0, 1.0, 0.0), Within(-1.0, 1.0), "axis, from the tip into the cone; its length does not matter", length=3
    )
    half_angle: float = parameter(
        0.4,
        Within(0.01, 1.5, "rad"),
        "angle from the axis to the wall of the cone",
        source="assumed: with it, the cone at its middle is nearly as wide as the published box",
    )

    def __post_init__(self) -> None:
        directions.require_direction("cone.axis", self.axis)


@kernel
def cone_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the outward direction of a cone (3,); return the distance [m] of a point (3,) outside it.

    The nearest point is on the wall, or is the cone's tip for points beyond the tip.
    """
    axis = directions.unit(numbers[3], numbers[4], numbers[5])
    cosine, sine = math.cos(numbers[6]), math.sin(numbers[6])
    for i in range(3):
        out[i] = offset[i] - numbers[i]
    from_tip = directions.length_of(out)
    along = directions.part_along(out, axis)
    aside = directions.take_along(out, along, axis)
    distance = aside * cosine - along * sine
    if along * cosine + aside * sine <= 0.0 and from_tip > directions.MIDDLE:
        for i in range(3):
            out[i] = offset[i] - numbers[i]
        return from_tip
    if aside <= directions.ON_AXIS:
        aside = directions.look_across(axis, out)
    for i in range(3):
        out[i] = cosine / aside * out[i] - sine * axis[i]
    return distance


def cone_outline(parameters: ConeParameters) -> Array:
    """A rim and four lines from the rim to the tip; the middle of the shape is halfway between rim and tip."""
    axis, tip = drawing.unit_vector(parameters.axis), np.array(parameters.apex)
    height = 2.0 * max(-float(dot(axis, tip)), _LEAST)
    rim = drawing.ring(tip + height * axis, axis, height * math.tan(parameters.half_angle))
    sides = [np.stack((rim[i], tip, rim[i + 20])) for i in (0, 10)]
    return drawing.with_lifts([rim, *sides])


CONE = Shape("cone", ConeParameters, cone_distance, cone_outline)
