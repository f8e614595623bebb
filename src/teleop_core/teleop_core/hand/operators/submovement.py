"""Submovement: one movement of an operator who corrects by sight, the wanted displacement, and the doubt after it."""

import math
from typing import NamedTuple

import numpy as np

from teleop_core.graph import STATE, topics
from teleop_core.hand.operators import Seen
from teleop_core.hand.operators.glances import Glance
from teleop_core.hand.operators.hand_room import turned
from teleop_core.hand.operators.observer_parameters import ObserverParameters
from teleop_core.hand.operators.shapes import minimum_jerk
from teleop_core.kernels import Array, dot, length

_WIDTH, _CLEARANCE = map(topics.TASK_STATE.columns.index, ("width", "clearance"))
_BOX, _SIZE = STATE["fixture_center_x"], STATE["fixture_size_x"]
PRESS_TIME = 0.06
"""Duration of a press of the hand, and of the clutch's press before and after a motion [s]."""
_SURE = 2.0  # distance of a submovement's end from a wall, divided by the standard deviation of that end


class Way(NamedTuple):
    """Wanted motion: displacement of the tip (3,) [m] in the slave's base, rotation (3,) [rad] in the tool's frame."""

    step: Array
    turn: Array
    lever: float  # displacement that counts as much as a rotation of one radian [m]; 0: no rotation is required
    missing: float = 0.0  # share of the required force

    @property
    def both(self) -> Array:
        """Displacement and weighted rotation (6,) [m]."""
        return np.concatenate((self.step, self.lever * self.turn))


class Move(NamedTuple):
    """A submovement: its start time and duration [s], and the motion of the hand."""

    begin: float
    duration: float
    start: Array  # position (3,) [m] and attitude (4,) of the hand when the movement starts, relative to rest
    step: Array  # displacement of the hand (3,) [m]
    turn: Array  # rotation of the stylus in its own frame (3,) [rad]
    seen: Glance  # data that were seen when the submovement began
    way: Way  # path of the tip, as the hand feels it
    unseen: Array  # motions that were felt but not yet seen, including this one (6,) [m]
    is_clutched: bool = False  # the slave does not follow


def draw(move: Move | None, turns: bool, times: Array, rows: Array) -> None:
    """Write a submovement into rows (N, 13) of an operator's motion at times (N,) [s], from its beginning on.

    Args:
        move: The submovement; without one nothing is written.
        turns: Whether the stylus is turned.
        times: Times [s].
        rows: Rows as of :data:`~teleop_core.hand.operators.Motion`; written.
    """
    if move is None:
        return
    if not move.is_clutched and not turns and move.begin + move.duration < times[0]:
        rows[:, :3] = move.start[:3] + move.step  # the submovement is over
        return
    share, has_begun = minimum_jerk((times - move.begin) / move.duration), times >= move.begin
    moved = move.start[:3] + share[:, None] * move.step
    rows[:, :3] = np.where(has_begun[:, None], moved, rows[:, :3])
    if turns:
        rotations = np.array([turned(move.start[3:], s * move.turn)[1] for s in share])
        rows[:, 3:6] = np.where(has_begun[:, None], rotations, rows[:, 3:6])
    if move.is_clutched:
        rows[:, 6] = (times >= move.begin - PRESS_TIME) & (times < move.begin + move.duration + PRESS_TIME)


class Doubt(NamedTuple):
    """Error of the seen place of the tip, and the standard deviation that the operator knows of it."""

    place: Array  # (3,) [m]
    turn: Array  # (3,) [rad]
    spread: float = 0.0  # [m]
    turn_spread: float = 0.0  # [rad]


SURE = Doubt(np.zeros(3), np.zeros(3))
"""No doubt: the tip was seen at rest."""


def chance_inside(off: float, spread: float, width: float) -> float:
    """Probability that a place with a normal error lies within a width.

    Args:
        off: Believed distance from the middle [m or rad].
        spread: Standard deviation of the error, in the same unit; 0: no error.
        width: Width, in the same unit.
    """
    scale = math.sqrt(2.0) * max(spread, 1e-12)
    return 0.5 * (math.erf((0.5 * width - off) / scale) + math.erf((0.5 * width + off) / scale))


def end_noise(p: ObserverParameters, rng: np.random.Generator, way: Array, duration: float) -> Array:
    """Error of the end (3,) of a displacement [m] or rotation [rad] that the hand makes in ``duration`` [s]."""
    if not way.any():
        return way
    distance, noise = float(length(way)), rng.standard_normal(3)
    along = way / distance
    ahead = along * float(dot(along, noise))
    return p.noise * distance / duration * (ahead + p.noise_across * (noise - ahead))


def careful_time(p: ObserverParameters, seen: Seen, tip: Array, step: Array) -> float:
    """Duration [s] at which the noise of a step (3,) [m] does not reach walls or edges; 0 without walls and edges.

    The fixture's walls are those of its box. The operator aims no more exactly than the goal requires.
    """
    state, task, across, slowest = seen.state, seen.task, p.noise_across, 0.0
    if task[_CLEARANCE] > 0.0:
        slowest = across * float(length(step)) / float(task[_CLEARANCE])
    if state[STATE["is_fixture_on"]] > 0.0 and state[_SIZE] > 0.0:
        gap = 0.5 * state[_SIZE : _SIZE + 3] - np.abs(tip + step - state[_BOX : _BOX + 3])
        lean = np.sqrt(step * step * (1.0 - across**2) + across**2 * float(dot(step, step)))
        slowest = max(slowest, float((lean / np.maximum(gap, 0.5 * task[_WIDTH])).max()))
    return _SURE * p.noise * slowest
