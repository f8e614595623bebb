"""Tasks: goals for an operator, and the judgement whether they are reached, one file per task.

A task sets the goal of the tip, the width of the goal, and the action at the goal. It reads the true pose of the tip
and the closing of the hand, and counts attempts, successes and errors. People and simulated operators do the same
tasks. The state of a task is published as a topic, and evaluated as a score.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np

from teleop_core.base import PartError, Registry, part_check
from teleop_core.base.registry import places, tried
from teleop_core.graph import topics
from teleop_core.kernels import Array, fenced, is_whole, numbers_of, pointer

__all__ = ["MEMORY", "SCENE", "TASKS", "Act", "Miss", "Task", "register_task"]

_ROW = "float64[::1]"
JUDGE = f"void({_ROW}, {_ROW}, {_ROW}, {_ROW})"
"""Signature of a task's kernel, so that one compiled stage serves every task."""
MEMORY = 64
"""Number of values that a task remembers."""
SCENE = (
    "time", "x", "y", "z", "qw", "qx", "qy", "qz", "closing", "fx", "fy", "fz", "is_second",
    "grips", "other_grips", "transferred", "dropped",
    *(f"{axis}{i}" for i in range(topics.JAW_OBJECTS) for axis in "xyz"),
)  # fmt: skip
"""Inputs of a task: time since it began [s]; the tip's true pose in slave_base [m]; closing of the hand, 0 to 1;
contact force on the tip [N]; whether the arm is the second one; whether its jaw grips; whether the other arm's jaw
grips; number of blocks that came onto another peg; number of blocks that came onto no peg; the middle of each block
[m], zero for a missing block.
"""


class Act(IntEnum):
    """Action of the operator at the goal."""

    PRESS = 0  # close the hand at the goal for a moment, like a mouse click
    PASS = 1  # be at the goal, without an action of the hand
    GRIP = 2  # be at the goal, and keep the hand closed from then on
    LET_GO = 3  # be at the goal, and keep the hand open from then on


class Miss(IntEnum):
    """Error in an attempt at a task."""

    NONE = 0  # no error
    BESIDE = 1  # the attempt ended beside the goal
    LATE = 2  # the attempt took too long
    FORCE = 3  # the tip pressed too hard
    DROP = 4  # the carried object came to rest beside its goal
    WRONG = 5  # the carried object came to rest on another object's goal


@dataclass(frozen=True)
class Task:
    """A task.

    Attributes:
        name: Name of the task in ``--set task=``.
        parameters: Parameter group of the task.
        judge: ``judge(numbers, memory, scene, state)``, a kernel or a plain function, called every tick once the slave
            follows. ``numbers`` are the numbers of the parameters. ``memory`` (64,) is kept from tick to tick, and is
            zero at the start. ``scene`` contains the numbers that :data:`SCENE` names. ``state`` contains the numbers
            of ``task/state`` of the last tick, and is overwritten.
        numbers: ``numbers(parameters)`` returns the ``numbers`` of ``judge``, if they differ from the numbers of the
            parameters in their order.
    """

    name: str
    parameters: type
    judge: Callable[[Array, Array, Array, Array], None]
    numbers: Callable[[Any], Array] = numbers_of

    judge_pointer = cached_property(lambda self: pointer(self.judge, JUDGE))
    """The judge as an argument for kernels."""


def _try(part: Task) -> None:
    """Call the judge for some ticks, so that errors are reported before anything runs."""
    needs = "one with judge(numbers, memory, scene, state) and parameters that all have defaults"
    with tried("task", part.name, needs):
        numbers, _ = fenced(part.numbers(part.parameters()))  # an index one too large reads NaN
        memory, fence = fenced(np.zeros(MEMORY))
        state, beyond = fenced(np.zeros(len(topics.TASK_STATE.columns)))
        scene = np.zeros(len(SCENE))
        scene[SCENE.index("qw")] = 1.0
        for i in range(64):
            scene[0], scene[SCENE.index("closing")] = 1e-3 * i, float(i % 8 == 7)
            part.judge(numbers, memory, scene, state)
        _lead(part, numbers, memory, scene, state)
    if not (np.isfinite(state).all() and is_whole(fence) and is_whole(beyond)):
        text = f"one that writes {len(state)} finite numbers and remembers {MEMORY}"
        raise PartError("task", part.name, f"{text}; it writes {state.tolist()}")
    if not (state[0] >= 1.0 and state[topics.TASK_STATE.columns.index("width")] > 0.0):
        text = "one that sets a first goal at once, with a width > 0"
        raise PartError("task", part.name, f"{text}; it writes {state.tolist()}")
    tried_once, done, act = (state[topics.TASK_STATE.columns.index(name)] for name in ("attempts", "successes", "act"))
    if not done and act not in (Act.GRIP, Act.LET_GO):  # these two actions need a jaw
        text = "one that counts a success at its goal: `end_attempt` of tasks.attempts with NONE, or `tell_attempt`"
        came = f"{tried_once:.0f} attempts without one" if tried_once else "no attempt"
        raise PartError("task", part.name, f"{text}; in ten minutes at its goals it counts {came}")


def _lead(part: Task, numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Simulate a tip at each goal for ten minutes, with the required presses and forces, until an attempt succeeds."""
    at = {name: i for i, name in enumerate(topics.TASK_STATE.columns)}
    for i in range(12_000):
        if state[at["successes"]] > 0.0:
            return
        scene[0], scene[SCENE.index("closing")] = 0.064 + 0.05 * i, float(i % 8 == 7)
        scene[1:4], scene[SCENE.index("fz")] = state[at["goal_x"] : at["goal_x"] + 3], state[at["force"]]
        if state[at["turn"]] > 0.0:
            scene[4:8] = state[at["goal_qw"] : at["goal_qw"] + 4]
        part.judge(numbers, memory, scene, state)


TASKS: Registry[Task] = Registry(
    "task",
    "tasks",
    places("teleop_core.hand.tasks", "catch follow insert palpate peg_transfer point reach trace"),
    part_check("task", Task, "judge"),
    _try,
)
"""All tasks by name."""

register_task = TASKS.register
"""Adds your task under its own name; see :meth:`Registry.register`."""
