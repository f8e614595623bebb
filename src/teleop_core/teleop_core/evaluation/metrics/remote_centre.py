"""Remote centre: distance between the tool's shaft and the point through which it must pass."""

import numpy as np

from teleop_core.evaluation import Context, Metric, Moments, Window
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.metrics.motion import approach_end_ns
from teleop_core.graph.topics import REMOTE_CENTRE, SLAVE_MEASURED_CP
from teleop_core.kernels.geometry import Array, rotations_from_quaternions


def distances(poses: Array, centre: Array, shaft: Array) -> tuple[Array, Array]:
    """Distances from a point to the shafts of tools (N,) [m], and from the point to the tips (N,) [m].

    Args:
        poses: Poses of the tips, (N, 7).
        centre: The point, (3,) or (N, 3) [m].
        shaft: Unit vector along the shaft in the tip's frame, (3,) or (N, 3).
    """
    ways = poses[:, :3] - centre
    turned = rotations_from_quaternions(poses[:, 3:7]) * np.broadcast_to(shaft, ways.shape)[:, None]
    off = np.cross(ways, turned.sum(axis=2))
    return np.sqrt((off**2).sum(axis=1)), np.sqrt((ways**2).sum(axis=1))


class RemoteCentreMetric(Metric):
    """Distance between a tool's shaft and its remote centre after the approach; None without a remote centre."""

    name, group = "remote_centre", "remote centre"
    topics = (REMOTE_CENTRE, SLAVE_MEASURED_CP)
    off_rms_mm = figure(
        "mm",
        "RMS distance from the remote centre to the shaft's axis, by slave/measured_cp",
        "shaft beside the centre, RMS",
    )
    off_max_mm = figure(
        "mm", "largest distance from the remote centre to the shaft's axis", "shaft beside the centre, max"
    )
    least_depth_mm = figure("mm", "smallest distance from the remote centre to the tip", "least depth of the tip")

    def __init__(self, context: Context) -> None:
        self._begin_ns = approach_end_ns(context) if context.span is None else context.span.first_ns
        self._off, self._least = Moments(), np.inf
        self._last: Array | None = None

    def add(self, window: Window) -> None:
        """Process one window."""
        places, poses = window.around(REMOTE_CENTRE), window.samples(SLAVE_MEASURED_CP)
        counts = poses.stamp_ns >= self._begin_ns
        if len(places):
            self._last = places.values[-1]  # the centre does not change during a session
        if self._last is None or not counts.any():
            return
        off, depth = distances(poses.values[counts, :7], self._last[:3], self._last[3:])
        self._off.add(1e3 * off)
        self._least = min(self._least, float(depth.min()))
        found = self._off.spread()
        self.off_rms_mm, self.off_max_mm = found.rms, found.max
        self.least_depth_mm = 1e3 * self._least if self._off.count else None
