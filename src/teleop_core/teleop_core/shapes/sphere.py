"""Sphere: a ball around the middle."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.kernels import Array, kernel
from teleop_core.shapes import Shape
from teleop_core.shapes.basis import directions, drawing


@dataclass(frozen=True, kw_only=True)
class SphereParameters:
    """A ball."""

    radius: float = parameter(
        0.015, Within(5e-5, 1.0, "m"), "radius of the sphere", source="assumed: as wide as the published box"
    )


@kernel
def sphere_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the vector (3,) from the middle to a point, or z at the middle; return the point's distance outside [m]."""
    x, y, z = offset[0], offset[1], offset[2]
    distance = math.sqrt(x * x + y * y + z * z)  # products, because plain Python rounds powers differently
    out[0], out[1], out[2] = x, y, z
    if distance <= directions.MIDDLE:
        out[2] = 1.0
    return distance - numbers[0]


def sphere_outline(parameters: SphereParameters) -> Array:
    """Three great circles, (N, 3) [m] around the middle."""
    return drawing.great_circles(parameters.radius)


SPHERE = Shape("sphere", SphereParameters, sphere_distance, sphere_outline)
