"""Waits: how often and how long the hand rests, for example because the operator waits for a late picture."""

import numpy as np

from teleop_core.evaluation import Metric, Window
from teleop_core.evaluation.metric import figure
from teleop_core.graph.topics import MASTER_MEASURED_CP


class WaitsMetric(Metric):
    """Number and share of rests of the hand: 0.3 s or more with less than 0.5 mm of motion in each 0.1 s."""

    name, topics = "waits", (MASTER_MEASURED_CP,)
    count = figure(
        "1", "number of waits: rests of the hand of 0.3 s or more, with less than 0.5 mm of motion in each 0.1 s"
    )
    share = figure("1", "share of the time in waits, without the first 0.3 s of each wait")
    _place, _slot, _slots, _still, _rests = np.full(3, np.inf), -1, 0, 0, 0

    def add(self, window: Window) -> None:
        """Process one window; one sample per 0.1 s is used."""
        at = window.samples(MASTER_MEASURED_CP)
        slots = at.stamp_ns // 100_000_000
        for i in np.flatnonzero(np.diff(slots, prepend=self._slot) > 0).tolist():
            has_moved = np.linalg.norm(at.values[i, :3] - self._place) >= 5e-4
            self._still = 0 if has_moved else self._still + 1
            self._place, self._slot, self._slots = at.values[i, :3], int(slots[i]), self._slots + 1
            self._rests += self._still > 3
            self.count, self.share = (self.count or 0) + (self._still == 3), self._rests / self._slots
