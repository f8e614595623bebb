"""Looks: how often the hand began to move after a rest, as if the operator had looked at the result."""

import numpy as np

from teleop_core.evaluation import Metric, Window
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.motion_measures import IDLE_SPEED
from teleop_core.graph.topics import MASTER_MEASURED_CP


class LooksMetric(Metric):
    """Number of times the hand begins to move after a rest of at least 0.1 s.

    0.1 s is the shortest time in which a person can use what was seen. A look itself is not recorded. It is inferred
    from the hand's motion, for persons and for simulated operators. Submovements without such a rest between them
    count as one look.
    """

    name, topics = "looks", (MASTER_MEASURED_CP,)
    count = figure("1", "number of times that the hand moved again, at 5 mm/s or more, after a rest of at least 0.1 s")
    _place, _slot, _still = np.full((1, 3), np.inf), -1, 0

    def add(self, window: Window) -> None:
        """Process one window; one sample per 0.02 s is used."""
        slots = (at := window.samples(MASTER_MEASURED_CP)).stamp_ns // 20_000_000
        places = np.concatenate((self._place, at.values[np.diff(slots, prepend=self._slot) > 0, :3]))
        for has_moved in (np.linalg.norm(np.diff(places, axis=0), axis=1) >= 0.02 * IDLE_SPEED).tolist():
            self.count = (self.count or 0) + (has_moved and self._still >= 5)
            self._still = 0 if has_moved else self._still + 1
        self._place, self._slot = places[-1:], int(slots.max(initial=self._slot))
