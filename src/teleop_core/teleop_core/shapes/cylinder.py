"""Cylinder: a tube or post with flat ends, along any direction."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.kernels import Array, kernel
from teleop_core.shapes import Shape, line
from teleop_core.shapes.basis import directions, drawing


@dataclass(frozen=True, kw_only=True)
class CylinderParameters:
    """A tube or a post."""

    radius: float = parameter(
        0.015, Within(5e-5, 1.0, "m"), "radius of the cylinder", source="assumed: as wide as the published box"
    )
    length: float = parameter(
        0.03,
        Within(0.0, 2.0, "m"),
        "length of the cylinder; 0: infinite, without ends",
        source="assumed: as long as the published box",
    )
    direction: tuple[float, ...] = parameter(
        (0.0, 1.0, 0.0), Within(-1.0, 1.0), "axis of the cylinder; its length does not matter", length=3
    )

    def __post_init__(self) -> None:
        directions.require_direction("cylinder.direction", self.direction)


@kernel
def cylinder_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the outward direction of a tube (3,); return the distance [m] of a point (3,) outside it."""
    axis = directions.unit(numbers[2], numbers[3], numbers[4])
    along = directions.part_along(offset, axis)
    for i in range(3):
        out[i] = offset[i]
    from_axis = directions.take_along(out, along, axis)
    aside, above = from_axis - numbers[0], abs(along) - 0.5 * numbers[1]
    if aside <= 0.0 and above <= 0.0 and above > aside:
        for i in range(3):
            out[i] = math.copysign(1.0, along) * axis[i]
        return above
    if from_axis <= directions.ON_AXIS:
        from_axis = directions.look_across(axis, out)
    if above <= 0.0:
        return aside
    beyond, share = math.copysign(above, along), max(aside, 0.0) / from_axis
    for i in range(3):
        out[i] = share * out[i] + beyond * axis[i]
    aside = max(aside, 0.0)
    return math.sqrt(aside * aside + above * above)


def cylinder_outline(parameters: CylinderParameters) -> Array:
    """Circles of the two ends and four lines between them, (N, 3) [m] relative to the middle."""
    axis = drawing.unit_vector(parameters.direction)
    half = 0.5 * (parameters.length or drawing.DRAWN) * axis
    ends = [drawing.ring(end, axis, parameters.radius) for end in (-half, half)]
    sides = [np.stack((ends[0][i], ends[1][i])) for i in (0, 10, 20, 30)]
    return drawing.with_lifts([*ends, *sides])


CYLINDER = Shape("cylinder", CylinderParameters, cylinder_distance, cylinder_outline, line.endless_if_zero)
