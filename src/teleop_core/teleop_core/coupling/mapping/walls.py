"""Walls: the force of a fixture on a hand that is beyond it.

The source's wall is a spring up to a constant force (:func:`wall_force`). A sampled spring returns more energy than it
took. Its force belongs to the position at the beginning of a period, but acts for the whole period. So the force is too
small while the hand moves in and too large while it moves out, by the stiffness times the motion of half a period. A
damped wall (:func:`damped_wall`) compensates this, up to :func:`passive_stiffness`.

A passivity controller (Hannaford and Ryu 2002) was also tried, but is not used. It cuts the force when the energy that
a contact took is used up. With encoder steps and a compliant device this controller switches on and off. Contacts that
are passive with the damper alone then generated energy.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from teleop_core.base import Within, parameter
from teleop_core.kernels import Array, Fields, Vector3, inner, kernel


class WallState(Fields):
    """Fields of a state record with the last sample."""

    felt: Vector3  # last measured position of the hand [m]
    rate: Vector3  # smoothed rate of the hand [m/s]


# The speed is that of the readings after a first-order lag. Without the lag, an encoder step within a period would act
# as an impact that throws the light device back. So slow motion needs a long time constant, and fast motion a short one
# (Janabi-Sharifi, Hayward and Chen 2000 adapt it for the same reason).
_SMOOTH_WAY = 0.3e-3  # the time constant is the time in which the hand moves this far [m]
_SMOOTH_LEAST = 1e-3  # least time constant [s]
_SMOOTH_MOST = 20e-3  # largest time constant [s]
# The damping grows to its full value over this depth [m], an encoder step, so that the force is continuous at the
# surface.
_RAMP = 0.05e-3
# When the hand moves out of the wall, at least this share of the spring's force remains: inside a wall the force is
# never zero.
_LEAST = 0.05
SOFT_ZONE = 1e-3
"""Depth over which the source's wall reaches its full force [m] (Vongbunyong 2008, section 7.6)."""
HARD_STIFFNESS = 3300.0
"""Stiffness of the hard wall [N/m]. It gives the full force after 1 mm, as the source's wall does, and no axis of the
device can render more. The wall is not passive: contacts return up to twice the energy that they took
(:func:`passive_stiffness`), and dry friction of the device absorbs the excess."""
# Only a share of the wall's damping is effective. Encoder steps, the lag of the speed and the compliance of the device
# use up the rest. Both numbers were measured on the simulated device with slow presses, tremor, hovering and sliding.
_DAMPING_COUNTS = 10.0  # damping above this value has no effect [N·s/m]
_SHARE_COUNTS = 0.05  # effective share of the damping up to that value


class Wall(NamedTuple):
    """A wall by name.

    Attributes:
        stiffness: Stiffness of the spring [N/m]; None for the stiffness of the parameters.
        is_full_at: Depth at which the force is full [m], which determines the stiffness; 0 to use ``stiffness``.
        is_damped: Whether the wall is damped, and so returns less energy than it took.
    """

    stiffness: float | None
    is_full_at: float
    is_damped: bool

    def spring(self, stiffness: float, max_force: float) -> float:
        """Stiffness of the wall [N/m], for the parameters' stiffness [N/m] and largest force [N]."""
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
"""Walls by name. ``damped`` is passive up to :func:`passive_stiffness`. ``source`` is the wall of the source. ``soft``
is the wall of the source with the stiffness of the parameters. ``step`` has its full force at any depth."""


@dataclass(frozen=True, kw_only=True)
class WallParameters:
    """The wall of a fixture."""

    wall: str = parameter(
        "damped",
        choices=tuple(WALLS),
        doc="damped: spring and damper up to max_force, passive up to some 1000 N/m; hard: the "
        "stiffest spring that sampling allows; source: the published spring, at full force after "
        "1 mm; soft: a spring only; step: max_force at once, which vibrates",
    )
    stiffness: float = parameter(
        1000.0,
        Within(1.0, 5000.0, "N/m"),
        "stiffness of the damped and the soft wall",
        source="assumed: less than the smallest stiffness of the device, 1020 N/m; the source states no value",
    )
    damping: float = parameter(
        10.0,
        Within(0.0, 50.0, "N·s/m"),
        "damping of the damped and the hard wall; a value below stiffness times tick is raised to it",
        source="assumed: keeps slow contacts of a trembling hand passive too; twenty times K T / 2 of "
        "1000 N/m at 1 kHz (Colgate and Schenkel 1997)",
    )
    max_force: float = parameter(
        3.3,
        Within(0.0, 10.0, "N"),
        "largest force on the hand; the device may limit it further",
        source="published: Vongbunyong 2008, section 6.3, the peak force of the device",
    )


