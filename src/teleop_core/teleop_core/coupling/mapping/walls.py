"""Walls: how a fixture pushes back on the hand that is beyond it.

The source's wall is a spring that ends in a constant force (:func:`wall_force`). Sampled, it gives
back more energy than it took: its force is that of the place at the beginning of a period and is
held for all of it. So it is too small on the way in and too large on the way out, by half a
period's way. A damped wall (:func:`damped_wall`) makes up for it, as far as
:func:`passive_stiffness`.

A passivity controller (Hannaford and Ryu 2002), which cuts the force where the energy that a
contact took is used up, was tried on top and left out: with a reading in steps and a device that
bends it switches on and off, and contacts that the damper alone makes passive gave energy.
"""

import math
from typing import NamedTuple

from teleop_core.kernels import Array, Fields, Vector3, inner, kernel


class WallNumbers(Fields):
    """Fields of a parameter record with the wall of a fixture."""

    stiffness: float  # [N/m]
    max_force: float  # [N]
    damping: float  # [N·s/m]
    is_damped: int


class WallState(Fields):
    """Fields of a state record with the last sample."""

    felt: Vector3  # place [m]
    rate: Vector3  # its smoothed rate [m/s]


# The rate is that of the readings through a first-order lag that takes the time in which the hand
# goes this far [m], within bounds [s]. A step of the reading within a period would else be a blow,
# which throws the light device back; so slow motion needs a wide window, fast motion a short one
# (Janabi-Sharifi, Hayward and Chen 2000 adapt it to the same end).
_SMOOTH_WAY, _SMOOTH_LEAST, _SMOOTH_MOST = 0.3e-3, 1e-3, 20e-3
# The damper sets in over this depth [m], a step of the reading, so that the surface is no edge.
_RAMP = 0.05e-3
# On the way out this share of the spring's force stays: beyond a wall there is always some.
_LEAST = 0.05
SOFT_ZONE = 1e-3
"""Depth over which the source's wall reaches its full force [m] (Vongbunyong 2008, section 7.6)."""
HARD_STIFFNESS = 3300.0
"""Stiffness of the hard wall [N/m]: full force after 1 mm, as the source's. No axis of the device
renders more. It is not passive: contacts give back up to twice what they took
(:func:`passive_stiffness`), and dry friction of the device takes the rest."""
# Of the wall's damping so much counts [N·s/m], and so large a share of it: measured on the
# simulated device over slow presses, tremor, hovering and sliding. Steps of the reading, the lag of
# the rate and the bending of the device use up the rest; more damping than this does not help.
_DAMPING_COUNTS, _SHARE_COUNTS = 10.0, 0.05


class Wall(NamedTuple):
    """A wall by name.

    Attributes:
        stiffness: Of the spring [N/m]; None for that of the parameters.
        is_full_at: In place of it: depth at which the force is full [m]; 0 for the stiffness.
        is_damped: Whether it is damped, and so gives back less than it took.
    """

    stiffness: float | None
    is_full_at: float
    is_damped: bool

    def spring(self, stiffness: float, max_force: float) -> float:
        """Its stiffness [N/m], for the parameters' stiffness [N/m] and largest force [N]."""
        if self.is_full_at > 0.0:
            return max_force / self.is_full_at
        return stiffness if self.stiffness is None else self.stiffness


WALLS = {
    "damped": Wall(None, 0.0, is_damped=True),
    "hard": Wall(HARD_STIFFNESS, 0.0, is_damped=True),
    "source": Wall(None, SOFT_ZONE, is_damped=False),
    "soft": Wall(None, 0.0, is_damped=False),
    "step": Wall(math.inf, 0.0, is_damped=False),
}
"""Walls by name. ``damped`` is passive up to :func:`passive_stiffness`; ``source`` is what the
source built, ``soft`` the same with a stiffness of one's own, ``step`` its limit without a zone."""


