"""Position error: distance of the slave's tip from reference and command, and of the true tip from the reference.

The reference is the setpoint of the same tick. The newest command is ahead of the reference by the filters' lag. The
true tip differs from the tip that the encoders measure.
"""

import numpy as np

from teleop_core.evaluation import TRACKED, Context, Window, same_stamp, tracked
from teleop_core.evaluation.figure import COMMAND, MEASURED, Figure, line, time_axis
from teleop_core.evaluation.metric import SpreadMetric
from teleop_core.evaluation.published import POSITION_SHARE, Gains, agrees
from teleop_core.evaluation.rows import TableRow, number, spread_rows
from teleop_core.evaluation.tracking import ErrorTrace, pose_errors, rows_of
from teleop_core.graph.topics import SLAVE_TRUE_CP
from teleop_core.kernels.geometry import Array

GROUP, COMMAND_GROUP = "against filtered reference", "against unfiltered command"


class CommandErrorMetric(SpreadMetric):
    """Spread of the distance between tip and command, [mm]."""

    name, group = "command_error_mm", COMMAND_GROUP
    meaning = "slave/measured_cp to the latest slave/servo_cp at its stamp"
    topics = TRACKED

    def errors(self, window: Window) -> Array:
        """Distances (N,) [mm]."""
        return tracked(window).behind.position_mm


class TrueErrorMetric(SpreadMetric):
    """Spread of the distance between the true tip and the reference, [mm]."""

    name, group = "true_error_mm", "true tip, behind the encoders"
    meaning = "slave/true_cp to slave/setpoint_cp of the same tick, null if the true tip is unknown"
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        context.read((SLAVE_TRUE_CP,))

    def errors(self, window: Window) -> Array:
        """Distances (N,) [mm]; empty if no true tip was recorded."""
        found, true = tracked(window), window.around(SLAVE_TRUE_CP)
        if not len(true):
            return np.empty(0)
        tips = rows_of(true, same_stamp(found.stamp_ns, true.stamp_ns))
        return pose_errors(tips, found.setpoints).position_mm


class PositionErrorMetric(SpreadMetric):
    """Spread of the distance between tip and reference, [mm]."""

    name, group = "position_error_mm", GROUP
    meaning = "slave/measured_cp to slave/setpoint_cp of the same tick"
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._gains, self._trace = context.shared(Gains), context.shared(ErrorTrace)
        self._command = context.shared(CommandErrorMetric)

    def errors(self, window: Window) -> Array:
        """Distances (N,) [mm]."""
        return tracked(window).against.position_mm

    def rows(self) -> list[TableRow]:
        """Rows of the spread, beside the published values of the mode."""
        mode = self._gains.published
        if mode is None:
            return spread_rows(GROUP, "position", "mm", self.values())
        published, spread = mode.position_mm, self.values()
        met = agrees(spread.rms, published[0], POSITION_SHARE) if self._gains.is_source else None
        return spread_rows(GROUP, "position", "mm", spread, published, met)

    def figures(self) -> list[Figure]:
        """Plot of the tip's distances from reference and command against time."""
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
        layout = {"xaxis": time_axis(), "yaxis": {"title": {"text": "tracking error [mm]"}, "rangemode": "tozero"}}
        return [Figure("Tracking error", sentence, traces, layout, 340)]
