"""Clutches: how often the operator pressed the clutch, and for how long."""

import numpy as np

from teleop_core.evaluation import Metric, Window
from teleop_core.evaluation.metric import figure
from teleop_core.graph.topics import MASTER_BUTTONS


class ClutchesMetric(Metric):
    """Number of presses of the clutch, and share of the samples in which the clutch is pressed."""

    name, topics = "clutches", (MASTER_BUTTONS,)
    count = figure("1", "number of presses of the clutch")
    share = figure("1", "share of the button samples in which the clutch is pressed")
    _last, _samples, _down = np.inf, 0, 0

    def add(self, window: Window) -> None:
        """Process one window."""
        if len(is_down := window.samples(MASTER_BUTTONS).values[:, 0] > 0.5):
            self.count = (self.count or 0) + int((np.diff(is_down, prepend=self._last > 0.5) & is_down).sum())
            self._last, self._samples, self._down = (
                is_down[-1],
                self._samples + len(is_down),
                self._down + is_down.sum(),
            )
            self.share = float(self._down / self._samples)