@kernel
def wall_force(depth: Array, length: float, stiffness: float, largest: float, force: Array) -> None:
    """Write the wall's push (3,) [N] back into the fixture; zero inside.

    A soft wall is a spring of ``stiffness`` [N/m] until it reaches the ``largest`` force [N],
    which stays constant deeper in; a wall of infinite stiffness is a step of force.

    Source:
        Vongbunyong 2008, eqs. 6.3.1-6.3.2, with the interval and the sign put right and the
        per-axis force replaced by one along the penetration, which is right at edges too.
    """
    push = min(stiffness * length, largest) if length > 0.0 else 0.0
    for i in range(3):
        force[i] = -push * depth[i] / length if length > 0.0 else 0.0


@inner
def _along(rate: Array, depth: Array, length: float) -> float:
    """Part of a rate (3,) out of the fixture; all of it inside."""
    square = along = 0.0
    for i in range(3):
        square += rate[i] * rate[i]
        along += rate[i] * depth[i]
    return along / length if length > 0.0 else math.sqrt(square)


@kernel
def damped_wall(
    p: WallNumbers, s: WallState, place: Array, depth: Array, length: float, period: float, force: Array
) -> None:
    """Write the force (3,) [N] of a damped wall: dissipative, if the wall is soft enough.

    How soft is :func:`passive_stiffness`.

    Spring and damper, together between a twentieth of the spring's force and the largest force. The
    damping is at least stiffness times period: twice what a force lacks that is held for a period.
    The extra damping absorbs the energy added by encoder steps and device compliance.

    Args:
        p: Parameters.
        s: State; written.
        place: Reading of the hand (3,) [m].
        depth: Vector (3,) [m] from the nearest point of the fixture to it.
        length: Its length [m]; 0 inside.
        period: Time since the last sample [s], for which the push will be held too.
        force: Written.

    Source:
        Colgate and Schenkel 1997, b > K T / 2 + |B|: the damping b that a wall of stiffness K needs
        when sampled with period T, part of which the wall itself gives here.
    """
    before = _along(s.rate, depth, length)
    lag = min(max(_SMOOTH_WAY / (abs(before) + 1e-9), _SMOOTH_LEAST), _SMOOTH_MOST)
    share = period / (period + lag)
    for i in range(3):
        s.rate[i] += ((place[i] - s.felt[i]) / period - s.rate[i]) * share
        s.felt[i] = place[i]
    speed = _along(s.rate, depth, length)
    damping = max(p.damping, p.stiffness * period) * min(length / _RAMP, 1.0)
    spring = p.stiffness * length
    push = min(max(spring + damping * speed, _LEAST * spring), p.max_force)
    for i in range(3):
        force[i] = -push * depth[i] / length if length > 0.0 else 0.0


def passive_stiffness(damping: float, period: float, delay: float, friction: float, step: float) -> float:
    """Stiffness up to which contacts with a damped wall give back no more than they took [N/m].

    On the safe side of what the simulated device shows: 1000 N/m at 1 kHz without delay, where
    1260 give back more than they took, and 333 with a delay of 1 ms, where 1000 do and 500 do not.

    Args:
        damping: Of the wall [N·s/m]; 0 for a wall that is a spring alone, which never is passive.
        period: Of the device's samples [s].
        delay: Of the force beyond it [s].
        friction: Dry friction of the device [N].
        step: Of its reading [m]; 0: none.

    Source:
        Colgate and Schenkel 1997, K (T / 2 + delay) <= b, with the share of b that counts measured
        here; Abbott and Okamura 2005, K <= 2 friction / step.
    """
    counted = _SHARE_COUNTS * min(damping, _DAMPING_COUNTS)
    ringing = 2.0 * friction / step if step > 0.0 else math.inf
    return min(counted / (0.5 * period + delay), ringing)


@inner
def forget_wall(s: WallState, place: Array) -> None:
    """Begin at rest at a reading (3,) [m]."""
    for i in range(3):
        s.felt[i], s.rate[i] = place[i], 0.0