@kernel
def wall_force(depth: Array, length: float, stiffness: float, largest: float, force: Array) -> None:
    """Write the wall's push (3,) [N] back into the fixture; zero inside.

    A soft wall is a spring of ``stiffness`` [N/m] up to the ``largest`` force [N]; deeper in, the force is constant.
    For infinite stiffness the force is a step.

    Source:
        Vongbunyong 2008, eqs. 6.3.1-6.3.2, with interval and sign corrected. The force per axis is replaced by a force
        along the penetration, which is also correct at edges.
    """
    push = min(stiffness * length, largest) if length > 0.0 else 0.0
    for i in range(3):
        force[i] = -push * depth[i] / length if length > 0.0 else 0.0


@inner
def _along(rate: Array, depth: Array, length: float) -> float:
    """Component of a rate (3,) along the depth, out of the fixture; the size of the rate for a point inside."""
    square = along = 0.0
    for i in range(3):
        square += rate[i] * rate[i]
        along += rate[i] * depth[i]
    return along / length if length > 0.0 else math.sqrt(square)


@kernel
def damped_wall(
    wall: WallParameters,
    spring: float,
    s: WallState,
    place: Array,
    depth: Array,
    length: float,
    period: float,
    force: Array,
) -> None:
    """Write the force (3,) [N] of a damped wall; the wall is dissipative up to :func:`passive_stiffness`.

    The force is the sum of spring and damper, between a twentieth of the spring's force and the largest force. The
    damping is at least stiffness times period: twice the damping that compensates a force that is constant for a
    period. The extra damping absorbs the energy added by encoder steps and device compliance.

    Args:
        wall: Parameters of the wall.
        spring: Stiffness of the chosen wall [N/m].
        s: State; written.
        place: Measured position of the hand (3,) [m].
        depth: Vector (3,) [m] from the nearest point of the fixture to the hand.
        length: Length of ``depth`` [m]; 0 inside.
        period: Time since the last sample [s]; the push is assumed to act for the same time.
        force: Resulting force; written.

    Source:
        Colgate and Schenkel 1997, b > K T / 2 + |B|: the damping b that a wall of stiffness K with the sample period T
        needs. Here the wall itself gives a part of b.
    """
    before = _along(s.rate, depth, length)
    lag = min(max(_SMOOTH_WAY / (abs(before) + 1e-9), _SMOOTH_LEAST), _SMOOTH_MOST)
    share = period / (period + lag)
    for i in range(3):
        s.rate[i] += ((place[i] - s.felt[i]) / period - s.rate[i]) * share
        s.felt[i] = place[i]
    speed = _along(s.rate, depth, length)
    damping = max(wall.damping, spring * period) * min(length / _RAMP, 1.0)
    elastic = spring * length
    push = min(max(elastic + damping * speed, _LEAST * elastic), wall.max_force)
    for i in range(3):
        force[i] = -push * depth[i] / length if length > 0.0 else 0.0


def passive_stiffness(damping: float, period: float, delay: float, friction: float, step: float) -> float:
    """Largest stiffness [N/m] at which contacts with a damped wall return no more energy than they took.

    The result is conservative for the simulated device. At 1 kHz without delay it is 1000 N/m; there 1260 N/m is not
    passive. With a delay of 1 ms it is 333 N/m; there 500 N/m is still passive, and 1000 N/m is not.

    Args:
        damping: Damping of the wall [N·s/m]; 0 for a pure spring, which is never passive.
        period: Sample period of the device [s].
        delay: Delay of the force beyond the period [s].
        friction: Dry friction of the device [N].
        step: Encoder step of the device [m]; 0: no steps.

    Source:
        Colgate and Schenkel 1997, K (T / 2 + delay) <= b, where the effective share of b was measured here. Abbott and
        Okamura 2005, K <= 2 friction / step.
    """
    counted = _SHARE_COUNTS * min(damping, _DAMPING_COUNTS)
    ringing = 2.0 * friction / step if step > 0.0 else math.inf
    return min(counted / (0.5 * period + delay), ringing)


@inner
def forget_wall(s: WallState, place: Array) -> None:
    """Begin at rest at a reading (3,) [m]."""
    for i in range(3):
        s.felt[i], s.rate[i] = place[i], 0.0
