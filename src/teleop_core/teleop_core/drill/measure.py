"""Measures of a drill: what a trace of setpoints and of the tip tells of a fault."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.geometry import Array

Stamps = NDArray[np.int64]
RESOLUTION = 2e-4
"""What the tip may move in any case [m]: steps of encoders, gravity that sets in, play."""
_BEFORE_NS = 300_000_000
"""How long before a fault the motion is looked at."""
_SHORT = 10  # samples of which the present speed is taken


@dataclass(frozen=True, eq=False)
class Trace:
    """Messages of one topic as they were sent.

    Attributes:
        sent_ns: When each was sent, shape (N,) [ns].
        number: Its number in the sequence of its publisher, shape (N,).
        values: Shape (N, width).
    """

    sent_ns: Stamps
    number: Stamps
    values: Array

    def within(self, begin_ns: int, end_ns: int) -> "Trace":
        """Those sent in a time [ns], its end left out."""
        chosen = (self.sent_ns >= begin_ns) & (self.sent_ns < end_ns)
        return Trace(self.sent_ns[chosen], self.number[chosen], self.values[chosen])

    def __len__(self) -> int:
        return len(self.sent_ns)


def step_ratio(setpoints: Trace, speed_limit: Array, dt: float) -> float:
    """Largest step of a setpoint over what its drive allows in the time; 0 without two samples.

    Messages that were lost on the way are ticks in which it could move as well. Where the number
    starts anew, there is another publisher, and no step.

    Args:
        setpoints: Joint setpoints, values (N, n) [rad or m].
        speed_limit: Of each drive, shape (n,) [rad/s or m/s].
        dt: Time from one message to the next [s].
    """
    ticks = np.diff(setpoints.number)
    steps = np.abs(np.diff(setpoints.values, axis=0))[ticks > 0]
    if not len(steps):
        return 0.0
    allowed = speed_limit * dt * ticks[ticks > 0, np.newaxis]
    return float(np.max(steps / allowed))


def stop_delay(setpoints: Trace, since_ns: int) -> float:
    """Time from a moment to the first of all setpoints that stand still [s]; NaN if they never do.

    Args:
        setpoints: Joint setpoints, values (N, n).
        since_ns: The moment [ns].
    """
    after = setpoints.within(since_ns - 20_000_000, np.iinfo(np.int64).max)
    moves = np.any(np.diff(after.values, axis=0) != 0.0, axis=1)
    last = np.flatnonzero(moves)
    first = int(last[-1]) + 2 if len(last) else 1
    if first >= len(after):
        return float("nan")
    return max(0.0, 1e-9 * float(after.sent_ns[first] - since_ns))


def travel(places: Trace, since_ns: int, until_ns: int) -> float:
    """Farthest that the tip got from where it was at a moment, until another [m]; NaN if unknown.

    Args:
        places: Of the tip, values (N, 3 or more) [m].
        since_ns: The moment [ns].
        until_ns: The other [ns].
    """
    before = places.within(since_ns - _BEFORE_NS, since_ns)
    after = places.within(since_ns, until_ns)
    if not len(before) or not len(after):
        return float("nan")
    return float(np.max(np.linalg.norm(after.values[:, :3] - before.values[-1, :3], axis=1)))


def tip_speed(places: Trace) -> float:
    """Largest speed of the tip over ten messages [m/s]; 0 of fewer."""
    if len(places) <= _SHORT:
        return 0.0
    ways = places.values[_SHORT:, :3] - places.values[:-_SHORT, :3]
    times = 1e-3 * (places.number[_SHORT:] - places.number[:-_SHORT])
    times[times <= 0.0] = np.inf
    return float(np.max(np.linalg.norm(ways, axis=1) / times))


def speed_before(places: Trace, moment_ns: int) -> float:
    """Largest speed of the tip in the third of a second before a moment [m/s]."""
    return tip_speed(places.within(moment_ns - _BEFORE_NS, moment_ns))


def braking_way(setpoints: Trace, moment_ns: int, jacobian: Array, braking: Array) -> float:
    r"""Farthest that the tip gets when all drives brake from their speeds at a moment [m].

    Joint i, which turns at :math:`\dot q_i` and brakes at :math:`a_i`, needs
    :math:`\dot q_i^2 / (2 a_i)`; the tip gets no farther than the sum of what each moves it.

    Args:
        setpoints: Joint setpoints, values (N, n) [rad or m].
        moment_ns: The moment [ns].
        jacobian: Of the tip, shape (6, n).
        braking: What the drives brake, shape (n,) [rad/s² or m/s²].
    """
    last = setpoints.within(moment_ns - _BEFORE_NS, moment_ns)
    if len(last) < 2:
        return 0.0
    recent = slice(-min(len(last), _SHORT + 1), None)
    times = np.maximum(np.diff(last.number[recent]), 1)[:, np.newaxis] * 1e-3
    speeds = np.max(np.abs(np.diff(last.values[recent], axis=0)) / times, axis=0)
    return float(np.linalg.norm(jacobian[:3], axis=0) @ (speeds**2 / (2.0 * braking)))


def lag(setpoints: Trace, places: Trace, moment_ns: int) -> float:
    """How far the tip is behind its setpoint at a moment [m]; it may come up to it."""
    wanted = setpoints.within(moment_ns - _BEFORE_NS, moment_ns)
    found = places.within(moment_ns - _BEFORE_NS, moment_ns)
    if not len(wanted) or not len(found):
        return 0.0
    return float(np.linalg.norm(wanted.values[-1, :3] - found.values[-1, :3]))
