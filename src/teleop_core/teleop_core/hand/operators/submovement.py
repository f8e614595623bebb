"""Submovement: one move of an operator who looks, and the way that it is to go."""

from typing import NamedTuple

import numpy as np

from teleop_core.hand.operators.glances import Glance
from teleop_core.kernels import Array


class Way(NamedTuple):
    """What is to be done: way of the tip (3,) [m] in the slave's base, turn (3,) [rad] in the tool's frame."""

    step: Array
    turn: Array
    lever: float  # way that counts as much as a turn of one radian [m]; 0: no turn is asked for
    missing: float = 0.0  # share of the force that is asked for

    @property
    def both(self) -> Array:
        """Way and turn (6,) [m], as they count."""
        return np.concatenate((self.step, self.lever * self.turn))


class Move(NamedTuple):
    """A submovement: its begin and duration [s], and where the hand goes and turns."""

    begin: float
    duration: float
    start: Array  # place (3,) [m] and attitude (4,) of the hand at its begin, from those at rest
    step: Array  # of the hand (3,) [m]
    turn: Array  # of the stylus in its own frame (3,) [rad]
    seen: Glance  # what was seen when it began
    way: Way  # of the tip, as the hand feels
    unseen: Array  # that way, and those before it that were felt and not seen (6,) [m]
    is_clutched: bool = False  # the slave does not follow
