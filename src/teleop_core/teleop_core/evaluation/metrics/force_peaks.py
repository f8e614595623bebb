"""Force peaks: how often the force on the tip rose and fell again."""

import numpy as np

from teleop_core.evaluation import Context, Key, Metric, Window
from teleop_core.graph.topics import SLAVE_TRUE_CF

_STEP = 0.1  # by which the force rises before a peak, and falls after it [N]


class ForcePeaksMetric(Metric):
    """Peaks of the force on the tip that stand out by 0.1 N on both sides."""

    name = "force_peaks"
    keys = (Key("force_peaks.count", "1", "peaks of the force on the tip, 0.1 N above both sides"),)
    topics = (SLAVE_TRUE_CF,)

    def __init__(self, _: Context) -> None:
        self._turn, self._rises, self._count, self._is_told = 0.0, True, 0, False

    def add(self, window: Window) -> None:
        """Take one window; ``turn`` is the extreme force since the last turn that counted."""
        force = np.linalg.norm(window.samples(SLAVE_TRUE_CF).values[:, :3], axis=1)
        self._is_told |= len(force) > 0
        for one in force[np.diff(force, prepend=np.nan) != 0.0].tolist():
            is_turned = abs(one - self._turn) >= _STEP and (one < self._turn) == self._rises
            if is_turned or (one > self._turn) == self._rises:
                self._turn = one
            self._count += is_turned and self._rises
            self._rises ^= is_turned

    def values(self) -> dict[str, int | None]:
        """What ``keys`` name; None where nobody tells the force."""
        return {"count": self._count if self._is_told else None}
