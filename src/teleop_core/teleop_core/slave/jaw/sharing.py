"""Sharing: the speed of an object that two jaws hold by dry friction.

The speed v minimises ``(v - v0)² / 2 + Σ most |v - tip|``. Here v0 is the speed without friction, ``tip`` the speed of
each jaw, and ``most`` the largest change by that jaw's friction. This is the rule of :mod:`~teleop_core.slave.jaw.grip`
for the friction of two jaws.
"""

import math

from teleop_core.graph.signals import copy
from teleop_core.kernels import geometry, inner

_ROUNDS = 2000  # largest number of iterations, needed if the object sticks to neither jaw
_ENOUGH = 1e-9  # the iteration stops when the speed changes by less [m/s]


@inner
def far_from(a: geometry.Array, b: geometry.Array) -> float:
    """Distance of two points (3,)."""
    square = 0.0
    for i in range(3):
        square += (a[i] - b[i]) ** 2
    return math.sqrt(square)


@inner
def _sticks(motion: geometry.Array, tip: geometry.Array, most: float, other: geometry.Array, against: float) -> bool:
    """Whether an object sticks to a tip while the other tip slides on the object or moves with the same speed."""
    apart = far_from(other, tip)
    if apart == 0.0:
        return far_from(motion, tip) <= most + against
    square = 0.0
    for i in range(3):
        square += (tip[i] - motion[i] - against * (other[i] - tip[i]) / apart) ** 2
    return math.sqrt(square) <= most


@inner
def share_speed(
    motion: geometry.Array, tip: geometry.Array, most: float, other: geometry.Array, against: float
) -> None:
    """Change the speed of an object between two pairs of fingers by the friction of both pairs.

    Args:
        motion: Speed of the object (3,) without friction [m/s]; written.
        tip: Speed (3,) of the first pair of fingers at the object's middle [m/s].
        most: Largest change of the object's speed by that pair's friction [m/s].
        other: Speed (3,) of the other pair [m/s].
        against: Largest change of the object's speed by the other pair's friction [m/s].

    Source:
        Moreau 1988 for the rule; the iteration of Weiszfeld 1937 if the object sticks to neither pair.
    """
    if _sticks(motion, tip, most, other, against):
        copy(tip, motion)
        return
    if _sticks(motion, other, against, tip, most):
        copy(other, motion)
        return
    x, y, z = motion[0], motion[1], motion[2]
    for _ in range(_ROUNDS):
        a = most / max(far_from(motion, tip), 1e-15)
        b = against / max(far_from(motion, other), 1e-15)
        change = 0.0
        for i in range(3):
            found = ((x, y, z)[i] + a * tip[i] + b * other[i]) / (1.0 + a + b)
            change = max(change, abs(found - motion[i]))
            motion[i] = found
        if change < _ENOUGH:
            return
