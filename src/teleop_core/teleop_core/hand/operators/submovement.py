"""Submovement: one movement of an operator who corrects by sight, the wanted displacement, and the doubt after it."""

import math
from typing import NamedTuple

import numpy as np

from teleop_core.hand.operators.glances import Glance
from teleop_core.kernels import Array


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
