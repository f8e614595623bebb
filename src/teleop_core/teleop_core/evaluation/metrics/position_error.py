"""Position error: how far the slave's tip is from its reference of the same tick."""

from teleop_core.evaluation.accumulators import Moments, Spread
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.figure import COMMAND, MEASURED, Figure, line, time_axis
from teleop_core.evaluation.gains import Gains
from teleop_core.evaluation.metric import SPREAD_MEANING, Key, Metric
from teleop_core.evaluation.metrics.command_error import CommandErrorMetric
from teleop_core.evaluation.published import POSITION_SHARE, agrees
from teleop_core.evaluation.rows import Row, number, spread_rows
from teleop_core.evaluation.tracking import TRACKED, ErrorTrace, tracked
from teleop_core.evaluation.windows import Window

GROUP = "against filtered reference"


class PositionErrorMetric(Metric):
    """Spread of the distance between tip and reference, [mm]."""

    name = "position_error_mm"
    keys = (
        Key("position_error_mm.rms|sd|max", "mm",
            f"slave/measured_cp to slave/setpoint_cp of the same tick: {SPREAD_MEANING}"),
    )  # fmt: skip
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        self._error, self._gains = Moments(), context.shared(Gains)
        self._trace, self._command = context.shared(ErrorTrace), context.shared(CommandErrorMetric)

    def add(self, window: Window) -> None:
        """Take one window."""
        self._error.add(tracked(window).against.position_mm)

    def values(self) -> Spread:
        """Spread so far, [mm]."""
        return self._error.spread()

    def rows(self) -> list[Row]:
        """The spread beside the published figures of the mode."""
        mode = self._gains.published
        if mode is None:
            return spread_rows(GROUP, "position", "mm", self.values())
        published, spread = mode.position_mm, self.values()
        met = agrees(spread.rms, published[0], POSITION_SHARE) if self._gains.is_source else None
        return spread_rows(GROUP, "position", "mm", spread, published, met)

    def figures(self) -> list[Figure]:
        """Distance of the tip from reference and command against time."""
        times, values = self._trace.envelope.line()
        spread, behind = self.values(), self._command.values()
        traces = [
            line(times, values[:, 0], "against filtered reference", MEASURED, 1.2),
            {**line(times, values[:, 1], "against command", COMMAND, 1.2), "visible": "legendonly"},
        ]
        sentence = (
            f"Distance between tip and reference: {number(spread.rms)} mm RMS, "
            f"{number(spread.max)} mm at most. Against the unfiltered command (click the legend) "
            f"it is {number(behind.rms)} mm RMS, with the lag of the low-pass in it."
        )
        layout = {
            "xaxis": time_axis(),
            "yaxis": {"title": {"text": "position error [mm]"}, "rangemode": "tozero"},
        }
        return [Figure("Position error", sentence, traces, layout, 340)]
