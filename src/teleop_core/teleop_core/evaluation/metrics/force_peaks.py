"""Force peaks: how often the force on the tip rose and fell again."""

import numpy as np

from teleop_core.evaluation import Metric, Window
from teleop_core.evaluation.metric import figure
from teleop_core.graph.topics import SLAVE_TRUE_CF

_STEP = 0.1  # smallest rise of the force before a peak, and smallest fall after the peak [N]


class ForcePeaksMetric(Metric):
    """Number of peaks of the force on the tip that are at least 0.1 N higher than both sides."""

    name, topics = "force_peaks", (SLAVE_TRUE_CF,)
    count = figure("1", "number of peaks of the force on the tip that rise by 0.1 N or more above both sides")
    _turn, _rises = 0.0, True

    def add(self, window: Window) -> None:
        """Process one window; ``_turn`` is the extreme force since the last counted turning point."""
        force = np.linalg.norm(window.samples(SLAVE_TRUE_CF).values[:, :3], axis=1)
        for one in force[np.diff(force, prepend=np.nan) != 0.0].tolist():
            is_turned = abs(one - self._turn) >= _STEP and (one < self._turn) == self._rises
            if is_turned or (one > self._turn) == self._rises:
                self._turn = one
            self.count = (self.count or 0) + int(is_turned and self._rises)
            self._rises ^= is_turned
