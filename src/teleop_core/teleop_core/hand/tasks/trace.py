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
    waits: bool = parameter(
        False, doc="whether the point goes on by a step only when the tip is near it: tracing at a pace of one's own"
    )


@kernel
def trace_judge(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Move the goal, and count at each step whether the tip is near the goal; a goal that waits counts when it is."""
    waits, time = numbers[4] > 0.0, scene[0]
    if waits and state[0] > 0.0:
        if not attempts.is_at_goal(scene, state):
            return
        memory[3] = scene[0]  # the step is over
        memory[4] += numbers[1]
    if waits:
        time = memory[4]
    radius, angle = 0.5 * numbers[2], 2.0 * math.pi * time / numbers[3]
    y, z = radius * math.sin(angle), radius * (1.0 - math.cos(angle))
    attempts.lead_on(numbers, memory, scene, state, y, z)


TRACE = Task("trace", TraceParameters, trace_judge)
