"""Trace: follow a point that goes round on a ring, as near as a target is wide."""

import math
from dataclasses import dataclass

from teleop_core.base.parameters import parameter
from teleop_core.chain.tasks import Task
from teleop_core.chain.tasks.attempts import lead_on
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array


@dataclass(frozen=True, kw_only=True)
class TraceParameters:
    """A ring in the slave's y-z plane, on which the place where the task begins lies lowest."""

    diameter: float = parameter(0.03, unit="m", lower=1e-3, upper=0.5, doc="of the ring")
    period: float = parameter(
        12.0, unit="s", lower=0.5, upper=600.0, doc="in which the point goes round once"
    )
    width: float = parameter(
        0.006, unit="m", lower=1e-4, upper=0.1, doc="twice the distance from it that is near"
    )
    step: float = parameter(
        0.5, unit="s", lower=0.01, upper=60.0,
        doc="after which the tip is judged each time, and the next place counts as a goal",
    )  # fmt: skip


@kernel
def trace_judge(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Move the goal on, and count at each step whether the tip is near it."""
    radius, angle = 0.5 * numbers[0], 2.0 * math.pi * scene[0] / numbers[1]
    y, z = radius * math.sin(angle), radius * (1.0 - math.cos(angle))
    lead_on(memory, scene, state, y, z, numbers[2], numbers[3])


TRACE = Task("trace", TraceParameters, trace_judge)
