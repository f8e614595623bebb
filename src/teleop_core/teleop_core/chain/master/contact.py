"""Contact: the energy that a stretch of the device's force took from the hand and gave back."""

import math
from typing import Any

from teleop_core.graph.topics import MASTER_CONTACT
from teleop_core.kernels import inner
from teleop_core.kernels.geometry import Array

CONTACT_STATE = [("tip", "f8", (3,)), ("is_touched", "i8")]
_NUMBER, _TAKEN, _RETURNED, _FRICTION = (
    MASTER_CONTACT.columns.index(name) for name in ("number", "taken", "returned", "friction")
)


@inner
def account(
    s: Any, force: Array, friction: float, moved: float, place: Array, contact: Array
) -> None:
    """Add the energy of a tick to the present contact; a new one begins where force begins.

    The force is constant within a tick, so force times the way of the device is its work, without
    any error: the wall takes energy where the hand pushes the device against the force, and gives
    it back where the device goes along. What the device's structure keeps in bending is not in it:
    of what is given back a part never reaches the hand.

    Args:
        s: Record with :data:`CONTACT_STATE`; written.
        force: What the device applied during the tick (3,) [N].
        friction: Dry friction of the device [N].
        moved: Way of the device against friction during the tick [m].
        place: Place of the device at its encoders, before they round it, at the end of the tick
            (3,) [m], in the master's base.
        contact: Row of ``master/contact``, number and energies; written.
    """
    work, square = 0.0, 0.0
    for i in range(3):
        work += force[i] * (place[i] - s.tip[i])
        square += force[i] * force[i]
        s.tip[i] = place[i]
    if square == 0.0:
        s.is_touched = 0
        return
    if s.is_touched == 0:
        contact[_NUMBER] += 1.0
        contact[_TAKEN] = contact[_RETURNED] = contact[_FRICTION] = 0.0
    s.is_touched = 1
    contact[_TAKEN] += max(-work, 0.0)
    contact[_RETURNED] += max(work, 0.0)
    contact[_FRICTION] += friction * moved


@inner
def distance(a: Array, b: Array) -> float:
    """Distance of two places (3,) [m]."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
