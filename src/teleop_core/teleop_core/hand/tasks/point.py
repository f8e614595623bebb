"""Point: press in targets on a ring, alternately on opposite sides, as in tests of pointing devices."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.hand.tasks import Task, attempts
from teleop_core.kernels import Array, kernel


@dataclass(frozen=True, kw_only=True)
class PointParameters:
    """A ring of targets around the position of the tip when the task begins."""

    count: int = parameter(
        13,
        Within(3, 99),
        "number of targets on the ring",
        source="published: ISO/TS 9241-411 2012 requires an odd number, and shows 13 and 25 in its figures",
    )
    diameter: float = parameter(0.03, Within(1e-3, 0.5, "m"), "diameter of the ring")
    width: float = parameter(0.004, Within(1e-4, 0.1, "m"), "diameter of a target, which is a ball")
    normal: tuple[float, ...] = parameter(
        (1.0, 0.0, 0.0),
        Within(-1.0, 1.0),
        "axis of the ring in the slave's base; its length does not matter, but must not be 0",
        length=3,
    )
    stays: bool = parameter(False, doc="whether a target stays until it is hit; its time runs on after a miss")
    by_entering: bool = parameter(False, doc="whether a target counts as soon as the tip enters it, without a press")


@kernel
def point_judge(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Count presses inside and outside of the target, or entries; each sets the next target.

    Successive targets are on opposite sides of the ring (ISO/TS 9241-411 2012, annex B).

    ``memory`` contains the middle of the ring (3,) and the number of the target on its way around the ring, then the
    values of :mod:`~teleop_core.hand.tasks.attempts`.
    """
    if state[0] == 0.0:
        for i in range(3):
            memory[i] = scene[1 + i]
    elif numbers[7] > 0.0:
        if not attempts.is_at_goal(scene, state):
            return
        attempts.tell_attempt(memory, scene, state)
        memory[3] += 1.0
    elif not attempts.was_pressed(memory, scene[8]):
        return
    else:
        attempts.tell_attempt(memory, scene, state)
        if numbers[6] > 0.0 and not attempts.is_at_goal(scene, state):
            state[0] += 1.0  # the same target again
            return
        memory[3] += 1.0
    if numbers[6] == 0.0:
        memory[3] = state[0]
    n, radius = int(numbers[0]), 0.5 * numbers[1]
    at = int(memory[3]) * ((n + 1) // 2) % n
    angle = 2.0 * math.pi * at / n
    x, y, z = numbers[3], numbers[4], numbers[5]
    size = max(math.sqrt(x * x + y * y + z * z), 1e-12)
    x, y, z = x / size, y / size, z / size
    # Two axes perpendicular to the normal: a horizontal one if it exists, and the one perpendicular to both.
    flat = math.sqrt(x * x + y * y)
    ax, ay = (-y / flat, x / flat) if flat > 1e-6 else (1.0, 0.0)
    along, across = radius * math.cos(angle), radius * math.sin(angle)
    goal_x = memory[0] + along * ax - across * z * ay
    goal_y = memory[1] + along * ay + across * z * ax
    goal_z = memory[2] + across * (x * ay - y * ax)
    act = attempts.PASS if numbers[7] > 0.0 else attempts.PRESS
    attempts.begin_goal(memory, scene, state, act, goal_x, goal_y, goal_z, numbers[2])


POINT = Task("point", PointParameters, point_judge)
