"""Attempts: what tasks share: presses, goals that are set, and attempts at them that are counted.

A task's memory holds from :data:`KEPT` on: place of the tip when the goal was set (3,) [m], the
time then [s], and whether the hand was closed.
"""

import math
from dataclasses import dataclass

from teleop_core.base.parameters import parameter
from teleop_core.graph.topics import TASK_STATE
from teleop_core.kernels import inner
from teleop_core.kernels.geometry import Array

KEPT = 59
_PASS = 1  # Act.PASS, which imports this
_SINCE, _CLOSED = KEPT + 3, KEPT + 4
_OPENS, _CLOSES = 0.4, 0.6  # closing at which a hand counts as open and closed again
(_NUMBER, _ACT, _GOAL, _, _, _WIDTH, _ATTEMPTS, _SUCCESSES, _ERRORS, _WAY, _OFF, _TIME) = range(
    len(TASK_STATE.columns)
)


@inner
def was_pressed(memory: Array, closing: float) -> bool:
    """Whether the hand closes just now, which it did not in the tick before."""
    before = memory[_CLOSED]
    if closing >= _CLOSES:
        memory[_CLOSED] = 1.0
    elif closing <= _OPENS:
        memory[_CLOSED] = 0.0
    return bool(memory[_CLOSED] > before)


@inner
def begin_goal(
    memory: Array, scene: Array, state: Array, act: int, x: float, y: float, z: float, width: float
) -> None:
    """Set the next goal at a place [m], as wide as it is [m]."""
    state[_NUMBER] += 1.0
    state[_ACT], state[_WIDTH] = float(act), width
    state[_GOAL], state[_GOAL + 1], state[_GOAL + 2] = x, y, z
    for i in range(3):
        memory[KEPT + i] = scene[1 + i]
    memory[_SINCE] = scene[0]


@inner
def tell_attempt(memory: Array, scene: Array, state: Array) -> bool:
    """Count an attempt at the goal where the tip is now; returns whether it succeeded."""
    way, along, off = 0.0, 0.0, 0.0
    for i in range(3):
        to_goal = state[_GOAL + i] - memory[KEPT + i]
        beyond = scene[1 + i] - state[_GOAL + i]
        way += to_goal * to_goal
        along += to_goal * beyond
        off += beyond * beyond
    way = math.sqrt(way)
    is_there = math.sqrt(off) <= 0.5 * state[_WIDTH]
    state[_ATTEMPTS] += 1.0
    state[_SUCCESSES if is_there else _ERRORS] += 1.0
    state[_WAY], state[_OFF] = way, along / max(way, 1e-12)
    state[_TIME] = scene[0] - memory[_SINCE]
    return is_there


@dataclass(frozen=True, kw_only=True)
class LedParameters:
    """How a goal that is followed is judged; first of the numbers of a task that leads."""

    width: float = parameter(
        0.006, unit="m", lower=1e-4, upper=0.1, doc="twice the distance from it that is near"
    )
    step: float = parameter(
        0.5, unit="s", lower=0.01, upper=60.0,
        doc="after which the tip is judged each time, and the next place counts as a goal",
    )  # fmt: skip


@inner
def lead_on(numbers: Array, memory: Array, scene: Array, state: Array, y: float, z: float) -> None:
    """Move a goal that is followed by (y, z) [m] from where the task began, and judge each step.

    Args:
        numbers: Of the task, those of :class:`LedParameters` first.
        memory: Of the task; holds the place where it began (3,), and the time of the next step [s].
        scene: What the task sees.
        state: Of the task; written.
        y: Where the goal is now, from the place where the task began [m].
        z: The same along z [m].
    """
    if state[_NUMBER] == 0.0:
        for i in range(3):
            memory[i] = scene[1 + i]
    x, y, z = memory[0], memory[1] + y, memory[2] + z
    if state[_NUMBER] == 0.0 or scene[0] >= memory[3]:
        if state[_NUMBER] > 0.0:
            tell_attempt(memory, scene, state)
        memory[3] = scene[0] + numbers[1]
        begin_goal(memory, scene, state, _PASS, x, y, z, numbers[0])
    state[_GOAL], state[_GOAL + 1], state[_GOAL + 2] = x, y, z
