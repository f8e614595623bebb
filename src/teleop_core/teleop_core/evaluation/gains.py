"""Gains: which gain was in force, and so with which published figures a score compares."""

from collections import Counter

import numpy as np

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.published import Published, published_for
from teleop_core.evaluation.windows import Window
from teleop_core.topics import SLAVE_MEASURED_CP


class Gains:
    """Accumulator of how many slave samples each gain was in force for."""

    def __init__(self, context: Context) -> None:
        self._robot = context.robot
        self._counts: Counter[float] = Counter()

    def add(self, window: Window) -> None:
        """Take one window."""
        column = window.states(SLAVE_MEASURED_CP).column("gain")
        gains, counts = np.unique(column, return_counts=True)
        self._counts.update(
            {g: n for g, n in zip(gains.tolist(), counts.tolist(), strict=True) if g}
        )

    @property
    def gain(self) -> float | None:
        """Gain that was in force for most slave samples; None without teleop/state."""
        return self._counts.most_common(1)[0][0] if self._counts else None

    @property
    def published(self) -> Published | None:
        """Published figures of this gain and robot; None if there are none."""
        return published_for(self.gain, self._robot)
