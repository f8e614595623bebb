"""Catch: press once at a target that rests or accelerates, then at the next one, each at a distance from the tip."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.hand.tasks import Task, attempts
from teleop_core.kernels import Array, kernel

# Successive multiples fill a circle evenly: the golden ratio, and the square root of two [turns].
_DIRECTION, _FLIGHT = 0.6180339887498949, 0.41421356237309515


@dataclass(frozen=True, kw_only=True)
class CatchParameters:
    """A target in the slave's y-z plane, in a direction that looks random."""

    distance: float = parameter(0.02, Within(1e-3, 0.5, "m"), "distance of a new target from the tip")
    width: float = parameter(0.005, Within(1e-4, 0.1, "m"), "diameter of a target, which is a ball")
    acceleration: float = parameter(
        0.0,
        Within(0.0, 10.0, "m/s²"),
        "acceleration of the target from rest, in any direction of the plane; 0: it does not move",
    )
    room: float = parameter(
        0.06, Within(1e-3, 1.0, "m"), "a target that would appear farther from the start appears on the other side"
    )


@kernel
def catch_judge(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Move the target; a press ends the attempt, inside or outside of it, and sets the next target.

    ``memory`` contains the start of the tip (3,), the place of the target at rest (3,), and the angle of its flight,
    then the values of :mod:`~teleop_core.hand.tasks.attempts`.
    """
    if state[0] == 0.0:
        for i in range(3):
            memory[i] = scene[1 + i]
    else:
        gone = 0.5 * numbers[2] * attempts.waited(memory, scene) ** 2
        state[3] = memory[4] + gone * math.cos(memory[6])
        state[4] = memory[5] + gone * math.sin(memory[6])
        if not attempts.was_pressed(memory, scene[8]):
            return
        attempts.tell_attempt(memory, scene, state)
    at, distance = state[0] + 1.0, numbers[0]
    angle = 2.0 * math.pi * (at * _DIRECTION % 1.0)
    y, z = scene[2] + distance * math.cos(angle), scene[3] + distance * math.sin(angle)
    if math.hypot(y - memory[1], z - memory[2]) > numbers[3]:
        angle += math.pi
        y, z = scene[2] + distance * math.cos(angle), scene[3] + distance * math.sin(angle)
    memory[3], memory[4], memory[5] = scene[1], y, z
    memory[6] = angle + 2.0 * math.pi * (at * _FLIGHT % 1.0)
    attempts.begin_goal(memory, scene, state, attempts.PRESS, scene[1], y, z, numbers[1])


CATCH = Task("catch", CatchParameters, catch_judge)
