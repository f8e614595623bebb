"""Sphere: a ball around the middle."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base.parameters import parameter
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array
from teleop_core.slave.world import WorldObject

MIDDLE = 1e-150
"""Of ways shorter than this [m] squares underflow, so that they lead nowhere."""


@dataclass(frozen=True, kw_only=True)
class SphereParameters:
    """A ball."""

    radius: float = parameter(0.015, unit="m", lower=1e-3, upper=1.0, doc="of the ball")


@kernel
def sphere_distance(offset: Array, shape: Array, normal: Array) -> float:
    """Write the direction (3,) from the middle; returns the distance (3,) [m] from the ball."""
    x, y, z = offset[0], offset[1], offset[2]
    distance = math.sqrt(x * x + y * y + z * z)
    normal[0] = normal[1] = 0.0
    normal[2] = 1.0
    if distance > MIDDLE:
        normal[0], normal[1], normal[2] = x / distance, y / distance, z / distance
    return distance - shape[0]


def great_circles(radius: float) -> Array:
    """Three circles (N, 3) [m] around the middle; every one passes through two poles."""
    angle = np.linspace(0.0, 2.0 * math.pi, 41)
    circle = np.stack((np.cos(angle), np.sin(angle), np.zeros_like(angle)), axis=1)
    lift = np.full((1, 3), np.nan)
    circles = (circle, lift, np.roll(circle, 1, axis=1), lift, np.roll(circle, 2, axis=1))
    return radius * np.concatenate(circles)


def sphere_outline(parameters: SphereParameters) -> Array:
    """Three great circles, (N, 3) [m] around the middle."""
    return great_circles(parameters.radius)


SPHERE = WorldObject("sphere", SphereParameters, sphere_distance, sphere_outline)
