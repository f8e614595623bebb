"""Contact: energy that the hand gives to the device and gets back, while the force of the device is not zero."""

import math

from teleop_core.graph import topics
from teleop_core.kernels import Array, Fields, Vector3, inner

_NUMBER, _TAKEN, _RETURNED, _FRICTION = (
    topics.MASTER_CONTACT.columns.index(name) for name in ("number", "taken", "returned", "friction")
)


class HandContactState(Fields):
    """Fields of a state record with the present contact."""

    tip: Vector3  # last position of the tip of the stylus [m]
    is_touched: int


@inner
def account(s: HandContactState, force: Array, friction: float, moved: float, place: Array, contact: Array) -> None:
    """Add the energy of a tick to the present contact; a new contact begins when the force becomes nonzero.

    The force is constant within a tick, so force times displacement of the device is exactly its work. The wall takes
    energy while the hand pushes the device against the force, and returns energy while the device moves with the
    force. The energy stored in bending of the device's structure is not counted. Therefore a part of the returned
    energy never reaches the hand.

    Args:
        s: State; written.
        force: Force of the device during the tick (3,) [N].
        friction: Dry friction of the device [N].
        moved: Distance of the device against friction during the tick [m].
        place: Position of the device at its encoders, before rounding, at the end of the tick (3,) [m], in the
            master's base.
        contact: Row of ``master/contact``: number and energies of the contact; written.
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
    """Distance of two points (3,) [m]."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
