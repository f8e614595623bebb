"""Agreement: compares the measurements of an arm with its commands, in time and in position.

Two trails of the same motion are compared by their changes. So a constant difference, such as the error by an
uncompensated load, is ignored.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Vectors = NDArray[np.float64]

LATEST = 0.25
"""Largest delay of a measurement behind its setpoint [s]. It is assumed as five times the delay of our own arms, so
that a tenth of a second remains for networks and slow control laws."""
SHARE = 0.15
"""Share of the displacement by which two trails may differ. The assumed value is larger than the effect of friction,
and smaller than the effect of a wrong scale."""
_TURN = 0.02
"""Turn of the tip by which two trails may always differ [rad]; control loops and encoders need less."""
_BULGE = 0.5
"""Share of the displacement by which a measurement may leave the range of its setpoints. A loop with three equal poles
overshoots a step by a quarter; the rest is for friction."""
_GRID = 0.01  # time between two points of a comparison [s]
_FARTHEST = 1.0  # largest lag that is searched [s]
_GAP = 0.05  # longer time between two messages, which means that messages were lost or had no reader [s]
_SPAN = 0.25  # time over which positions are averaged [s]; longer than the settling time of a control loop
_SAMPLES = 20  # least number of messages of a motion for which its speeds can be integrated
_FEW = 10  # largest number of messages that is too small for a comparison


def _none() -> Vectors:
    return np.empty((0, 0))


@dataclass(frozen=True, eq=False)
class Trail:
    """Messages of one topic during a motion.

    Attributes:
        sent: Sending time of each message, shape (N,) [s].
        stamp: Stamp of each message, shape (N,) [s].
        place: Joint positions or position of the tip, shape (N, k).
        rate: Velocities, shape (N, k); empty if the topic has none.
        turn: Rotation vectors of the tip since the first message, shape (N, 3) [rad]; empty if the topic has none.
        spin: Angular velocities of the tip, shape (N, 3) [rad/s]; empty if the topic has none.
    """

    sent: Vectors
    stamp: Vectors
    place: Vectors
    rate: Vectors
    turn: Vectors = field(default_factory=_none)
    spin: Vectors = field(default_factory=_none)

    def __len__(self) -> int:
        return len(self.sent)

    @property
    def turned(self) -> "Trail":
        """Trail of the turns of the tip, with its angular velocities; empty if the topic has none."""
        count = len(self.turn)
        return Trail(self.sent[:count], self.stamp[:count], self.turn, self.spin)

    @property
    def way(self) -> float:
        """Largest change of any coordinate since the first message; 0 without messages."""
        return float(np.max(np.abs(self.place - self.place[:1]), initial=0.0))


def follows(name: str, measured: Trail, wanted: Trail, least: float) -> str:
    """Text about the difference between a measurement and its setpoint; empty if they agree.

    Args:
        name: Name of the measurement.
        measured: Trail of the measurement.
        wanted: Trail of the setpoint.
        least: Smallest displacement that is compared.
    """
    if len(measured) < _FEW or len(wanted) < _FEW or wanted.way < least:
        return ""
    found = _nearest(measured, wanted)
    if found is None:
        return ""
    off, lag = found
    share = max(off / wanted.way, 1.0 - measured.way / wanted.way)
    if share > SHARE:
        ways = f"the setpoint moved by {wanted.way:.3g}, but {name} by {measured.way:.3g}"
        return f"{ways}: {share:.0%} off"
    if lag > LATEST:
        return f"{name} is {lag:.2g} s behind its setpoint, at most {LATEST:g}"
    if (bulge := _bulge(measured, wanted)) > _BULGE * wanted.way:
        return f"{name} leaves the way of its setpoint, {wanted.way:.3g} long, by {bulge:.3g} for a moment"
    return ""


def turns(name: str, measured: Trail, wanted: Trail) -> str:
    """Text about the difference between the turns of a measured tip and of its setpoint; empty if they agree."""
    first, second = measured.turned, wanted.turned
    if len(first) < _FEW or len(second) < _FEW:
        return ""
    found = _nearest(first, second)
    if found is None or found[0] <= max(_TURN, SHARE * second.way):
        return ""
    return f"the setpoint turned by {second.way:.3g} rad, but {name} by {first.way:.3g} rad"


def _nearest(measured: Trail, wanted: Trail) -> tuple[float, float] | None:
    """Largest difference of two trails at the lag at which they agree best, and this lag [s]; None if unknown."""
    grid = np.arange(wanted.sent[0], max(wanted.sent[-1], measured.sent[-1]), _GRID)
    found = _smooth(grid, measured)
    lags = np.arange(0.0, _FARTHEST, _GRID)
    off = [_differences(found, _smooth(grid - lag, wanted)) for lag in lags]
    if not any(len(one) >= _FEW for one in off):
        return None
    best = int(np.argmin([float(np.mean(one**2)) if len(one) >= _FEW else np.inf for one in off]))
    return float(np.max(np.abs(off[best]))), float(lags[best])


def _bulge(measured: Trail, wanted: Trail) -> float:
    """Largest distance of a measurement from the range of the setpoints of the last :data:`LATEST` seconds."""
    before = np.searchsorted(wanted.sent, measured.sent - LATEST) - 1
    after = np.searchsorted(wanted.sent, measured.sent, side="right")
    ranges = [wanted.place[max(i, 0) : max(k, 1)] for i, k in zip(before, after, strict=True)]
    lower = np.array([rows.min(axis=0) for rows in ranges]) - wanted.place[0]
    upper = np.array([rows.max(axis=0) for rows in ranges]) - wanted.place[0]
    moved = measured.place - measured.place[0]
    moved = moved - np.median(moved - np.clip(moved, lower, upper), axis=0)
    return float(np.max(np.abs(moved - np.clip(moved, lower, upper))))


def turns_add_up(trail: Trail) -> str:
    """Text about the difference between angular velocities and turns of the tip; empty if they agree."""
    said = adds_up(trail.turned, _TURN)
    return said.replace("positions", "orientation").replace("speeds", "angular speeds")


def adds_up(trail: Trail, least: float) -> str:
    """Text about the difference between velocities and changes of the positions; empty if they agree."""
    if len(trail) < _FEW or not trail.rate.size or trail.way < least:
        return ""
    steps = np.diff(trail.stamp)[:, None]
    is_whole = (steps > 0.0) & (steps < _GAP)
    went = np.cumsum(is_whole * 0.5 * (trail.rate[1:] + trail.rate[:-1]) * steps, axis=0)
    moved = np.cumsum(is_whole * np.diff(trail.place, axis=0), axis=0)
    longest = max(_SAMPLES * float(np.median(steps)), 0.5 * _SPAN)
    if np.max(np.abs(trail.rate)) * longest > trail.way:
        return ""  # the motion ended before filtered velocities were available
    share = float(np.max(np.abs(_differences(went, moved)))) / trail.way
    if share > SHARE:
        return f"the integral of its speeds differs from the change of its positions by {share:.0%}"
    return ""


def obeys(joints: Trail, tip: Trail, fk: Callable[[Vectors], Vectors], least: float) -> str:
    """Text about the difference between a measured tip and forward kinematics; empty if they agree.

    Args:
        joints: Measured joints.
        tip: Measured positions of the tip (N, 3) [m], and its turns.
        fk: Function from joints (n,) to the tip's pose (4, 4).
        least: Smallest displacement of the tip that is compared [m].
    """
    if len(joints) < _FEW or len(tip) < _FEW:
        return ""
    poses = np.array([fk(row) for row in joints.place])
    model = Trail(joints.sent, joints.stamp, poses[:, :3, 3], _none(), rotation_vectors(poses[:, :3, :3]))
    if said := turns("measured_cp", tip, model):
        return said.replace("the setpoint", "forward kinematics of measured_js")
    if max(model.way, tip.way) < least:
        return ""
    grid = np.arange(joints.sent[0], joints.sent[-1], _GRID)
    differences = _differences(_smooth(grid, model), _smooth(grid, tip))
    off = float(np.max(np.abs(differences), initial=0.0))
    if off > SHARE * max(model.way, tip.way):
        return f"the motion of the tip differs from forward kinematics of measured_js by {1000.0 * off:.2g} mm"
    return ""


def rotation_vectors(rotations: Vectors) -> Vectors:
    """Rotation vectors (N, 3) [rad] of rotations (N, 3, 3), relative to the first one, in the base."""
    if not len(rotations):
        return _none()
    found: Vectors = Rotation.from_matrix(rotations @ rotations[0].T).as_rotvec()
    return found


def _differences(first: Vectors, second: Vectors) -> Vectors:
    """Differences (M, k) between the rows in which both arrays are known, minus the median of the differences."""
    found = first - second
    found = found[np.isfinite(found).all(axis=1)]
    return found - np.median(found, axis=0) if len(found) else found


def _smooth(times: Vectors, trail: Trail) -> Vectors:
    """Change (M, k) since the first message, averaged over a window around each of the given times (M,).

    The mean hides an overshoot of a few hundredths of a second. The change is NaN where messages are missing, and zero
    before the first message.
    """
    at = np.searchsorted(trail.sent, times, side="right") - 1
    changed = trail.place[np.maximum(at, 0)] - trail.place[0]
    is_old = (at >= 0) & (times - trail.sent[np.maximum(at, 0)] > _GAP)
    changed[is_old] = np.nan
    half = round(0.5 * _SPAN / _GRID)
    padded = np.pad(changed, ((half, half), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1, axis=0)
    mean: Vectors = windows.mean(axis=-1)
    return mean
