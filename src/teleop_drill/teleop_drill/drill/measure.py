"""Measures of a drill, computed from traces of setpoints and of the tip."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.kernels.geometry import Array

Stamps = NDArray[np.int64]
RESOLUTION = 2e-4
"""Motion of the tip that is always allowed [m]; its causes are encoder steps, the onset of gravity, and play."""
_BEFORE_NS = 300_000_000
"""Time before a fault in which the motion is measured [ns]."""
JUST_BEFORE_NS = 11_000_000
"""Time before a given moment in which the present speed is measured [ns]."""
_SILENT_NS = 100_000_000  # silence of a publisher of the tip [ns]; longer than the period of any such publisher
_SHORT = 10  # number of samples over which the present speed is measured
_ROUNDING = 1e-12  # rounding error of a step [rad or m]
_ENOUGH = 41  # number of samples that decide whether an arm follows
_MOVING = 0.3  # least share of ticks in which a circling setpoint moves
_FOLLOWED = 0.1  # least share of the setpoint's path; encoder noise is far less, and a lag does not shorten the path


@dataclass(frozen=True, eq=False)
class Trace:
    """Messages of one topic as they were sent.

    Attributes:
        sent_ns: Time of sending of each sample, shape (N,) [ns].
        number: Sequence number of each sample at its publisher, shape (N,).
        values: Values of each sample, shape (N, width).
        stamp_ns: Stamp in the header of each sample, shape (N,) [ns].
    """

    sent_ns: Stamps
    number: Stamps
    values: Array
    stamp_ns: Stamps

    def within(self, begin_ns: int, end_ns: int) -> "Trace":
        """Messages that were sent in the interval from `begin_ns` to `end_ns` [ns], the end excluded."""
        chosen = (self.sent_ns >= begin_ns) & (self.sent_ns < end_ns)
        return self.only(chosen)

    def only(self, chosen: NDArray[np.bool_]) -> "Trace":
        """The samples of the trace that ``chosen`` (N,) selects."""
        return Trace(self.sent_ns[chosen], self.number[chosen], self.values[chosen], self.stamp_ns[chosen])

    def __len__(self) -> int:
        return len(self.sent_ns)


def step_ratio(setpoints: Trace, speed_limit: Array, dt: float) -> float:
    """Largest step of a setpoint divided by the step that its drive allows; 0 with fewer than two samples.

    A lost message counts as a tick in which the setpoint could move. If the sequence number starts again, the publisher
    has changed, and this step is not counted.

    Args:
        setpoints: Joint setpoints, values (N, n) [rad or m].
        speed_limit: Speed limit of each drive, shape (n,) [rad/s or m/s].
        dt: Time from one message to the next [s].
    """
    ticks = np.diff(setpoints.number)
    steps = np.abs(np.diff(setpoints.values, axis=0))[ticks > 0]
    if not len(steps):
        return 0.0
    allowed = speed_limit * dt * ticks[ticks > 0, np.newaxis]
    return float(np.max(steps / allowed))


def stop_delay(setpoints: Trace, since_ns: int) -> float:
    """Time from ``since_ns`` until the setpoint stops and does not move again [s]; NaN if it never stops.

    Args:
        setpoints: Joint setpoints, values (N, n).
        since_ns: Begin of the measured time [ns].
    """
    after = setpoints.within(since_ns - 20_000_000, np.iinfo(np.int64).max)
    moves = np.any(np.diff(after.values, axis=0) != 0.0, axis=1)
    last = np.flatnonzero(moves)
    first = int(last[-1]) + 2 if len(last) else 1
    if first >= len(after):
        return float("nan")
    return max(0.0, 1e-9 * float(after.sent_ns[first] - since_ns))


def travel(places: Trace, since_ns: int, until_ns: int) -> float:
    """Largest distance of the tip from its position at ``since_ns``, until ``until_ns`` [m]; NaN if unknown.

    Args:
        places: Positions of the tip, values (N, 3 or more) [m].
        since_ns: Begin of the measured time [ns].
        until_ns: End of the measured time [ns].
    """
    before = places.within(since_ns - _BEFORE_NS, since_ns)
    after = places.within(since_ns, until_ns)
    if not len(before) or not len(after):
        return float("nan")
    return float(np.max(np.linalg.norm(after.values[:, :3] - before.values[-1, :3], axis=1)))


def follows(setpoints: Array, measured: Array, speed_limit: Array) -> bool:
    """Whether an arm follows its setpoints, decided from recent setpoints and measured joints.

    Moving setpoints alone prove nothing, because the drives may not react.

    Args:
        setpoints: Newest setpoints, shape (m, n) [rad or m].
        measured: Newest measured joints over the same time or longer, shape (k, n) [rad or m].
        speed_limit: Rated speeds, by which the motions of the joints are divided, shape (n,) [rad/s or m/s].
    """
    if len(setpoints) < _ENOUGH or len(measured) < _ENOUGH:
        return False
    if np.mean(np.any(np.diff(setpoints, axis=0) != 0.0, axis=1)) <= _MOVING:
        return False
    asked, went = (float(np.linalg.norm(np.ptp(rows, axis=0) / speed_limit)) for rows in (setpoints, measured))
    return went > _FOLLOWED * asked


def tip_speed(places: Trace) -> float:
    """Largest speed of the tip over ten samples, computed with their stamps [m/s]; 0 with fewer samples.

    Args:
        places: Positions of the tip, values (N, 3 or more) [m].
    """
    speeds, _ = _speeds(places)
    return float(np.max(speeds, initial=0.0))


def _speeds(places: Trace) -> tuple[Array, Stamps]:
    """Speeds (M,) of the tip, each over ten samples [m/s], and the sending time of the last of the ten samples."""
    ways = places.values[_SHORT:, :3] - places.values[:-_SHORT, :3]
    times = 1e-9 * (places.stamp_ns[_SHORT:] - places.stamp_ns[:-_SHORT])
    is_later = times > 0.0
    speeds = np.linalg.norm(ways[is_later], axis=1) / times[is_later]
    return speeds, places.sent_ns[_SHORT:][is_later]


def rest_delay(places: Trace, since_ns: int, slow: float, until_ns: int) -> float:
    """Time from ``since_ns`` until the tip stays slower than ``slow`` [s]; NaN if it never does.

    If the pose of the tip is no longer published, the result is the time of the last sample.

    Args:
        places: Positions of the tip.
        since_ns: Begin of the measured time [ns].
        slow: Speed below which the tip is at rest [m/s].
        until_ns: End of the observation [ns].
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
    """Length of the path of the tip between two moments, in steps of ten samples [m]."""
    taken = places.within(since_ns, until_ns).values[::_SHORT, :3]
    return float(np.sum(np.linalg.norm(np.diff(taken, axis=0), axis=1)))


