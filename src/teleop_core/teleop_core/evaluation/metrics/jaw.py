"""Jaw: how often it gripped, what slid or fell, how hard it pressed, and how late it was."""

from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation import Context, Envelope, Metric, Window, keys_of, number
from teleop_core.evaluation.figure import COMMAND, DARK, MEASURED, Figure, line, time_axis
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.pairing import mean_wait_s
from teleop_core.graph.topics import SLAVE_JAW_GRIP, SLAVE_JAW_MEASURED_JS, SLAVE_JAW_SERVO_JP

_FORCE, _IS_GRIPPED, _GRIPS, _SLIPS, _DROPS = (
    SLAVE_JAW_GRIP.columns.index(name) for name in ("force", "is_gripped", "grips", "slips", "drops")
)


@dataclass(frozen=True)
class JawScore:
    """What the jaw did with the object; None without a jaw."""

    grips: int | None = figure("1", "how often the jaw closed on the object", "grips")
    slips: int | None = figure("1", "grips in which the object slid by more than 1 mm", "slips")
    drops: int | None = figure("1", "how often it slid out of the jaw above the table", "drops")
    peak_force_n: float | None = figure("N", "largest push of each finger on the object", "push of each finger, max")
    delay_s: float | None = figure(
        "s",
        "mean time from the master's sample that begins to close the jaw to the grip",
        "from the command to the grip",
    )


class JawMetric(Metric):
    """Grips of a simulated jaw, by what its simulator tells."""

    name, group = "jaw", "the jaw"
    keys = keys_of("jaw", JawScore)
    topics = (SLAVE_JAW_GRIP, SLAVE_JAW_SERVO_JP, SLAVE_JAW_MEASURED_JS)

    def __init__(self, context: Context) -> None:
        bag = context.bag
        self._first: np.ndarray | None = None
        self._last = np.zeros(len(SLAVE_JAW_GRIP.columns))
        self._peak = 0.0
        self._angle, self._is_closing = np.nan, False  # of the last command
        self._closings: list[int] = []  # stamps of the commands that begin to close [ns]
        self._begins: list[int] = []  # of grips [ns]
        self._force = Envelope(bag.start_ns, bag.end_ns, columns=1)
        self._asked = Envelope(bag.start_ns, bag.end_ns, columns=1)
        self._measured = Envelope(bag.start_ns, bag.end_ns, columns=1)

    def add(self, window: Window) -> None:
        """Take one window."""
        asked, measured = window.samples(SLAVE_JAW_SERVO_JP), window.samples(SLAVE_JAW_MEASURED_JS)
        self._asked.add(asked.log_ns, asked.values[:, :1])
        self._measured.add(measured.log_ns, measured.values[:, :1])
        if len(asked):
            angles = np.append(self._angle, asked.values[:, 0])
            closes = np.append(self._is_closing, np.diff(angles) < 0.0)
            self._closings += asked.stamp_ns[closes[1:] & ~closes[:-1]].tolist()
            self._angle, self._is_closing = angles[-1], bool(closes[-1])
        grips = window.samples(SLAVE_JAW_GRIP)
        if not len(grips):
            return
        self._first = grips.values[0] if self._first is None else self._first
        is_gripped = np.append(self._last[_IS_GRIPPED], grips.values[:, _IS_GRIPPED])
        self._begins += grips.stamp_ns[np.diff(is_gripped) > 0.0].tolist()
        self._last = grips.values[-1]
        self._peak = max(self._peak, float(grips.values[:, _FORCE].max()))
        self._force.add(grips.log_ns, grips.values[:, :1])

    def values(self) -> JawScore:
        """Score of everything so far."""
        if self._first is None:
            return JawScore(None, None, None, None, None)
        counts = self._last - self._first
        grips, slips, drops = (int(counts[i]) for i in (_GRIPS, _SLIPS, _DROPS))
        return JawScore(grips, slips, drops, self._peak, mean_wait_s(self._closings, self._begins))

    def figures(self) -> list[Figure]:
        """Angle and force against time; none without a jaw."""
        if self._first is None:
            return []
        curves = (
            (self._asked, "angle asked for", COMMAND, "rad"),
            (self._measured, "angle measured", MEASURED, "rad"),
            (self._force, "push of each finger", DARK, "N"),
        )
        traces = []
        for envelope, name, color, unit in curves:
            times, values = envelope.line()
            traces.append(line(times, values[:, 0], name, color, 1.4, unit))
        traces[-1]["yaxis"] = "y2"
        score = self.values()
        sentence = (
            f"The jaw grips {score.grips} times, with {number(score.peak_force_n)} N at most; "
            f"{score.slips} slips, {score.drops} drops."
        )
        layout = {
            "xaxis": time_axis(),
            "yaxis": {"title": {"text": "angle [rad]"}},
            "yaxis2": {"title": {"text": "force [N]"}, "overlaying": "y", "side": "right"},
            "hovermode": "x unified",
        }
        return [Figure("Jaw", sentence, traces, layout, 340)]
