"""Trace: follow a point that moves around a ring, within the width of a target."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.hand.tasks import Task, attempts
from teleop_core.kernels import Array, kernel


@dataclass(frozen=True, kw_only=True)
class TraceParameters(attempts.LedParameters):
    """A ring in the slave's y-z plane; the start of the task is its lowest point."""

    diameter: float = parameter(0.03, Within(1e-3, 0.5, "m"), "diameter of the ring")
    period: float = parameter(12.0, Within(0.5, 600.0, "s"), "time in which the point goes once around the ring")


@kernel
def trace_judge(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Move the goal, and count at each step whether the tip is near the goal."""
    radius, angle = 0.5 * numbers[2], 2.0 * math.pi * scene[0] / numbers[3]
    y, z = radius * math.sin(angle), radius * (1.0 - math.cos(angle))
    attempts.lead_on(numbers, memory, scene, state, y, z)


TRACE = Task("trace", TraceParameters, trace_judge)
