"""True error: how far the tip really is from its reference, which no encoder sees."""

from teleop_core.evaluation.accumulators import Moments, Spread
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import SPREAD_MEANING, Key, Metric
from teleop_core.evaluation.pairing import same_stamp
from teleop_core.evaluation.pose_errors import pose_errors
from teleop_core.evaluation.rows import Row, error_rows
from teleop_core.evaluation.tracking import TRACKED, rows_of, tracked
from teleop_core.evaluation.windows import Window
from teleop_core.topics import SLAVE_TRUE_CP

GROUP = "true tip, behind the encoders"


class TrueErrorMetric(Metric):
    """Spread of the distance between the true tip and the reference, [mm]."""

    name = "true_error_mm"
    keys = (
        Key("true_error_mm.rms|sd|max", "mm",
            "slave/true_cp to slave/setpoint_cp of the same tick, null if nobody tells the true "
            f"tip: {SPREAD_MEANING}"),
    )  # fmt: skip
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        context.read((SLAVE_TRUE_CP,))
        self._error = Moments()

    def add(self, window: Window) -> None:
        """Take one window."""
        found, true = tracked(window), window.around(SLAVE_TRUE_CP)
        if not len(true):
            return
        tips = rows_of(true, same_stamp(found.stamp_ns, true.stamp_ns))
        self._error.add(pose_errors(tips, found.setpoints).position_mm)

    def values(self) -> Spread:
        """Spread so far, [mm]."""
        return self._error.spread()

    def rows(self) -> list[Row]:
        """Root mean square and maximum."""
        return error_rows(GROUP, "position", "mm", self.values())
