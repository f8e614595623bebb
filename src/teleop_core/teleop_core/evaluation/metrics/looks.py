"""Looks: how often a hand that rested began to move, as after a look at what it did."""

import numpy as np

from teleop_core.evaluation import Metric, Window
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.motion_measures import IDLE_SPEED
from teleop_core.graph.topics import MASTER_MEASURED_CP


class LooksMetric(Metric):
    """Begins of motion after a rest in which what was seen can be used: 0.1 s, a shortest time of the eye.

    Nobody tells a look; it is found by the hand, of people as of simulated operators. Submovements with no such rest
    between them count as one look.
    """

    name, topics = "looks", (MASTER_MEASURED_CP,)
    count = figure("1", "how often the hand moved on, at 5 mm/s, after 0.1 s of rest or more")
    _place, _slot, _still = np.full((1, 3), np.inf), -1, 0

    def add(self, window: Window) -> None:
        """Take one window, of which one sample in each fiftieth of a second is looked at."""
        slots = (at := window.samples(MASTER_MEASURED_CP)).stamp_ns // 20_000_000
        places = np.concatenate((self._place, at.values[np.diff(slots, prepend=self._slot) > 0, :3]))
        for has_moved in (np.linalg.norm(np.diff(places, axis=0), axis=1) >= 0.02 * IDLE_SPEED).tolist():
            self.count = (self.count or 0) + (has_moved and self._still >= 5)
            self._still = 0 if has_moved else self._still + 1
        self._place, self._slot = places[-1:], int(slots.max(initial=self._slot))
