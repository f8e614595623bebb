"""Palpate: press down on one point after another with a given force, hold the force, and release."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.graph import topics
from teleop_core.hand.tasks import Task, attempts
from teleop_core.kernels import Array, kernel

_FORCE = topics.TASK_STATE.columns.index("force")


@dataclass(frozen=True, kw_only=True)
class PalpateParameters(attempts.PressedParameters):
    """Points to press, below a row of points along y; the tip is in the middle of the row when the task begins."""

    count: int = parameter(5, Within(1, 99), "number of places in the row")
    spacing: float = parameter(0.005, Within(0.0, 0.1, "m"), "distance between neighbouring places")
    force: float = parameter(0.5, Within(0.01, 100.0, "N"), "wanted pressing force along z")
    tolerance: float = parameter(
        0.2, Within(1e-3, 100.0, "N"), "largest difference between the pressing force and the wanted force"
    )
    hold: float = parameter(0.5, Within(0.0, 60.0, "s"), "time for which the pressing force must be within tolerance")
    yielding: float = parameter(
        0.003, Within(1e-5, 0.1, "m/N"), "depth of the goal below the tip for each newton of missing force"
    )


@kernel
def palpate_judge(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Set the goal above a point, then lower until the force is right, then at the next point after the hold.

    ``memory`` contains the start position (3,), whether the tip presses, and the time since which the force is right
    [s].
    """
    if state[0] == 0.0:
        for i in range(3):
            memory[i] = scene[1 + i]
    elif memory[3] == 0.0:
        if attempts.is_at_goal(scene, state):
            memory[3], memory[4], state[_FORCE] = 1.0, scene[0], numbers[5]
        return
    else:
        missing = numbers[5] - scene[11]
        state[4] = scene[3] - missing * numbers[8]
        beside = math.hypot(scene[1] - state[2], scene[2] - state[3])
        if beside > 0.5 * numbers[0] or abs(missing) > numbers[6]:
            memory[4] = scene[0]
        miss = attempts.failed(numbers, memory, scene)
        if miss == attempts.NONE and scene[0] - memory[4] < numbers[7]:
            return
        attempts.end_attempt(memory, scene, state, miss)
    memory[3], state[_FORCE], place = 0.0, 0.0, state[0] % numbers[3] - 0.5 * (numbers[3] - 1.0)
    y = memory[1] + place * numbers[4]
    attempts.begin_goal(memory, scene, state, attempts.PASS, memory[0], y, memory[2], numbers[0])


PALPATE = Task("palpate", PalpateParameters, palpate_judge)