def ramp(setpoints: Trace, braking: Array, dt: float) -> float:
    """Smallest deceleration of a joint to rest, divided by the deceleration of its drive; NaN if no joint braked.

    If a joint brakes at a constant rate, its step decreases by the same amount in every tick, and its last step is not
    larger than this amount. A joint that creeps behind its reference stops after steps that hardly change.

    Args:
        setpoints: Joint setpoints up to rest, values (N, n) [rad or m].
        braking: Deceleration of each drive, shape (n,) [rad/s² or m/s²].
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
    """Largest distance of joints (N, n) beyond their limits (n,) [rad or m]; 0 if all are inside."""
    return float(np.max(np.maximum(places - upper, lower - places), initial=0.0))


def tips(fk: Callable[[Array], Array], joints: Trace, n: int) -> Trace:
    """Positions (N, 3) of the tip [m] for joints, by forward kinematics independent of the slave.

    Args:
        fk: Forward kinematics: function from joints (n,) to the tip's pose (4, 4).
        joints: Trace of joints; the first n columns of its values (N, n or more) are the positions [rad or m].
        n: Number of joints.
    """
    found = [fk(row)[:3, 3] for row in joints.values[:, :n]]
    values = np.array(found) if found else np.empty((0, 3))
    return Trace(joints.sent_ns, joints.number, values, joints.stamp_ns)


def apart(first: Trace, second: Trace) -> float:
    """Largest difference between the displacements (N, 3) of two traces in the same ticks [m].

    The displacements of each trace begin at its own first position. So a constant offset, for example of a badly
    measured tool, does not count.
    """
    _, at, other = np.intersect1d(first.stamp_ns, second.stamp_ns, return_indices=True)
    if not len(at):
        return 0.0
    ways = [t.values[i, :3] - t.values[i[0], :3] for t, i in ((first, at), (second, other))]
    return float(np.max(np.linalg.norm(ways[0] - ways[1], axis=1)))


def silence(places: Trace, setpoints: Trace) -> float:
    """Time from the last sample of ``places`` to the last setpoint [s].

    The result is 0 without setpoints, and infinite if only setpoints were received.
    """
    if not len(setpoints):
        return 0.0
    if not len(places):
        return float("inf")
    return max(0.0, 1e-9 * float(setpoints.sent_ns[-1] - places.sent_ns[-1]))


def way_ratio(places: Trace, speed_limit: float, dt: float) -> float:
    """Largest step of the tip (N, 3) [m], divided by the step at a speed limit [m/s]; 0 without two samples."""
    ticks = np.diff(places.number)
    steps = np.linalg.norm(np.diff(places.values, axis=0), axis=1)[ticks > 0]
    return float(np.max(steps / (speed_limit * dt * ticks[ticks > 0]), initial=0.0))


def joint_speeds(setpoints: Trace, since_ns: int, until_ns: int) -> Array:
    """Largest speed of each joint's setpoint in an interval, shape (n,) [rad/s or m/s]."""
    found = setpoints.within(since_ns, until_ns)
    if len(found) < 2:
        return np.zeros(setpoints.values.shape[1])
    times = np.maximum(np.diff(found.number), 1)[:, np.newaxis] * 1e-3
    speeds: Array = np.max(np.abs(np.diff(found.values, axis=0)) / times, axis=0)
    return speeds


def braking_way(setpoints: Trace, moment_ns: int, jacobian: Array, braking: Array) -> float:
    r"""Largest distance that the tip moves if all drives brake from their speeds at a moment [m].

    Joint i, which moves at :math:`\dot q_i` and brakes at :math:`a_i`, travels :math:`\dot q_i^2 / (2 a_i)`. The tip
    moves at most by the sum of the displacements that the single joints cause.

    Args:
        setpoints: Joint setpoints, values (N, n) [rad or m].
        moment_ns: The moment [ns].
        jacobian: Jacobian of the tip, shape (6, n).
        braking: Deceleration of the drives, shape (n,) [rad/s² or m/s²].
    """
    speeds = joint_speeds(setpoints, moment_ns - JUST_BEFORE_NS, moment_ns)
    return float(np.linalg.norm(jacobian[:3], axis=0) @ (speeds**2 / (2.0 * braking)))


def lag(setpoints: Trace, places: Trace, moment_ns: int) -> float:
    """Distance of the tip behind its setpoint at a moment [m]; the tip may still catch up by this distance."""
    wanted = setpoints.within(moment_ns - _BEFORE_NS, moment_ns)
    found = places.within(moment_ns - _BEFORE_NS, moment_ns)
    if not len(wanted) or not len(found):
        return 0.0
    return float(np.linalg.norm(wanted.values[-1, :3] - found.values[-1, :3]))
