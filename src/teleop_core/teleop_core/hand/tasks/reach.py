"""Reach: move to one pose after another, anywhere in a box, as fast as possible."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.graph import topics
from teleop_core.hand.tasks import Task, attempts
from teleop_core.kernels import Array, kernel
from teleop_core.kernels.geometry import rotate_by_vector

_ATTITUDE, _TURN = (topics.TASK_STATE.columns.index(name) for name in ("goal_qw", "turn"))
# Powers of the inverse of the plastic number's relative in three dimensions, 1.2207440846…
_STEPS = (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)


@dataclass(frozen=True, kw_only=True)
class ReachTaskParameters:
    """A box around the position of the tip when the task begins."""

    size: tuple[float, ...] = parameter(
        (0.01, 0.04, 0.04), Within(0.0, 0.5, "m"), "edge lengths of the box that contains the goals", length=3
    )
    width: float = parameter(0.004, Within(1e-4, 0.1, "m"), "diameter of a goal, which is a ball")
    longest: float = parameter(
        10.0, Within(0.1, 600.0, "s"), "longest time for a goal; if it takes longer, the goal counts as an error"
    )
    first: int = parameter(0, Within(0, 10**6), "index of the first goal in the sequence of goals")
    turn: float = parameter(
        0.0, Within(0.0, 1.5, "rad"), "largest turn of a goal's attitude; 0: any attitude of the tool is accepted"
    )
    turn_width: float = parameter(
        0.2, Within(0.01, 3.0, "rad"), "twice the largest angle between the tool's attitude and the goal's"
    )


@kernel
def reach_judge(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Set the next goal when the tip has reached the present goal, or takes too long.

    Goals fill the box evenly, as the additive recurrence of Roberts 2018 does.

    ``memory`` contains the middle of the box (3,), and the tool's attitude when the task began (4,).
    """
    if state[0] == 0.0:
        for i in range(7):
            memory[i] = scene[1 + i]
    elif attempts.is_at_goal(scene, state):
        attempts.tell_attempt(memory, scene, state)
    elif attempts.waited(memory, scene) >= numbers[4]:
        attempts.end_attempt(memory, scene, state, attempts.LATE)
    else:
        return
    at = state[0] + numbers[5] + 1.0
    goal_x = memory[0] + numbers[0] * ((0.5 + at * _STEPS[0]) % 1.0 - 0.5)
    goal_y = memory[1] + numbers[1] * ((0.5 + at * _STEPS[1]) % 1.0 - 0.5)
    goal_z = memory[2] + numbers[2] * ((0.5 + at * _STEPS[2]) % 1.0 - 0.5)
    attempts.begin_goal(memory, scene, state, attempts.PASS, goal_x, goal_y, goal_z, numbers[3])
    if numbers[6] > 0.0:  # turn the goal about an axis that varies over all directions
        height, angle = 2.0 * (at * _STEPS[0] % 1.0) - 1.0, 2.0 * math.pi * (at * _STEPS[1] % 1.0)
        size, across = numbers[6] * (0.25 + 0.75 * (at * _STEPS[2] % 1.0)), math.sqrt(1.0 - height * height)
        x, y = size * across * math.cos(angle), size * across * math.sin(angle)
        rotate_by_vector(memory[3:7], x, y, size * height, state[_ATTITUDE : _ATTITUDE + 4])
        state[_TURN] = numbers[7]


REACH = Task("reach", ReachTaskParameters, reach_judge)
