"""Asked path: the motion of a recorded hand, sample by sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags.reader import Bag
from teleop_core.base.errors import RecordingError
from teleop_core.graph.topics import MASTER_BUTTONS, MASTER_MEASURED_CP
from teleop_core.kernels.geometry import Array

STRETCHES = 10
"""Number of stretches that represent a long path."""


@dataclass(frozen=True, eq=False)
class AskedPath:
    """Motion of a hand.

    Attributes:
        name: Name of the path in tables.
        stamp_ns: Stamps (N,) [ns], rising.
        poses: Poses (N, 7) of the master: position [m], quaternion w, x, y, z.
        buttons: Clutch, fixture, mode (N, 3): 1 pressed.
    """

    name: str
    stamp_ns: NDArray[np.int64]
    poses: Array
    buttons: Array

    def __len__(self) -> int:
        return len(self.stamp_ns)

    @property
    def time(self) -> Array:
        """Times (N,) [s] since the first sample."""
        return np.asarray((self.stamp_ns - self.stamp_ns[0]) * 1e-9, dtype=np.float64)

    @property
    def stylus(self) -> Array:
        """Attitude of the stylus, quaternion (4,), at the first sample without the clutch."""
        is_free = self.buttons[:, 0] == 0.0
        return np.array(self.poses[int(is_free.argmax()), 3:])

    def limited(self, count: int) -> "AskedPath":
        """Copy of the path with at most about ``count`` samples, evenly spread over the time."""
        return self if len(self) <= count else self.excerpt(count / self.time[-1], 2 * count)

    def excerpt(self, rate: float, count: int) -> "AskedPath":
        """Fewer samples of the same motion.

        The excerpt contains at most ``rate`` samples per second. It also contains all samples at which a button
        changes. If more than ``count`` samples remain, it contains only ten stretches of the path, with their original
        times.

        Args:
            rate: Samples per second.
            count: Largest number of samples; samples at which a button changes are not counted.
        """
        slots = np.floor(self.time * rate)
        is_kept = np.append(True, np.diff(slots) > 0.0)
        changes = np.flatnonzero((np.diff(self.buttons, axis=0) != 0.0).any(axis=1))
        is_kept[changes] = is_kept[changes + 1] = True
        kept = np.flatnonzero(is_kept)
        if len(kept) > count:
            begins = np.linspace(0, len(kept) - count // STRETCHES, STRETCHES).astype(np.int64)
            kept = kept[np.concatenate([b + np.arange(count // STRETCHES) for b in begins])]
        return AskedPath(self.name, self.stamp_ns[kept], self.poses[kept], self.buttons[kept])


def asked_path(bag: Bag) -> AskedPath:
    """Motion of the hand in a recording.

    Args:
        bag: Recording that contains ``master/measured_cp``; ``master/buttons`` is optional.

    Raises:
        RecordingError: The recording contains fewer than two poses of the master at different times.
    """
    bag.require((MASTER_MEASURED_CP,))
    series = bag.read(MASTER_MEASURED_CP)
    stamps, first = np.unique(series.stamp_ns, return_index=True)
    if len(stamps) < 2:
        raise RecordingError(bag.path, "holds no motion: fewer than two poses of the master")
    poses = np.ascontiguousarray(series.values[first])
    buttons = np.zeros((len(stamps), 3))
    if MASTER_BUTTONS.name in bag.topics and bag.topics[MASTER_BUTTONS.name].count:
        pressed = bag.read(MASTER_BUTTONS)
        at = np.searchsorted(pressed.stamp_ns, stamps, side="right") - 1
        buttons[at >= 0] = pressed.values[at[at >= 0]]
    later_ns = max(0, 1 - int(stamps[0]))  # stamps of sessions are positive
    return AskedPath(bag.path.name, stamps + later_ns, poses, buttons)
