"""Gains: which gain was in force, and so with which published figures a score compares."""

from collections import Counter

import numpy as np

from teleop_core.controllers.source_pid import SOURCE_PID
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.published import Published, published_for
from teleop_core.evaluation.windows import Window
from teleop_core.topics import SLAVE_MEASURED_CP


class Gains:
    """Accumulator of how many slave samples each gain was in force for."""

    def __init__(self, context: Context) -> None:
        self._robot, self._origin = context.robot, context.origin
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
        """Published figures of this gain, robot and plant; None if there are none."""
        return published_for(self.gain, self._robot, self._origin.plant)

    @property
    def is_source(self) -> bool:
        """Whether the machine itself may have run, or what is to predict it, control law too."""
        return self._origin.plant is None or self._origin.controller == SOURCE_PID.name
