"""Orientation error: angles between the slave's tip and its reference, and between the tip and its command."""

from dataclasses import dataclass

from teleop_core.evaluation import TRACKED, Context, Moments, Spread, Window, figure, tracked
from teleop_core.evaluation.metric import SPREAD_MEANING, Key, Metric
from teleop_core.evaluation.metrics.position_error import COMMAND_GROUP, GROUP
from teleop_core.evaluation.published import ANGLE_FACTOR, Gains, agrees_by_factor
from teleop_core.evaluation.rows import TableRow, error_rows, number, spread_rows
from teleop_core.evaluation.tracking import ErrorTrace, PoseErrors

TURNS = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class OrientationError:
    """Spread of the orientation errors, [deg].

    Attributes:
        roll: Spread of the difference of the fixed angles about x; None near pitch ±90°.
        pitch: Spread of the difference about y.
        yaw: Spread of the difference about z; None near pitch ±90°.
        angle: Spread of the angle of the single rotation between both orientations.
        degenerate_share: Share of samples with pitch near ±90°, 0 to 1.
    """

    roll: Spread
    pitch: Spread
    yaw: Spread
    angle: Spread
    degenerate_share: float | None


class _Orientation:
    """Accumulator of an :class:`OrientationError`."""

    def __init__(self) -> None:
        self._angle = Moments()
        self._turns = [Moments() for _ in TURNS]
        self._degenerate = 0

    def add(self, errors: PoseErrors) -> None:
        """Add the errors of N poses."""
        self._angle.add(errors.angle_deg)
        self._degenerate += int(errors.is_degenerate.sum())
        for moments, column in zip(self._turns, errors.roll_pitch_yaw_deg.T, strict=True):
            moments.add(column)

    def error(self) -> OrientationError:
        """Spread of all angles so far."""
        count = self._angle.count
        share = self._degenerate / count if count else None
        roll, pitch, yaw = (moments.spread() for moments in self._turns)
        return OrientationError(roll, pitch, yaw, self._angle.spread(), share)


class OrientationErrorMetric(Metric):
    """Orientation errors relative to the reference of the same tick."""

    name = "orientation_error_deg"
    keys = (
        Key("orientation_error_deg.roll|pitch|yaw.rms|sd|max", "deg",
            "difference of the fixed angles of slave/measured_cp and slave/setpoint_cp of the "
            f"same tick, wrapped to ±180: {SPREAD_MEANING}"),
        Key("orientation_error_deg.angle.rms|sd|max", "deg",
            "angle of the single rotation from slave/setpoint_cp to slave/measured_cp of the same tick: "
            f"{SPREAD_MEANING}"),
        Key("orientation_error_deg.degenerate_share", "1",
            "share of samples whose pitch is within 1° of ±90°; they do not count for roll and yaw"),
    )  # fmt: skip
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        self._error, self._gains = _Orientation(), context.shared(Gains)
        self._trace = context.shared(ErrorTrace)

    def add(self, window: Window) -> None:
        """Process one window."""
        self._error.add(tracked(window).against)

    def values(self) -> OrientationError:
        """Spread so far, [deg]."""
        return self._error.error()

    def rows(self) -> list[TableRow]:
        """Rows of the spreads, beside the published values of the mode."""
        error, mode, group = self.values(), self._gains.published, GROUP
        published = (mode.roll_deg, mode.pitch_deg, mode.yaw_deg) if mode else (None, None, None)
        is_judged = mode is not None and self._gains.is_source
        spreads = (error.roll, error.pitch, error.yaw)
        rows = []
        for turn, spread, figures in zip(TURNS, spreads, published, strict=True):
            met = None
            if is_judged and figures is not None:
                met = agrees_by_factor(spread.rms, figures[0], ANGLE_FACTOR)
            rows += spread_rows(group, turn, "deg", spread, figures, met)
        return rows + spread_rows(group, "rotation", "deg", error.angle)

    def figures(self) -> list[figure.Figure]:
        """Plots of the errors of roll, pitch and yaw relative to the reference, against time."""
        times, values = self._trace.envelope.line()
        traces = [
            {
                **figure.line(times, values[:, 2 + row], name, color, 1.2, "deg"),
                "yaxis": f"y{figure.axis_suffix(row)}",
                "showlegend": False,
            }
            for row, (name, color) in enumerate(zip(TURNS, (figure.FIRST, figure.SECOND, figure.THIRD), strict=True))
        ]
        layout = figure.stacked_axes(TURNS, "deg") | {"hovermode": "x unified"}
        return [figure.Figure("Orientation error", _sentence(self.values()), traces, layout, 480)]


def _sentence(error: OrientationError) -> str:
    turns = (error.roll, error.pitch, error.yaw)
    largest = max((turn.max for turn in turns if turn.max is not None), default=None)
    sentence = (
        f"No angle is off by more than {number(largest)} deg; the rotation as "
        f"a whole by {number(error.angle.rms)} deg RMS, {number(error.angle.max)} deg at most."
    )
    if error.degenerate_share:
        share = 100.0 * error.degenerate_share
        sentence += f" For {share:.1f} % of the time pitch is near ±90°: no roll, no yaw there."
    return sentence


class CommandOrientationErrorMetric(Metric):
    """Orientation errors relative to the newest command."""

    name = "command_orientation_error_deg"
    keys = (
        Key(
            "command_orientation_error_deg.roll|pitch|yaw.rms|sd|max",
            "deg",
            "difference of the fixed angles of slave/measured_cp and the latest slave/servo_cp at "
            f"its stamp: {SPREAD_MEANING}",
        ),
        Key(
            "command_orientation_error_deg.angle.rms|sd|max",
            "deg",
            f"angle of the single rotation from the latest slave/servo_cp to slave/measured_cp: {SPREAD_MEANING}",
        ),
        Key(
            "command_orientation_error_deg.degenerate_share",
            "1",
            "share of samples whose commanded or measured pitch is within 1° of ±90°; they do not "
            "count for roll and yaw",
        ),
    )
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        self._error = _Orientation()

    def add(self, window: Window) -> None:
        """Process one window."""
        self._error.add(tracked(window).behind)

    def values(self) -> OrientationError:
        """Spread so far, [deg]."""
        return self._error.error()

    def rows(self) -> list[TableRow]:
        """Root mean square and maximum of the angle of the single rotation."""
        return error_rows(COMMAND_GROUP, "rotation", "deg", self.values().angle)
