"""Replay: the joints at some moments a second, for a page that plays them; drawn only."""

import numpy as np

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.figure import Figure
from teleop_core.evaluation.metric import Metric
from teleop_core.evaluation.metrics.path import PathMetric
from teleop_core.evaluation.outlines import outlines_of
from teleop_core.evaluation.plain import Values
from teleop_core.evaluation.replay_figure import replay_figure
from teleop_core.evaluation.windows import Window
from teleop_core.graph.topics import SLAVE_MEASURED_JS
from teleop_core.kernels.geometry import Array

RATE = 25.0
"""Moments that are kept of a second."""
MOST = 15_000
"""Moments that are kept at most: ten minutes; those of a longer recording are further apart."""
_SECOND_NS = 1e9


class ReplayMetric(Metric):
    """Draws the robot as it moved, where it is known and its joints were recorded."""

    name = "replay"
    topics = (SLAVE_MEASURED_JS,)

    def __init__(self, context: Context) -> None:
        bag, self._context = context.bag, context
        self._path = context.shared(PathMetric)
        duration_ns = max(1, bag.end_ns - bag.start_ns)
        self._step_ns = max(_SECOND_NS / RATE, duration_ns / MOST)
        count = int(duration_ns / self._step_ns) + 1
        self._moments = bag.start_ns + (np.arange(count) * self._step_ns).astype(np.int64)
        self._joints: Array | None = None
        self._names: tuple[str, ...] = ()

    def add(self, window: Window) -> None:
        """Take one window."""
        series = window.around(SLAVE_MEASURED_JS)
        width = series.values.shape[1] // 3
        if not len(series.log_ns) or not width:
            return
        if self._joints is None:
            self._joints = np.full((len(self._moments), width), np.nan)
            self._names = series.names
        begin = max(window.after_ns + 1, int(series.log_ns[0]))
        end = min(window.until_ns, int(series.log_ns[-1]))
        first, last = np.searchsorted(self._moments, (begin, end + 1))
        since = series.log_ns - series.log_ns[0]
        for joint in range(width):
            wanted = self._moments[first:last] - series.log_ns[0]
            self._joints[first:last, joint] = np.interp(wanted, since, series.values[:, joint])

    def values(self) -> Values:
        """Nothing: it only draws."""
        return {}

    def figures(self) -> list[Figure]:
        """The robot as it moved; nothing if that is not known."""
        robot = self._context.load_robot()
        if robot is None or self._joints is None or not set(robot.joint_names) <= set(self._names):
            return []
        order = [self._names.index(name) for name in robot.joint_names]
        joints = np.ascontiguousarray(self._joints[:, order])
        known = np.flatnonzero(np.isfinite(joints).all(axis=1))
        if not len(known):
            return []
        first, last = int(known[0]), int(known[-1])
        begin_ns = int(self._moments[first]) - self._context.bag.start_ns
        figure = replay_figure(
            robot, begin_ns / _SECOND_NS, self._step_ns / _SECOND_NS, joints[first : last + 1],
            self._path.measured(), outlines_of(self._context),
        )  # fmt: skip
        return [figure]
