"""Command error: how far the slave's tip is from the newest command, with the filters' lag."""

from teleop_core.evaluation.accumulators import Moments, Spread
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import SPREAD_MEANING, Key, Metric
from teleop_core.evaluation.rows import Row, error_rows
from teleop_core.evaluation.tracking import TRACKED, tracked
from teleop_core.evaluation.windows import Window

GROUP = "against unfiltered command"


class CommandErrorMetric(Metric):
    """Spread of the distance between tip and command, [mm]."""

    name = "command_error_mm"
    keys = (
        Key("command_error_mm.rms|sd|max", "mm",
            f"slave/measured_cp to the latest slave/servo_cp at its stamp: {SPREAD_MEANING}"),
    )  # fmt: skip
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        self._error = Moments()

    def add(self, window: Window) -> None:
        """Take one window."""
        self._error.add(tracked(window).behind.position_mm)

    def values(self) -> Spread:
        """Spread so far, [mm]."""
        return self._error.spread()

    def rows(self) -> list[Row]:
        """Root mean square and maximum."""
        return error_rows(GROUP, "position", "mm", self.values())
