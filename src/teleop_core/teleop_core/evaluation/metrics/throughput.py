"""Throughput: bits per second of a pointing task, from the effective width of its targets."""

import numpy as np

from teleop_core.evaluation.attempts import Attempts, AttemptsMetric
from teleop_core.evaluation.metric import figure

EFFECTIVE = 4.133
"""Effective width of a target, in standard deviations of the end points; 96 % of a normal distribution lie in it."""


class ThroughputMetric(AttemptsMetric):
    """Throughput and effective width; None with fewer than four attempts.

    Source:
        ISO/TS 9241-411 2012, annex B.
    """

    name, below = "throughput", "task"
    throughput = figure(
        "bit/s",
        "log2(mean distance / effective width + 1) divided by the mean time, without the first attempt",
        "throughput",
    )
    effective_width_mm = figure(
        "mm", "4.133 standard deviations of the end points along the directions of the movements", "effective width"
    )

    def judge(self, tried: Attempts) -> None:
        """Compute the effective width from the end points of the attempts."""
        way, off, time = map(tried.settled, ("way", "off", "time"))
        if tried.count >= 4:
            width = EFFECTIVE * float(off.std(ddof=1))
            bits = float(np.log2(float(way.mean()) / width + 1.0)) if width > 0.0 else np.nan
            self.throughput, self.effective_width_mm = bits / float(time.mean()), 1e3 * width
