"""Capsule: a rod with round ends, such as a vessel or a finger."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base.parameters import parameter
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array
from teleop_core.slave.world import WorldObject
from teleop_core.slave.world.sphere import MIDDLE


@dataclass(frozen=True, kw_only=True)
class CapsuleParameters:
    """A rod with round ends along the base's y."""

    radius: float = parameter(0.01, unit="m", lower=1e-3, upper=1.0, doc="of rod and ends")
    length: float = parameter(0.06, unit="m", lower=0.0, upper=2.0, doc="between the ends' middles")


@kernel
def capsule_distance(offset: Array, shape: Array, normal: Array) -> float:
    """Write the way (3,) from the rod's axis; returns how far a point (3,) [m] is outside."""
    half = 0.5 * shape[1]
    x, z = offset[0], offset[2]
    y = offset[1] - min(max(offset[1], -half), half)
    distance = math.sqrt(x * x + y * y + z * z)
    normal[0] = normal[1] = 0.0
    normal[2] = 1.0
    if distance > MIDDLE:
        normal[0], normal[1], normal[2] = x / distance, y / distance, z / distance
    return distance - shape[0]


def capsule_outline(parameters: CapsuleParameters) -> Array:
    """Its silhouette from two sides, (N, 3) [m] around the middle."""
    angle = np.linspace(0.0, math.pi, 21)
    half, r = 0.5 * parameters.length, parameters.radius
    end = np.stack((r * np.cos(angle), half + r * np.sin(angle)), axis=1)
    loop = np.concatenate((end, -end, end[:1]))
    zero, lift = np.zeros(len(loop)), np.full((1, 3), np.nan)
    flat = np.stack((loop[:, 0], loop[:, 1], zero), axis=1)
    upright = np.stack((zero, loop[:, 1], loop[:, 0]), axis=1)
    return np.concatenate((flat, lift, upright))


CAPSULE = WorldObject("capsule", CapsuleParameters, capsule_distance, capsule_outline)
