"""Hand room: how far a hand can still move and turn, where it should return to, and how it turns the tool."""

import numpy as np

from teleop_core.hand.operators.rest import rest_pose
from teleop_core.kernels import Array, length, product
from teleop_core.kernels.axes import axis_map
from teleop_core.kernels.geometry import (
    multiply_quaternions,
    rotate_by_vector,
    rotations_from_quaternions,
    turn_between,
    turn_within,
)

_MARGIN = 2e-3  # distance from the ends of the hand's range [m]
_REST = np.array([1.0, 0.0, 0.0, 0.0])


def turned(attitude: Array, turn: Array) -> tuple[Array, Array]:
    """An attitude (4,) rotated by a vector (3,) in its own frame; the result also as a rotation vector (3,) [rad]."""
    found, vector = np.empty(4), np.empty(3)
    rotate_by_vector(attitude, turn[0], turn[1], turn[2], found)
    turn_within(_REST, found, vector)
    return found, vector


class HandRoom:
    """Range of a hand.

    Args:
        corners: Low and high corner (3,) [m], relative to the rest position of the hand.
        largest_turn: Largest rotation from the rest attitude [rad].
    """

    def __init__(self, corners: tuple[Array, Array], largest_turn: float) -> None:
        self._low, self._high, self._turn = corners[0] + _MARGIN, corners[1] - _MARGIN, largest_turn

    def share(self, hand: Array, step: Array, turn: Array) -> float:
        """Largest share, at most 1, of a step (3,) [m] and turn (3,) [rad] that a hand at a pose (7,) can make."""
        room = np.maximum(np.where(step > 0.0, self._high - hand[:3], hand[:3] - self._low), 0.0)
        shares = np.linspace(min(1.0, float((room / np.maximum(np.abs(step), 1e-12)).min())), 0.0, 21).tolist()
        return next((s for s in shares if length(turned(hand[3:], s * turn)[1]) <= self._turn), 0.0)

    def back(self, hand: Array, step: Array, turn: Array) -> tuple[Array, Array]:
        """Step (3,) [m] and turn (3,) [rad] that bring a hand to the pose with most room for the coming motion."""
        middle, angle = 0.5 * (self._low + self._high), np.zeros(3)
        begin = -min(0.5, self._turn / max(float(length(turn)), 1e-12)) * turn
        turn_within(hand[3:], turned(_REST, begin)[0], angle)
        return np.clip(middle - 0.5 * step, self._low, self._high) - hand[:3], angle


class TurnsOfHand:
    """Which turn of the hand turns the tool as wanted, as the motion scaling maps turns.

    Args:
        hand_of_slave: Rotation (3, 3) from the slave's axes to the master's base.
        tool_axes: Axes of the stylus along x, y, z of an aligned tool; empty if the tool turns about the axes of the
            hand's turn.
    """

    def __init__(self, hand_of_slave: Array, tool_axes: tuple[str, ...]) -> None:
        is_aligned = bool(tool_axes)
        self._map = axis_map("operator.observer.tool_axes", tool_axes).T if is_aligned else hand_of_slave
        self._between, self._rest = turn_within if is_aligned else turn_between, None if is_aligned else rest_pose()[3:]

    def of_tip(self, a: Array, b: Array) -> Array:
        """Rotation vector (3,) [rad] between attitudes (4,): in the frame of an aligned tool, otherwise in its base."""
        turn = np.empty(3)
        self._between(a, b, turn)
        return turn

    def of_hand(self, turn: Array, hand: Array) -> Array:
        """Rotation vector (3,) [rad] by which the hand turns the tool by ``turn``.

        Args:
            turn: As :meth:`of_tip` returns it.
            hand: Attitude (4,) of the hand relative to its rest; the result is in its frame.
        """
        mapped = product(self._map, turn)
        if self._rest is None:
            return mapped
        attitude = np.empty(4)
        multiply_quaternions(self._rest, hand, attitude)
        return product(rotations_from_quaternions(attitude).T, mapped)
