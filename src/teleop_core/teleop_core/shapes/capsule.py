"""Capsule: a rod with round ends, such as a vessel or a finger."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base.parameters import Within, parameter
from teleop_core.kernels.geometry import Array
from teleop_core.shapes import Shape, line
from teleop_core.shapes.basis import directions, drawing


@dataclass(frozen=True, kw_only=True)
class CapsuleParameters:
    """A rod with round ends."""

    radius: float = parameter(0.01, Within(5e-5, 1.0, "m"), "radius of the rod and of its round ends")
    length: float = parameter(0.06, Within(0.0, 2.0, "m"), "distance between the centres of both round ends")
    direction: tuple[float, ...] = parameter(
        (0.0, 1.0, 0.0), Within(-1.0, 1.0), "axis of the rod; its length does not matter", length=3
    )

    def __post_init__(self) -> None:
        directions.require_direction("capsule.direction", self.direction)


def capsule_outline(parameters: CapsuleParameters) -> Array:
    """Silhouette of the capsule from two sides, (N, 3) [m] around the middle."""
    axis, angle = drawing.unit_vector(parameters.direction), np.linspace(0.0, math.pi, 21)[:, None]
    end = 0.5 * parameters.length * axis
    loops = []
    for aside in drawing.across(axis):
        cap = end + parameters.radius * (np.cos(angle) * aside + np.sin(angle) * axis)
        loops.append(np.concatenate((cap, -cap, cap[:1])))
    return drawing.with_lifts(loops)


CAPSULE = Shape("capsule", CapsuleParameters, line.rod_distance, capsule_outline)
