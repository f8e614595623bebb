"""Economy: how direct the tip's paths to its goals were."""

import numpy as np

from teleop_core.evaluation import Metric, Window
from teleop_core.evaluation.metric import figure
from teleop_core.graph.topics import SLAVE_TRUE_CP, TASK_STATE

_ATTEMPTS, _WAY = TASK_STATE.columns.index("attempts"), TASK_STATE.columns.index("way")


class EconomyMetric(Metric):
    """Sum of the straight distances to a task's goals divided by the length of the tip's path; 1 is straight."""

    name, topics = "economy", (SLAVE_TRUE_CP, TASK_STATE)
    path_mm = figure("mm", "length of the tip's path, from positions every 0.1 s")
    share = figure("1", "straight distances of all attempts, divided by path_mm; 1: all paths are straight")
    _path, _slot, _straight, _tried = np.empty((0, 3)), -1, 0.0, 0.0

    def add(self, window: Window) -> None:
        """Process one window."""
        for row in window.samples(TASK_STATE).values:
            self._straight += row[_WAY] * (row[_ATTEMPTS] > self._tried)
            self._tried = row[_ATTEMPTS]
        slots = (tip := window.samples(SLAVE_TRUE_CP)).stamp_ns // 100_000_000
        path = np.concatenate((self._path, tip.values[np.diff(slots, prepend=self._slot) > 0, :3]))
        if len(path):
            self.path_mm = (self.path_mm or 0.0) + 1e3 * float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        self._path, self._slot = path[-1:], int(slots.max(initial=self._slot))
        self.share = 1e3 * self._straight / self.path_mm if self._tried and self.path_mm else None
