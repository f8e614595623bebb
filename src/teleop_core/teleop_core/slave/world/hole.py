"""Hole: a round hole through the middle of a round plate, with a chamfer around its mouth."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.base.parameters import parameter
from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.portable import length
from teleop_core.slave.world import WorldObject
from teleop_core.slave.world.plane import across

_ON_AXIS = 1e-12  # nearer to the axis no way from it is known [m]


@dataclass(frozen=True, kw_only=True)
class HoleParameters:
    """A round plate and a hole through it; the object's middle is that of the hole's mouth."""

    radius: float = parameter(0.0055, unit="m", lower=1e-4, upper=1.0, doc="of the hole")
    thickness: float = parameter(0.03, unit="m", lower=1e-3, upper=1.0, doc="of the plate")
    plate_radius: float = parameter(0.025, unit="m", lower=1e-3, upper=2.0, doc="of the plate")
    chamfer: float = parameter(
        0.002, unit="m", lower=0.0, upper=0.5,
        doc="width and depth of the chamfer of 45° around the mouth",
    )  # fmt: skip
    axis: tuple[float, ...] = parameter(
        (0.0, 0.0, 1.0), lower=-1.0, upper=1.0, length=3,
        doc="of the hole, out of its mouth, of any length",
    )  # fmt: skip

    def __post_init__(self) -> None:
        if not math.hypot(*self.axis) > 0.0:
            raise ParameterError("hole.axis", self.axis, "a direction")
        if not self.chamfer < self.thickness:
            text = f"less than thickness ({self.thickness:g} m)"
            raise ParameterError("hole.chamfer", self.chamfer, text)
        if not self.radius + self.chamfer < self.plate_radius:
            text = f"more than radius and chamfer ({self.radius + self.chamfer:g} m)"
            raise ParameterError("hole.plate_radius", self.plate_radius, text)


@inner
def _section_depth(out: float, up: float, shape: Array) -> tuple[float, float, float]:
    """How far the plane of the nearest face is from a place; above 0 where that is outside.

    Arguments and results as of :func:`_section_distance`.
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
    """How far a place in the section through the axis is outside of the plate.

    The section is convex: its faces are top, chamfer, wall of the hole, bottom and rim. Inside the
    nearest face counts, outside the nearest of the nearest points of all faces.

    Args:
        out: From the axis [m].
        up: Above the mouth [m].
        shape: Radius of the hole, thickness and radius of the plate, width of the chamfer [m].

    Returns:
        The distance [m], negative inside; and the way out, along ``out`` and along ``up``.
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
        if beyond < distance:
            distance, way_out, way_up = beyond, x / beyond, z / beyond
    return distance, way_out, way_up


@kernel
def hole_distance(offset: Array, shape: Array, normal: Array) -> float:
    """Write the way out of the plate (3,); returns how far a point (3,) [m] is outside.

    On the axis, where all ways to the wall are as long, one of them is taken.
    """
    axis, up, square = shape[4:], 0.0, 0.0
    size = math.sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2])
    for k in range(3):
        up += offset[k] * axis[k] / size
    for k in range(3):
        normal[k] = offset[k] - up * axis[k] / size
        square += normal[k] * normal[k]
    out = long = math.sqrt(square)
    if out <= _ON_AXIS:
        least = 0
        for k in range(3):
            least = k if abs(axis[k]) < abs(axis[least]) else least
        for k in range(3):
            normal[k] = (1.0 if k == least else 0.0) - axis[least] * axis[k] / (size * size)
        long = math.sqrt(1.0 - axis[least] * axis[least] / (size * size))
    distance, way_out, way_up = _section_distance(out, up, shape)
    for k in range(3):
        normal[k] = way_out * normal[k] / long + way_up * axis[k] / size
    return distance


def hole_outline(parameters: HoleParameters) -> Array:
    """Both ends of the chamfer, of the hole and of the plate, (N, 3) [m] around the middle."""
    axis = np.array(parameters.axis) / length(parameters.axis)
    first, second = across(axis)
    angle, lift = np.linspace(0.0, 2.0 * math.pi, 41)[:, None], np.full((1, 3), np.nan)
    ring = np.cos(angle) * first + np.sin(angle) * second
    p = parameters
    rings = ((p.radius + p.chamfer, 0.0), (p.radius, p.chamfer), (p.radius, p.thickness),
             (p.plate_radius, 0.0), (p.plate_radius, p.thickness))  # fmt: skip
    return np.concatenate(
        [np.concatenate((wide * ring - deep * axis, lift)) for wide, deep in rings]
    )


HOLE = WorldObject("hole", HoleParameters, hole_distance, hole_outline)
