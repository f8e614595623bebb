"""Attempts: functions that tasks share to detect presses, set goals, and count attempts.

A task's memory contains, from index :data:`KEPT` on: the position of the tip when the goal was set (3,) [m], the time
when the goal was set [s], and whether the hand was closed.
"""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.graph import topics
from teleop_core.hand.tasks import SCENE, Act, Miss
from teleop_core.kernels import Array, inner

KEPT = 59
PRESS, PASS, GRIP, LET_GO = map(int, Act)
NONE, BESIDE, LATE, FORCE, DROP, WRONG = map(int, Miss)
"""Integer values of :class:`Act` and :class:`Miss` for kernels."""
_SINCE, _CLOSED = KEPT + 3, KEPT + 4
_OPENS = 0.4  # a hand whose closing falls below this counts as open
_CLOSES = 0.6  # a hand whose closing rises above this counts as closed
(_NUMBER, _ACT, _GOAL, _, _, _WIDTH, _ATTEMPTS, _SUCCESSES, _ERRORS, _WAY, _OFF, _TIME, _MISS) = range(13)
_ATTITUDE, _TURN = (topics.TASK_STATE.columns.index(name) for name in ("goal_qw", "turn"))
_PUSH = SCENE.index("fx")


@inner
def was_pressed(memory: Array, closing: float) -> bool:
    """Whether the hand closes in this tick, after it was open in the last tick."""
    before = memory[_CLOSED]
    if closing >= _CLOSES:
        memory[_CLOSED] = 1.0
    elif closing <= _OPENS:
        memory[_CLOSED] = 0.0
    return bool(memory[_CLOSED] > before)


@inner
def move_goal(state: Array, act: int, x: float, y: float, z: float, width: float) -> None:
    """Set the next goal of the same attempt at a position [m], with a width [m]."""
    state[_NUMBER] += 1.0
    state[_ACT], state[_WIDTH] = float(act), width
    state[_GOAL], state[_GOAL + 1], state[_GOAL + 2] = x, y, z


@inner
def begin_goal(memory: Array, scene: Array, state: Array, act: int, x: float, y: float, z: float, width: float) -> None:
    """Set the goal of the next attempt at a position [m], with a width [m]."""
    move_goal(state, act, x, y, z, width)
    for i in range(3):
        memory[KEPT + i] = scene[1 + i]
    memory[_SINCE] = scene[0]


@inner
def is_at_goal(scene: Array, state: Array) -> bool:
    """Whether the tip is within the goal, a ball of the goal's width, and has the required attitude."""
    off, same = 0.0, 0.0
    for i in range(3):
        off += (scene[1 + i] - state[_GOAL + i]) * (scene[1 + i] - state[_GOAL + i])
    for i in range(4):
        same += scene[4 + i] * state[_ATTITUDE + i]
    is_turned = state[_TURN] == 0.0 or 2.0 * math.acos(min(abs(same), 1.0)) <= 0.5 * state[_TURN]
    return is_turned and math.sqrt(off) <= 0.5 * state[_WIDTH]


@inner
def waited(memory: Array, scene: Array) -> float:
    """Time since the attempt began [s]."""
    return float(scene[0] - memory[_SINCE])


@inner
def end_attempt(memory: Array, scene: Array, state: Array, miss: int) -> None:
    """Count an attempt that ended at the tip's present position, with or without a :class:`Miss`."""
    way, along = 0.0, 0.0
    for i in range(3):
        to_goal = state[_GOAL + i] - memory[KEPT + i]
        way += to_goal * to_goal
        along += to_goal * (scene[1 + i] - state[_GOAL + i])
    way = math.sqrt(way)
    state[_ATTEMPTS] += 1.0
    state[_SUCCESSES if miss == NONE else _ERRORS] += 1.0
    state[_WAY], state[_OFF] = way, along / max(way, 1e-12)
    state[_TIME], state[_MISS] = waited(memory, scene), float(miss)


@dataclass(frozen=True, kw_only=True)
class PressedParameters:
    """Bounds of tasks with contact; they are the first numbers of such a task."""

    width: float = parameter(0.004, Within(1e-4, 0.1, "m"), "diameter of a goal, which is a ball")
    most: float = parameter(
        2.0, Within(0.01, 500.0, "N"), "largest force on the tip; an attempt with a larger force is an error"
    )
    longest: float = parameter(
        20.0, Within(0.1, 600.0, "s"), "longest time of an attempt; a longer attempt is an error"
    )


@inner
def failed(numbers: Array, memory: Array, scene: Array) -> int:
    """:class:`Miss` of an attempt within the bounds of :class:`PressedParameters`: FORCE, LATE, or NONE so far."""
    square = 0.0
    for i in range(3):
        square += scene[_PUSH + i] * scene[_PUSH + i]
    if math.sqrt(square) > numbers[1]:
        return FORCE
    return LATE if waited(memory, scene) > numbers[2] else NONE


@inner
def tell_attempt(memory: Array, scene: Array, state: Array) -> None:
    """Count an attempt; it succeeds if the tip is now within the goal."""
    end_attempt(memory, scene, state, NONE if is_at_goal(scene, state) else BESIDE)


@dataclass(frozen=True, kw_only=True)
class LedParameters:
    """Numbers to judge how the tip follows a moving goal; they are the first numbers of such a task."""

    width: float = parameter(
        0.006, Within(1e-4, 0.1, "m"), "twice the distance within which the tip counts as near the moving goal"
    )
    step: float = parameter(
        0.5,
        Within(0.01, 60.0, "s"),
        "period after which the tip is judged and the next position of the goal counts as a new goal",
    )


@inner
def lead_on(numbers: Array, memory: Array, scene: Array, state: Array, y: float, z: float) -> None:
    """Set a moving goal at (y, z) [m] from the start of the task, and judge each step.

    Args:
        numbers: Numbers of the task; the first ones are those of :class:`LedParameters`.
        memory: Memory of the task: the position at its start (3,), and the time of the next step [s].
        scene: Data that the task sees.
        state: State of the task; written.
        y: Present y of the goal, relative to the start of the task [m].
        z: Present z of the goal, relative to the start of the task [m].
    """
    if state[_NUMBER] == 0.0:
        for i in range(3):
            memory[i] = scene[1 + i]
    x, y, z = memory[0], memory[1] + y, memory[2] + z
    if state[_NUMBER] == 0.0 or scene[0] >= memory[3]:
        if state[_NUMBER] > 0.0:
            tell_attempt(memory, scene, state)
        memory[3] = scene[0] + numbers[1]
        begin_goal(memory, scene, state, PASS, x, y, z, numbers[0])
    state[_GOAL], state[_GOAL + 1], state[_GOAL + 2] = x, y, z
