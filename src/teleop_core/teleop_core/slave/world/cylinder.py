"""Cylinder: an upright post with flat ends."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base.parameters import parameter
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array
from teleop_core.slave.world import WorldObject
from teleop_core.slave.world.sphere import MIDDLE


@dataclass(frozen=True, kw_only=True)
class CylinderParameters:
    """A post along the base's z."""

    radius: float = parameter(0.02, unit="m", lower=1e-3, upper=1.0, doc="of the post")
    height: float = parameter(0.03, unit="m", lower=1e-3, upper=2.0, doc="from end to end")


@kernel
def cylinder_distance(offset: Array, shape: Array, normal: Array) -> float:
    """Write the way out of a post (3,); returns how far a point (3,) [m] is outside."""
    x, y, z = offset[0], offset[1], offset[2]
    from_axis = math.sqrt(x * x + y * y)
    aside, above = from_axis - shape[0], abs(z) - 0.5 * shape[1]
    along_x = x / from_axis if from_axis > MIDDLE else 1.0
    along_y = y / from_axis if from_axis > MIDDLE else 0.0
    out, up = max(aside, 0.0), max(above, 0.0)
    distance = math.sqrt(out * out + up * up)
    if distance > MIDDLE:
        out, up = out / distance, up / distance
    else:
        distance = max(aside, above)
        out, up = (1.0, 0.0) if aside > above else (0.0, 1.0)
    normal[0], normal[1], normal[2] = out * along_x, out * along_y, math.copysign(up, z)
    return distance


def cylinder_outline(parameters: CylinderParameters) -> Array:
    """Both ends and a line between them, (82, 3) [m] around the middle."""
    angle = np.linspace(0.0, 2.0 * math.pi, 41)
    x, y = parameters.radius * np.cos(angle), parameters.radius * np.sin(angle)
    half = 0.5 * parameters.height
    return np.concatenate([np.stack((x, y, np.full(41, z)), axis=1) for z in (-half, half)])


CYLINDER = WorldObject("cylinder", CylinderParameters, cylinder_distance, cylinder_outline)
