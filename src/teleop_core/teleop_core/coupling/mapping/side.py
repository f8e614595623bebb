"""Side: whether a virtual fixture confines the hand, the slave, or both.

A confined slave follows a proxy of the hand: a point that stays in the fixture, as near to the hand as possible. The
command moves like the proxy. So a hand that is 3 mm beyond the wall moves the slave only after it has returned through
the wall.

At each sample the proxy moves no farther than the hand. So the slave never jumps, even if there are two equally short
paths back into the shape, or if the shape was changed.

Source:
    Zilles and Salisbury 1995, a constraint-based god-object method; bounded by the hand's steps here.
"""

import math

from teleop_core.coupling.fixtures import Held, fixture_depth
from teleop_core.graph import copy
from teleop_core.kernels import Array, Fields, Vector3, inner
from teleop_core.kernels.room import room

SIDES = ("hand", "slave", "both")
"""Which side a fixture confines."""


class SideState(Fields):
    """Fields of a state record with hand and proxy [m], in the master's base."""

    center: Vector3  # middle of the fixture
    master: Vector3  # position of the hand at the last sample
    beyond: Vector3  # vector from the proxy to the hand; zero if the slave is not confined


# Depth up to which a position is allowed [m]. Reports are rounded to a nanometre, and the slave's gain is 10 at most,
# so this depth is a tenth of a nanometre.
_ALLOWED = 1e-10
# Largest number of iterations to move a point into the shape. Our own shapes need one.
_ROUNDS = 8
# Fractions of a step that are tried, because near a curved wall the whole step may be too long.
_SHARES = 4
# Rounding of differences of positions [m].
_ROUNDING = 1e-13


@inner
def let_go(s: SideState) -> None:
    """Shift the fixture so that its proxy coincides with the hand. The slave does not move."""
    for i in range(3):
        s.center[i] += s.beyond[i]
        s.beyond[i] = 0.0


@inner
def _distance(a: Array, b: Array) -> float:
    square = 0.0
    for i in range(3):
        square += (a[i] - b[i]) * (a[i] - b[i])
    return math.sqrt(square)


@inner
def _draw_in(fixture: Held, place: Array) -> bool:
    """Move a point (3,) to the nearest allowed position; return whether it is allowed then."""
    out = room(3)
    depth = fixture_depth(fixture, place, out)
    for _ in range(_ROUNDS):
        if depth <= _ALLOWED:
            return True
        for i in range(3):
            place[i] -= out[i]
        depth = fixture_depth(fixture, place, out)
    return bool(depth <= _ALLOWED)


@inner
def _approach(fixture: Held, last: Array, aim: Array, most: float) -> None:
    """Overwrite ``aim`` (3,) with the proxy's next position on the path to it, at most ``most`` [m] from ``last``.

    A proxy outside the fixture, for example after a change of the shape, moves inwards on the shortest path. A proxy
    without a path into the fixture does not move.
    """
    target, share = room(3), most / max(_distance(aim, last), most)
    copy(aim, target)
    for _ in range(_SHARES):
        for i in range(3):
            aim[i] = last[i] + share * (target[i] - last[i])
        if _draw_in(fixture, aim) and _distance(aim, last) <= most + _ROUNDING:
            return
        share *= 0.5
    for i in range(3):
        aim[i] = last[i]
    share = most / max(_distance(aim, last), most) if _draw_in(fixture, aim) else 0.0
    for i in range(3):
        aim[i] = last[i] + share * (aim[i] - last[i]) if share > 0.0 else last[i]


@inner
def hold_slave(s: SideState, fixture: Held, step: Array) -> None:
    """Replace the hand's step (3,) [m] by the step of its proxy, which is at most as long.

    If the hand reaches an allowed position that the proxy cannot reach, for example through a forbidden body, the
    hand's position becomes that of the proxy: see :func:`let_go`.

    Args:
        s: State; ``beyond`` and perhaps ``center`` are written.
        fixture: The fixture.
        step: Vector from the hand's last position to its present one; written.
    """
    last, aim, hand, most = room(3), room(3), room(3), 0.0
    for i in range(3):
        last[i] = s.master[i] - s.center[i] - s.beyond[i]
        aim[i] = last[i] + s.beyond[i] + step[i]
        most += step[i] * step[i]
    if most == 0.0:
        return
    most = math.sqrt(most)
    is_free = fixture_depth(fixture, aim, hand) <= _ALLOWED
    if is_free and _distance(aim, last) > most + _ROUNDING:
        let_go(s)
        for i in range(3):
            aim[i] = last[i] + step[i]
    copy(aim, hand)
    if not _draw_in(fixture, aim) or _distance(aim, last) > most + _ROUNDING:
        _approach(fixture, last, aim, most)
    for i in range(3):
        step[i] += s.beyond[i]
        s.beyond[i] = hand[i] - aim[i]
        step[i] -= s.beyond[i]
