"""Insert: move the tip into a hole to a given depth, and out again, repeatedly."""

import math
from dataclasses import dataclass

from teleop_core.base import ParameterError, Within, parameter
from teleop_core.graph import topics
from teleop_core.hand.tasks import Task, attempts
from teleop_core.kernels import Array, kernel

_CLEARANCE = topics.TASK_STATE.columns.index("clearance")


@dataclass(frozen=True, kw_only=True)
class InsertParameters(attempts.PressedParameters):
    """Position of the hole, and depth of the insertion; the object with the hole is a part of the world."""

    place: tuple[float, ...] = parameter(
        (0.3, 0.0, 0.0),
        Within(-10.0, 10.0, "m"),
        "position of the hole's mouth in the slave's base; the same as world.place",
        length=3,
    )
    axis: tuple[float, ...] = parameter(
        (0.0, 0.0, 1.0),
        Within(-1.0, 1.0),
        "axis of the hole, pointing out of its mouth; the same as world.hole.axis",
        length=3,
    )
    depth: float = parameter(0.01, Within(1e-3, 0.5, "m"), "depth of the goal inside the hole")
    outside: float = parameter(
        0.008, Within(0.0, 0.5, "m"), "distance of the first goal from the mouth, outside the hole"
    )
    clearance: float = parameter(
        0.0,
        Within(0.0, 0.1, "m"),
        "radial clearance between tool and hole, which the hand takes into account; 0: it does not",
    )

    def __post_init__(self) -> None:
        if not any(self.axis):
            raise ParameterError("task.insert.axis", self.axis, "longer than 0")


@kernel
def insert_judge(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Set the goal in front of the hole, then inside; each insertion is an attempt.

    ``memory`` contains whether the goal is inside.
    """
    if state[0] > 0.0:
        is_there, was_inside = attempts.is_at_goal(scene, state), memory[0] > 0.0
        miss = attempts.failed(numbers, memory, scene) if was_inside else attempts.NONE
        if not is_there and miss == attempts.NONE:
            return
        if was_inside:
            attempts.end_attempt(memory, scene, state, miss)
        memory[0] = 0.0 if was_inside else 1.0
    x, y, z = numbers[6], numbers[7], numbers[8]
    out = (-numbers[9] if memory[0] > 0.0 else numbers[10]) / math.sqrt(x * x + y * y + z * z)
    goal_x, goal_y, goal_z = numbers[3] + out * x, numbers[4] + out * y, numbers[5] + out * z
    attempts.begin_goal(memory, scene, state, attempts.PASS, goal_x, goal_y, goal_z, numbers[0])
    state[_CLEARANCE] = memory[0] * numbers[11]


INSERT = Task("insert", InsertParameters, insert_judge)
