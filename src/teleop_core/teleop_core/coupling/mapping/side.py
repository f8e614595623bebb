"""Side: whether a virtual fixture holds the hand, the slave, or both.

A slave that is held is led by a proxy of the hand: a place that stays in the fixture, as near to
the hand as it may come. What is commanded moves as the proxy does. So a hand that comes back from
3 mm beyond the wall moves the slave only where it passes the wall again.

The proxy never moves farther than the hand does at the same sample, so the slave jumps nowhere: not
where a shape has two ways back that are equally short, and not where the shape was changed.

Source:
    Zilles and Salisbury 1995, a constraint-based god-object method; bounded by the hand's steps here.
"""

import math

from teleop_core.coupling.fixtures import Held, fixture_depth
from teleop_core.graph import copy
from teleop_core.kernels import Array, Fields, Vector3, inner
from teleop_core.kernels.room import room

SIDES = ("hand", "slave", "both")
"""Whom a fixture holds."""


class SideNumbers(Fields):
    """Fields of a parameter record with whom the fixture holds."""

    holds_hand: int
    holds_slave: int


class SideState(Fields):
    """Fields of a state record with hand and proxy [m], in the master's base."""

    center: Vector3  # middle of the fixture
    master: Vector3  # where the hand leads the slave from
    beyond: Vector3  # from the proxy to there; zero where nothing is held


# Depth up to which a place is allowed [m]: a tenth of the nanometre that reports are rounded to,
# for the slave's gain is 10 at most.
_ALLOWED = 1e-10
# Rounds in which a place is drawn in. Shapes of ours need one.
_ROUNDS = 8
# Shares of a step that are tried: beside a curved wall a whole one may lead too far.
_SHARES = 4
# Rounding of differences of places [m].
_ROUNDING = 1e-13


@inner
def let_go(s: SideState) -> None:
    """Move the hand's place to its proxy, and the fixture with it. The slave does not move."""
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
    """Move a place (3,) to the nearest one that is allowed; whether it is allowed then."""
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
    """Move an aim (3,) to where the proxy may be next on its way there, ``most`` [m] away.

    A proxy that is outside, as after a change of the shape, goes the shortest way in. One that has no way stays.
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
    """Turn the hand's step (3,) [m] into that of its proxy, which is no longer.

    Where the hand gets to a place that is allowed, but the proxy cannot follow, as through a
    forbidden body, the proxy is the hand's new place: see :func:`let_go`.

    Args:
        s: State; ``beyond`` and perhaps ``center`` are written.
        fixture: The fixture.
        step: From the hand's last place to its present one; written.
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
