"""Measures of a drill: what a trace of setpoints and of the tip tells of a fault."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.kernels.geometry import Array

Stamps = NDArray[np.int64]
RESOLUTION = 2e-4
"""What the tip may move in any case [m]: steps of encoders, gravity that sets in, play."""
_BEFORE_NS = 300_000_000
"""How long before a fault the motion is looked at."""
JUST_BEFORE_NS = 11_000_000
"""Before a moment, time in which the present speed is measured [ns]."""
_SILENT_NS = 100_000_000  # longer than any teller of the tip waits
_SHORT = 10  # samples of which the present speed is taken
_ROUNDING = 1e-12  # of a step [rad or m]
_ENOUGH = 41  # samples from which it is told whether an arm follows
_MOVING = 0.3  # share of all ticks in which a setpoint moves that goes round
_FOLLOWED = 0.1  # share of the setpoint's way; noise of encoders is far less, a lag is none


@dataclass(frozen=True, eq=False)
class Trace:
    """Messages of one topic as they were sent.

    Attributes:
        sent_ns: When each was sent, shape (N,) [ns].
        number: Its number in the sequence of its publisher, shape (N,).
        values: Shape (N, width).
        stamp_ns: Stamp of its header, shape (N,) [ns].
    """

    sent_ns: Stamps
    number: Stamps
    values: Array
    stamp_ns: Stamps

    def within(self, begin_ns: int, end_ns: int) -> "Trace":
        """Those sent in a time [ns], its end left out."""
        chosen = (self.sent_ns >= begin_ns) & (self.sent_ns < end_ns)
        return self.only(chosen)

    def only(self, chosen: NDArray[np.bool_]) -> "Trace":
        """Some of them; ``chosen`` has the shape (N,)."""
        return Trace(self.sent_ns[chosen], self.number[chosen], self.values[chosen], self.stamp_ns[chosen])

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


def follows(setpoints: Array, measured: Array, speed_limit: Array) -> bool:
    """Whether an arm goes where its setpoints go, by both traces of a recent time.

    Setpoints alone prove nothing: drives that do not listen leave the arm where it is.

    Args:
        setpoints: Newest setpoints, shape (m, n) [rad or m].
        measured: Newest measured joints of as long a time or longer, shape (k, n) [rad or m].
        speed_limit: Rated speeds, by which joints are compared, shape (n,) [rad/s or m/s].
    """
    if len(setpoints) < _ENOUGH or len(measured) < _ENOUGH:
        return False
    if np.mean(np.any(np.diff(setpoints, axis=0) != 0.0, axis=1)) <= _MOVING:
        return False
    asked, went = (float(np.linalg.norm(np.ptp(rows, axis=0) / speed_limit)) for rows in (setpoints, measured))
    return went > _FOLLOWED * asked


def tip_speed(places: Trace) -> float:
    """Largest speed of the tip over ten samples, by their stamps [m/s]; 0 of fewer.

    Args:
        places: Of the tip, values (N, 3 or more) [m].
    """
    speeds, _ = _speeds(places)
    return float(np.max(speeds, initial=0.0))


def _speeds(places: Trace) -> tuple[Array, Stamps]:
    """Speeds (M,) of the tip over ten samples [m/s], and when the last of each ten was sent."""
    ways = places.values[_SHORT:, :3] - places.values[:-_SHORT, :3]
    times = 1e-9 * (places.stamp_ns[_SHORT:] - places.stamp_ns[:-_SHORT])
    is_later = times > 0.0
    speeds = np.linalg.norm(ways[is_later], axis=1) / times[is_later]
    return speeds, places.sent_ns[_SHORT:][is_later]


def rest_delay(places: Trace, since_ns: int, slow: float, until_ns: int) -> float:
    """Time from a moment until the tip is slower than a speed [m/s] for good [s]; NaN if never.

    Of a tip that nobody tells any more, it is the time of its last sample.

    Args:
        places: Of the tip.
        since_ns: The moment [ns].
        slow: The speed [m/s].
        until_ns: Until when it was looked at [ns].
    """
    speeds, sent_ns = _speeds(places)
    after = sent_ns >= since_ns
    fast = np.flatnonzero(speeds[after] > slow)
    if not len(fast):
        return 0.0
    if fast[-1] + 1 >= np.sum(after):
        last_ns = int(sent_ns[after][-1])
        is_told = until_ns - last_ns <= _SILENT_NS
        return float("nan") if is_told else 1e-9 * (last_ns - since_ns)
    return 1e-9 * float(sent_ns[after][fast[-1] + 1] - since_ns)


def speed_before(places: Trace, moment_ns: int) -> float:
    """Largest speed of the tip in the third of a second before a moment [m/s]."""
    return tip_speed(places.within(moment_ns - _BEFORE_NS, moment_ns))


def path(places: Trace, since_ns: int, until_ns: int) -> float:
    """Length of the way of the tip between two moments, in steps of ten samples [m]."""
    taken = places.within(since_ns, until_ns).values[::_SHORT, :3]
    return float(np.sum(np.linalg.norm(np.diff(taken, axis=0), axis=1)))


def ramp(setpoints: Trace, braking: Array, dt: float) -> float:
    """Least deceleration with which any joint came to rest, over what its drive can do; NaN: none.

    A joint that brakes evenly loses the same step every tick, and in its last tick no more than
    that is left. A joint that has crept after its reference stops from steps that hardly change.

    Args:
        setpoints: Joint setpoints up to rest, values (N, n) [rad or m].
        braking: Of each drive, shape (n,) [rad/s² or m/s²].
        dt: Tick [s].
    """
    steps = np.abs(np.diff(setpoints.values, axis=0))
    is_whole = np.diff(setpoints.number) == 1
    found = []
    for joint in range(steps.shape[1]):
        moving = np.flatnonzero(steps[:, joint] > _ROUNDING)
        last = moving[-1] if len(moving) else 0
        if last < 2 or last == len(steps) - 1 or not is_whole[last - 2 : last + 1].all():
            continue
        left, less = steps[last, joint], steps[last - 1, joint] - steps[last, joint]
        before = steps[last - 2, joint] - steps[last - 1, joint]
        if less >= left and abs(before - less) < 1e-3 * less:
            found.append(float(less / (braking[joint] * dt * dt)))
    return min(found, default=float("nan"))


def beyond(places: Array, lower: Array, upper: Array) -> float:
    """Farthest that joints (N, n) are outside their limits (n,) [rad or m]; 0 inside."""
    return float(np.max(np.maximum(places - upper, lower - places), initial=0.0))


def tips(fk: Callable[[Array], Array], joints: Trace, n: int) -> Trace:
    """Places (N, 3) of the tip [m] for joints, by forward kinematics that are not the slave's.

    Args:
        fk: Forward kinematics: joints (n,) to the tip's pose (4, 4).
        joints: Positions first, values (N, n or more) [rad or m].
        n: Number of joints.
    """
    found = [fk(row)[:3, 3] for row in joints.values[:, :n]]
    values = np.array(found) if found else np.empty((0, 3))
    return Trace(joints.sent_ns, joints.number, values, joints.stamp_ns)


def apart(first: Trace, second: Trace) -> float:
    """Largest difference of the ways (N, 3) that two traces tell of the same ticks [m].

    Each begins where it begins: a place that is off all the time, as a tool that was measured
    badly, is no difference of motion.
    """
    _, at, other = np.intersect1d(first.stamp_ns, second.stamp_ns, return_indices=True)
    if not len(at):
        return 0.0
    ways = [t.values[i, :3] - t.values[i[0], :3] for t, i in ((first, at), (second, other))]
    return float(np.max(np.linalg.norm(ways[0] - ways[1], axis=1)))


def silence(places: Trace, setpoints: Trace) -> float:
    """For how long setpoints were still sent after the last of another trace [s].

    0 where there are no setpoints; infinite where they alone were heard.
    """
    if not len(setpoints):
        return 0.0
    if not len(places):
        return float("inf")
    return max(0.0, 1e-9 * float(setpoints.sent_ns[-1] - places.sent_ns[-1]))


def way_ratio(places: Trace, speed_limit: float, dt: float) -> float:
    """Largest step of the tip, values (N, 3) [m], over what a speed [m/s] allows; 0 without two."""
    ticks = np.diff(places.number)
    steps = np.linalg.norm(np.diff(places.values, axis=0), axis=1)[ticks > 0]
    return float(np.max(steps / (speed_limit * dt * ticks[ticks > 0]), initial=0.0))


def joint_speeds(setpoints: Trace, since_ns: int, until_ns: int) -> Array:
    """Largest speed of each joint's setpoint in a time, shape (n,) [rad/s or m/s]."""
    found = setpoints.within(since_ns, until_ns)
    if len(found) < 2:
        return np.zeros(setpoints.values.shape[1])
    times = np.maximum(np.diff(found.number), 1)[:, np.newaxis] * 1e-3
    speeds: Array = np.max(np.abs(np.diff(found.values, axis=0)) / times, axis=0)
    return speeds


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
    speeds = joint_speeds(setpoints, moment_ns - JUST_BEFORE_NS, moment_ns)
    return float(np.linalg.norm(jacobian[:3], axis=0) @ (speeds**2 / (2.0 * braking)))


def lag(setpoints: Trace, places: Trace, moment_ns: int) -> float:
    """How far the tip is behind its setpoint at a moment [m]; it may come up to it."""
    wanted = setpoints.within(moment_ns - _BEFORE_NS, moment_ns)
    found = places.within(moment_ns - _BEFORE_NS, moment_ns)
    if not len(wanted) or not len(found):
        return 0.0
    return float(np.linalg.norm(wanted.values[-1, :3] - found.values[-1, :3]))
