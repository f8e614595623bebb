"""Asked error: how far the slave's tip is from where the hand would have brought it."""

import numpy as np

from teleop_core.evaluation.accumulators import Moments, Spread
from teleop_core.evaluation.asked import ASKED_TOPICS, Asked
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import SPREAD_MEANING, Key, Metric
from teleop_core.evaluation.pose_errors import angles_between
from teleop_core.evaluation.rows import Row, error_rows
from teleop_core.evaluation.windows import Window
from teleop_core.topics import SLAVE_MEASURED_CP

GROUP = "against what was asked for"
_MEANING = (
    "slave/measured_cp to where the hand has asked it to be since it was engaged or the clutch let "
    "go"
)


class AskedErrorMetric(Metric):
    """Spread of the distance between tip and asked place, [mm].

    What limits cut off stays in the error until the next clutch stroke, and the lag of filters and
    interpolation is in it.
    """

    name = "asked_error_mm"
    keys = (Key("asked_error_mm.rms|sd|max", "mm", f"{_MEANING}: {SPREAD_MEANING}"),)
    topics = ASKED_TOPICS

    def __init__(self, context: Context) -> None:
        self._error, self._asked = Moments(), context.shared(Asked)

    def add(self, window: Window) -> None:
        """Take one window."""
        measured = window.samples(SLAVE_MEASURED_CP)
        off = measured.values[:, :3] - self._asked.at(measured.stamp_ns)[:, :3]
        self._error.add(np.linalg.norm(off, axis=1) * 1e3)

    def values(self) -> Spread:
        """Spread so far, [mm]."""
        return self._error.spread()

    def rows(self) -> list[Row]:
        """Root mean square and maximum."""
        return error_rows(GROUP, "position", "mm", self.values())


class AskedTurnMetric(Metric):
    """Spread of the angle between the tool and its asked orientation, [deg].

    None where ``rotation_gain`` is not 1: the tool then has no orientation that is asked for.
    """

    name = "asked_error_deg"
    keys = (Key("asked_error_deg.rms|sd|max", "deg", f"angle of {_MEANING}: {SPREAD_MEANING}"),)
    topics = ASKED_TOPICS

    def __init__(self, context: Context) -> None:
        self._error, self._asked = Moments(), context.shared(Asked)

    def add(self, window: Window) -> None:
        """Take one window."""
        measured = window.samples(SLAVE_MEASURED_CP)
        asked = self._asked.at(measured.stamp_ns)[:, 3:]
        self._error.add(np.degrees(angles_between(measured.values[:, 3:], asked)))

    def values(self) -> Spread:
        """Spread so far, [deg]."""
        return self._error.spread()

    def rows(self) -> list[Row]:
        """Root mean square and maximum."""
        return error_rows(GROUP, "rotation", "deg", self.values())
