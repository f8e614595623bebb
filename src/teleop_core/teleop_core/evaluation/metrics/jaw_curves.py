"""Curves of the jaw: its angle and the push of its fingers against time."""

from teleop_core.evaluation import Context, Envelope, Metric, Window, number
from teleop_core.evaluation.figure import COMMAND, DARK, MEASURED, Figure, line, time_axis
from teleop_core.evaluation.metrics.jaw import JawMetric
from teleop_core.graph.topics import SLAVE_JAW_GRIP, SLAVE_JAW_MEASURED_JS, SLAVE_JAW_SERVO_JP

_CURVES = {
    SLAVE_JAW_SERVO_JP: ("angle asked for", COMMAND, "rad"),
    SLAVE_JAW_MEASURED_JS: ("angle measured", MEASURED, "rad"),
    SLAVE_JAW_GRIP: ("push of each finger", DARK, "N"),
}


class JawCurvesMetric(Metric):
    """Draws angle and force of the jaw; this metric has no values."""

    name, topics = "jaw_curves", tuple(_CURVES)

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        bag = context.bag
        self._score = context.shared(JawMetric)
        self._drawn = {topic: Envelope(bag.start_ns, bag.end_ns, columns=1) for topic in _CURVES}

    def add(self, window: Window) -> None:
        """Process one window."""
        for topic, envelope in self._drawn.items():
            found = window.samples(topic)
            envelope.add(found.log_ns, found.values[:, :1])

    def figures(self) -> list[Figure]:
        """Plot of angle and force against time; no plot without a jaw."""
        score = self._score
        if score.grips is None:
            return []
        traces = []
        for topic, envelope in self._drawn.items():
            name, color, unit = _CURVES[topic]
            times, values = envelope.line()
            traces.append(line(times, values[:, 0], name, color, 1.4, unit))
        traces[-1]["yaxis"] = "y2"
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
