"""Hearing: checks whether samples of an arm's joints can be true."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from teleop_core.graph.stamps import wrong_stamp
from teleop_core.kernels.geometry import Array
from teleop_core.robots.joint_map import JointMap

_OVERSPEED = 2.0
"""Largest plausible joint speed, divided by the rated speed; assumed, larger than the server's bound 1.5."""
_LAG = 0.02
"""Time constant [s], assumed, of speeds differentiated from positions, for arms that send no speeds."""


class Wrong(Enum):
    """Reason why a sample is rejected."""

    NAMES = "names"
    FORM = "form"
    STAMP = "stamp"
    JUMP = "jump"


@dataclass(frozen=True)
class Sample:
    """One message of an arm, in its own names and order.

    Attributes:
        names: Joint names.
        position: Position of each joint [rad or m].
        velocity: Velocity of each joint [rad/s or m/s], or empty; NaN where it is not known.
        effort: Effort of each joint [N·m or N], or empty; NaN where it is not known.
        stamp_ns: Time of the sample [ns].
    """

    names: Sequence[str]
    position: Sequence[float]
    velocity: Sequence[float]
    effort: Sequence[float]
    stamp_ns: int


class Hearing:
    """The newest valid sample of an arm, in our names, order and signs.

    After a jump all samples are rejected until :meth:`begin_anew`.

    Args:
        joints: Map between our joints and those of the arm.
        speed_limit: Rated speeds (n,) [rad/s or m/s].
        tolerance: Allowed change of a position beyond what the joint's speed explains [rad or m].
        oldest: Largest difference between a stamp and our clock [s]; 0: stamps only have to increase.

    Attributes:
        position: Joint positions of the arm, shape (n,) [rad or m].
        velocity: Shape (n,) [rad/s or m/s].
        effort: Shape (n,) [N·m or N].
        stamp_ns: Stamp of the newest valid sample [ns]; 0 before the first.
        heard_ns: Arrival time of that sample [ns]; 0 before the first.
        wrong: Text about the fault of the newest sample; empty if the sample is valid.
        strange: Names in a message without our joints, such as a message of a gripper, since the newest valid sample.
        has_jumped: Whether a joint jumped.
        refused: Number of rejected samples, by reason.
    """

    def __init__(self, joints: JointMap, speed_limit: Array, tolerance: float, oldest: float) -> None:
        n = len(joints.ours)
        self._joints, self._speed_limit = joints, speed_limit
        self.tolerance, self.oldest = tolerance, oldest
        self.position, self.velocity, self.effort = np.zeros(n), np.zeros(n), np.zeros(n)
        self.refused: Counter[Wrong] = Counter()
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget the last position: the next valid sample may have any position."""
        self.stamp_ns = self.heard_ns = 0
        self.wrong, self.strange, self.has_jumped = "", "", False
        self.velocity[:] = 0.0

    def hear(self, sample: Sample, now_ns: int) -> bool:
        """Take a sample that came at ``now_ns`` [ns]; return whether it is accepted."""
        if sample.names and self._joints.is_strange(sample.names):
            self.refused[Wrong.NAMES] += 1
            self.strange = ", ".join(sample.names)
            return False
        found = self._wrong(sample, now_ns)
        if found is None:
            self.wrong = self.strange = ""
            return True
        reason, self.wrong = found
        self.refused[reason] += 1
        return False

    def _wrong(self, sample: Sample, now_ns: int) -> tuple[Wrong, str] | None:
        """Take a sample, or return why it is rejected."""
        if self.has_jumped:
            return Wrong.JUMP, self.wrong
        places = self._joints.places(sample.names)
        if isinstance(places, str):
            return Wrong.NAMES, places
        theirs = _numbers(sample.position, sample.names, places)
        if theirs is None or not np.isfinite(theirs).all():
            return Wrong.FORM, "not one finite position for each name"
        if text := wrong_stamp(sample.stamp_ns, self.stamp_ns, now_ns, self.oldest, "stamps"):
            return Wrong.STAMP, text
        position = self._joints.position(theirs)
        if text := self._jump(position, sample.stamp_ns):
            self.has_jumped = True
            return Wrong.JUMP, text
        self._take(sample, position, places, now_ns)
        return None

    def _jump(self, position: Array, stamp_ns: int) -> str:
        if not self.stamp_ns:
            return ""
        passed = 1e-9 * (stamp_ns - self.stamp_ns)
        way = np.abs(position - self.position)
        room = self.tolerance + _OVERSPEED * passed * self._speed_limit
        if (way <= room).all():
            return ""
        i = int(np.argmax(way - room))
        return (
            f"{self._joints.theirs[i]} jumped by {way[i]:.4g} in {passed:.4g} s, at most "
            f"{room[i]:.4g}; disable the arm, look at it, then enable it"
        )

    def _take(self, sample: Sample, position: Array, places: list[int], now_ns: int) -> None:
        velocity = _numbers(sample.velocity, sample.names, places)
        if velocity is not None and np.isfinite(velocity).all():
            self.velocity[:] = self._joints.rate(velocity)
        elif self.stamp_ns:
            passed = 1e-9 * (sample.stamp_ns - self.stamp_ns)
            share = passed / (passed + _LAG)
            self.velocity += share * ((position - self.position) / passed - self.velocity)
        effort = _numbers(sample.effort, sample.names, places)
        known = effort is not None and np.isfinite(effort).all()
        self.effort[:] = self._joints.effort(effort) if effort is not None and known else 0.0
        self.position[:] = position
        self.stamp_ns, self.heard_ns = sample.stamp_ns, now_ns


def _numbers(values: Sequence[float], names: Sequence[str], places: list[int]) -> Array | None:
    """Values of our joints, in our order; None if the number of values differs from the number of names."""
    if len(values) != len(names):
        return None
    return np.array([values[place] for place in places], dtype=np.float64)
