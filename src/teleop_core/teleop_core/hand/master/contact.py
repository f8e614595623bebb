"""Contact: the energy that a stretch of the device's force took from the hand and gave back."""

import math

from teleop_core.graph import topics
from teleop_core.kernels import Array, Fields, Vector3, inner

_NUMBER, _TAKEN, _RETURNED, _FRICTION = (
    topics.MASTER_CONTACT.columns.index(name) for name in ("number", "taken", "returned", "friction")
)


class ContactState(Fields):
    """Fields of a state record with the present contact."""

    tip: Vector3  # where the tip of the stylus was [m]
    is_touched: int


@inner
def account(s: ContactState, force: Array, friction: float, moved: float, place: Array, contact: Array) -> None:
    """Add the energy of a tick to the present contact; a new one begins where force begins.

    The force is constant within a tick, so force times the way of the device is its work, without any error: the wall
    takes energy where the hand pushes the device against the force, and gives it back where the device goes along. What
    the device's structure keeps in bending is not in it: of what is given back a part never reaches the hand.

    Args:
        s: State; written.
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
