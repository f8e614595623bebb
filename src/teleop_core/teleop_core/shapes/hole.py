"""Hole: a round hole through the middle of a round plate, with a chamfer around its mouth."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError, Within, parameter
from teleop_core.kernels import Array, inner, kernel, length
from teleop_core.shapes import Shape
from teleop_core.shapes.basis import directions, drawing


@dataclass(frozen=True, kw_only=True)
class HoleParameters:
    """A round plate with a hole; the middle of the shape is the middle of the hole's mouth."""

    radius: float = parameter(0.0055, Within(1e-4, 1.0, "m"), "radius of the hole")
    thickness: float = parameter(0.03, Within(1e-3, 1.0, "m"), "thickness of the plate")
    plate_radius: float = parameter(0.025, Within(1e-3, 2.0, "m"), "radius of the plate")
    chamfer: float = parameter(
        0.002, Within(0.0, 0.5, "m"), "width and depth of the 45° chamfer around the hole's mouth"
    )
    axis: tuple[float, ...] = parameter(
        (0.0, 0.0, 1.0),
        Within(-1.0, 1.0),
        "axis of the hole, pointing out of its mouth; its length does not matter",
        length=3,
    )

    def __post_init__(self) -> None:
        directions.require_direction("hole.axis", self.axis)
        if not self.chamfer < self.thickness:
            text = f"less than thickness ({self.thickness:g} m)"
            raise ParameterError("hole.chamfer", self.chamfer, text)
        if not self.radius + self.chamfer < self.plate_radius:
            text = f"more than radius and chamfer ({self.radius + self.chamfer:g} m)"
            raise ParameterError("hole.plate_radius", self.plate_radius, text)

    @property
    def out(self) -> Array:
        """Unit vector (3,) along the axis, out of the mouth."""
        return np.array(self.axis) / length(self.axis)

    def depth(self, ways: Array) -> float:
        """Largest depth [m] in the hole of points (N, 3) [m], given relative to the mouth; 0 if no point is inside."""
        deep = -(ways * self.out).sum(axis=1)
        beside = length(ways + deep[:, None] * self.out)
        is_inside = (beside < self.radius + self.chamfer) & (deep <= self.thickness)
        return float(deep[is_inside].max(initial=0.0))


@inner
def _section_depth(out: float, up: float, shape: Array) -> tuple[float, float, float]:
    """Distance of a point from the plane of the nearest face; above 0 for a point outside.

    Arguments and results are those of :func:`_section_distance`.
    """
    radius, thickness, rim, chamfer = shape[0], shape[1], shape[2], shape[3]
    diagonal = math.sqrt(0.5)
    sloping = diagonal * (up - out + radius + chamfer)
    distance, way_out, way_up = up, 0.0, 1.0
    if sloping > distance:
        distance, way_out, way_up = sloping, -diagonal, diagonal
    if radius - out > distance:
        distance, way_out, way_up = radius - out, -1.0, 0.0
    if -thickness - up > distance:
        distance, way_out, way_up = -thickness - up, 0.0, -1.0
    if out - rim > distance:
        distance, way_out, way_up = out - rim, 1.0, 0.0
    return distance, way_out, way_up


@inner
def _section_distance(out: float, up: float, shape: Array) -> tuple[float, float, float]:
    """Distance of a point from the plate, in a section through the axis.

    The section is convex: its faces are top, chamfer, wall of the hole, bottom and rim. For a point inside, the
    distance from the nearest face is taken; for a point outside, the distance from the nearest point of all faces.

    Args:
        out: Distance from the axis [m].
        up: Height above the mouth [m].
        shape: Radius of the hole, thickness and radius of the plate, width of the chamfer [m].

    Returns:
        The distance [m], negative inside; the component of the outward direction along ``out``; its component along
        ``up``.
    """
    distance, way_out, way_up = _section_depth(out, up, shape)
    if distance <= 0.0:
        return distance, way_out, way_up
    radius, thickness, rim, chamfer = shape[0], shape[1], shape[2], shape[3]
    along = min(max(0.5 * (out - radius + up + chamfer), 0.0), chamfer)
    distance = math.inf
    for face in range(5):
        if face == 0:
            x, z = out - min(max(out, radius + chamfer), rim), up
        elif face == 1:
            x, z = out - radius - along, up + chamfer - along
        elif face == 2:
            x, z = out - radius, up - min(max(up, -thickness), -chamfer)
        elif face == 3:
            x, z = out - min(max(out, radius), rim), up + thickness
        else:
            x, z = out - rim, up - min(max(up, -thickness), 0.0)
        beyond = math.sqrt(x * x + z * z)
        if beyond <= directions.MIDDLE:  # the point is on a face, up to rounding
            return _section_depth(out, up, shape)
        if beyond < distance:
            distance, way_out, way_up = beyond, x / beyond, z / beyond
    return distance, way_out, way_up


@kernel
def hole_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the outward direction of the plate (3,); return the distance [m] of a point (3,) outside it.

    For a point on the axis all directions to the wall are equally long; an arbitrary direction is taken.
    """
    axis = directions.unit(numbers[4], numbers[5], numbers[6])
    up = directions.part_along(offset, axis)
    for i in range(3):
        out[i] = offset[i]
    aside = long = directions.take_along(out, up, axis)
    if aside <= directions.ON_AXIS:
        long = directions.look_across(axis, out)
    distance, way_out, way_up = _section_distance(aside, up, numbers)
    for i in range(3):
        out[i] = way_out * out[i] / long + way_up * axis[i]
    return distance


def hole_outline(parameters: HoleParameters) -> Array:
    """Circles at both ends of the chamfer, of the hole and of the plate, (N, 3) [m] relative to the middle."""
    p, axis = parameters, drawing.unit_vector(parameters.axis)
    rings = (
        (p.radius + p.chamfer, 0.0),
        (p.radius, p.chamfer),
        (p.radius, p.thickness),
        (p.plate_radius, 0.0),
        (p.plate_radius, p.thickness),
    )
    return drawing.with_lifts([drawing.ring(-deep * axis, axis, wide) for wide, deep in rings])


HOLE = Shape("hole", HoleParameters, hole_distance, hole_outline)
