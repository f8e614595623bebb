"""Trace: follow a point that goes round on a ring, as near as a target is wide."""

import math
from dataclasses import dataclass

from teleop_core.base.parameters import parameter
from teleop_core.chain.tasks import Act, Task
from teleop_core.chain.tasks.attempts import begin_goal, tell_attempt
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array

_PASS = int(Act.PASS)


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
    """Move the goal on, and count at each step whether the tip is near it.

    ``memory`` holds the place where it began (3,), and the time of the next step [s].
    """
    if state[0] == 0.0:
        for i in range(3):
            memory[i] = scene[1 + i]
    radius, angle = 0.5 * numbers[0], 2.0 * math.pi * scene[0] / numbers[1]
    y, z = memory[1] + radius * math.sin(angle), memory[2] + radius * (1.0 - math.cos(angle))
    if state[0] == 0.0 or scene[0] >= memory[3]:
        if state[0] > 0.0:
            tell_attempt(memory, scene, state)
        memory[3] = scene[0] + numbers[3]
        begin_goal(memory, scene, state, _PASS, memory[0], y, z, numbers[2])
    state[2], state[3], state[4] = memory[0], y, z


TRACE = Task("trace", TraceParameters, trace_judge)
