"""Motion: how hand and slave move: speed, spectrum, smoothness, submovements, tremor, strokes."""

from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np

from teleop_core.base import TeleopError, build
from teleop_core.evaluation import Context, Key, Metric, TableRow, Window, keys_of, number, row
from teleop_core.evaluation.figure import DARK, MEASURED, Figure, line, time_axis
from teleop_core.evaluation.motion_figures import Kinematics, Mask, MotionFigures
from teleop_core.evaluation.motion_measures import RATE
from teleop_core.evaluation.motion_samples import MotionSamples
from teleop_core.evaluation.state_history import States
from teleop_core.graph import STATE
from teleop_core.graph.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_CP, Topic
from teleop_core.hand.operators import OPERATORS
from teleop_core.hand.operators.behaviour import OperatorParameters


def approach_end_ns(context: Context) -> int:
    """Time at which the approach ends [ns].

    The approach begins when teleop/state first reports that the slave follows; its duration is in the stored
    configuration. Recordings of other writers have no approach; the function then returns the start of the recording.
    """
    history, start_ns = context.history, context.bag.start_ns
    begin_ns = start_ns
    follows = history.stamp_ns[history.rows[:, STATE["is_following"]] > 0.0]
    if len(follows):
        begin_ns = max(start_ns, int(follows[0]))
    return begin_ns + round(approach_time(context) * 1e9)


def approach_time(context: Context) -> float:
    """Duration of the operator's approach to the centre of its motion [s]; 0 if unknown."""
    values = context.origin.operator
    try:
        common = build(OperatorParameters, values, "operator.")
        operator = OPERATORS.find(common.kind.kind)
    except TeleopError:
        return 0.0
    # An operator that replays a recorded motion approaches only if the motion was moved to a centre.
    is_moved = operator.length is not None and any(common.center)
    return common.approach_time if values and (operator.approaches or is_moved) else 0.0


_SEGMENT_NAMES = ("time_s", "path_mm", "speed_median_mm_s", "speed_p95_mm_s", "idle_share",
                  "submovements", "reversals", "sparc", "ldlj")  # fmt: skip
_OF_SEGMENTS = [found for found in fields(MotionFigures) if found.name in _SEGMENT_NAMES]
_SHORTEST_S = 0.5
HAND, SLAVE = "motion of the hand", "motion of the slave"
SEGMENTS, FIXTURE = "between clutch strokes", "hand with the fixture on"


@dataclass(frozen=True)
class Clutch:
    """Number of clutch strokes, and the time for which the clutch was pressed [s]."""

    count: int
    time_s: float


@dataclass(frozen=True)
class MotionScore:
    """Results of :class:`MotionMetric`.

    Attributes:
        hand: Motion of the master's tip.
        slave: Motion of the slave's tip.
        in_fixture: Motion of the master's tip while a fixture was on.
        clutch: Strokes of the clutch.
        segments: Motion of the hand between clutch strokes, by number from 1. Each segment contains ``begin_s`` and
            ``end_s`` since the start of the recording, and the values of the motion.
        segment_median: ``count``, and the median of each value over the segments.
    """

    hand: MotionFigures
    slave: MotionFigures
    in_fixture: MotionFigures
    clutch: Clutch
    segments: dict[str, dict[str, float | None]]
    segment_median: dict[str, float | None]


class MotionMetric(Metric):
    """Values that describe the motion of hand and slave after the approach.

    If a span is scored, the whole span counts, including the approach.
    """

    name = "motion"
    keys = (
        *keys_of("motion.hand|slave|in_fixture", MotionFigures),
        Key("motion.clutch.count", "1", "number of clutch strokes"),
        Key("motion.clutch.time_s", "s", "time with the clutch pressed"),
        Key(
            "motion.segments.<number>.begin_s|end_s",
            "s",
            "segment of the hand's motion between two clutch strokes, if it lasts 0.5 s or more: its "
            "begin and end since the start of the recording",
        ),
        *keys_of("motion.segments.<number>", _OF_SEGMENTS, "of a segment: "),
        Key("motion.segment_median.count", "1", "number of segments"),
        *keys_of("motion.segment_median", _OF_SEGMENTS, "median of the segments: "),
    )
    topics = (MASTER_MEASURED_CP, SLAVE_MEASURED_CP)

    def __init__(self, context: Context) -> None:
        self._context = context
        begin_ns = approach_end_ns(context) if context.span is None else context.span.first_ns
        self._begin_s = (begin_ns - context.bag.start_ns) * 1e-9
        self._streams = {topic: _Stream(topic, context.bag.start_ns) for topic in self.topics}
        self._found: dict[Topic, Kinematics] = {}
        self._score: MotionScore | None = None

    def add(self, window: Window) -> None:
        """Process one window."""
        self._score = None
        self._found.clear()
        for stream in self._streams.values():
            stream.add(window)

    def _kinematics(self, topic: Topic) -> tuple[Kinematics, Mask]:
        """Velocities of a tip, and a mask of the samples that count."""
        if topic not in self._found:
            self._found[topic] = Kinematics(self._streams[topic].samples)
        found = self._found[topic]
        return found, found.times >= self._begin_s

    def _states(self, found: Kinematics) -> States:
        stamps = np.round(found.times * 1e9).astype(np.int64) + self._context.bag.start_ns
        return self._context.history.at(stamps)

    def values(self) -> MotionScore:
        """Values of the whole motion, of the time with the fixture on, and between clutch strokes."""
        self._score = self._score or self._scored()
        return self._score

    def _scored(self) -> MotionScore:
        hand, counts = self._kinematics(MASTER_MEASURED_CP)
        slave, slave_counts = self._kinematics(SLAVE_MEASURED_CP)
        states = self._states(hand)
        is_clutched = counts & (states.column("is_clutched") > 0.0)
        segments = _segments(hand, counts & ~is_clutched)
        return MotionScore(
            hand=hand.figures(counts),
            slave=slave.figures(slave_counts),
            in_fixture=hand.figures(counts & states.is_fixture_on),
            clutch=Clutch(_strokes(is_clutched), float(is_clutched.sum() / RATE)),
            segments=segments,
            segment_median=_medians(segments),
        )

    def rows(self) -> list[TableRow]:
        """Rows of tables."""
        found = self.values()
        hand, fixture, middle = found.hand, found.in_fixture, found.segment_median
        has_fixture = fixture.time_s > 0.0
        return [
            *_hand_rows(hand),
            TableRow(HAND, "clutch strokes", "", str(found.clutch.count)),
            row(HAND, "time clutched", "s", found.clutch.time_s),
            TableRow(SEGMENTS, "segments", "", f"{middle['count']:.0f}"),
            row(SEGMENTS, "time", "s", middle["time_s"]),
            row(SEGMENTS, "path", "mm", middle["path_mm"]),
            row(SEGMENTS, "smoothness SPARC", "", middle["sparc"]),
            row(FIXTURE, "time", "s", fixture.time_s if has_fixture else None),
            row(FIXTURE, "speed, median", "mm/s", fixture.speed_median_mm_s),
            row(FIXTURE, "smoothness SPARC", "", fixture.sparc),
            row(SLAVE, "path", "mm", found.slave.path_mm),
            row(SLAVE, "speed, median", "mm/s", found.slave.speed_median_mm_s),
            row(SLAVE, "speed, 95 %", "mm/s", found.slave.speed_p95_mm_s),
            row(SLAVE, "smoothness SPARC", "", found.slave.sparc),
            row(SLAVE, "tremor, 8–12 Hz", "µm", found.slave.tremor_um),
        ]

    def figures(self) -> list[Figure]:
        """Plots of speed against time, and of the spectrum of velocity."""
        score = self.values()
        return [self._speed_figure(score.hand), self._spectrum_figure(score.hand)]

    def _speed_figure(self, hand: MotionFigures) -> Figure:
        traces = []
        for topic, name, color in _DRAWN:
            found, _ = self._kinematics(topic)
            traces.append(line(found.times, found.speed * 1e3, name, color, 1.2, "mm/s"))
        sentence = (
            f"The hand moves at {number(hand.speed_median_mm_s)} mm/s in the median and rests for "
            f"{_percent(hand.idle_share)} % of the time (below 5 mm/s); it makes "
            f"{number(hand.peaks_per_s)} submovements per second."
        )
        axis = {"title": {"text": "speed [mm/s]"}, "rangemode": "tozero"}
        layout = {"xaxis": time_axis(), "yaxis": axis, "hovermode": "x unified"}
        return Figure("Speed", sentence, traces, layout, 340)

    def _spectrum_figure(self, hand: MotionFigures) -> Figure:
        traces = []
        for topic, name, color in _DRAWN:
            found, counts = self._kinematics(topic)
            frequency, density = found.spectrum(counts)
            shown = density[1:] * 1e6
            traces.append(line(frequency[1:], shown, name, color, 1.6, "mm²/s²/Hz"))
        sentence = (
            f"Half of the power of the hand's velocity lies below "
            f"{number(hand.frequency_50_hz)} Hz, 95 % below {number(hand.frequency_95_hz)} Hz; "
            f"{_percent(hand.power_1_3)} % lie in 1 to 3 Hz."
        )
        layout = {
            "xaxis": {"title": {"text": "frequency [Hz]"}, "type": "log"},
            "yaxis": {"title": {"text": "power of velocity [mm²/s²/Hz]"}, "type": "log", "exponentformat": "power"},
        }
        return Figure("Spectrum of motion", sentence, traces, layout, 340)


_DRAWN = ((MASTER_MEASURED_CP, "hand", DARK), (SLAVE_MEASURED_CP, "slave", MEASURED))


class _Stream:
    """Motion of one tip of a recording, resampled to 30 Hz."""

    def __init__(self, topic: Topic, start_ns: int) -> None:
        self._topic, self._start_ns = topic, start_ns
        self._has_stamps: bool | None = None
        self.samples = MotionSamples()

    def add(self, window: Window) -> None:
        series = window.samples(self._topic)
        if not len(series):
            return
        if self._has_stamps is None:  # other writers may leave stamps empty
            self._has_stamps = bool(0 < series.stamp_ns[0] < series.stamp_ns[-1])
        stamps = series.stamp_ns if self._has_stamps else series.log_ns
        times = np.asarray((stamps - self._start_ns) * 1e-9, np.float64)
        self.samples.add(times, series.values[:, :7])


def _segments(hand: Kinematics, mask: Mask) -> dict[str, dict[str, float | None]]:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    found: dict[str, dict[str, float | None]] = {}
    for begin, end in list(pairwise(edges.tolist()))[::2]:
        if end - begin < _SHORTEST_S * RATE:
            continue
        only = np.zeros(len(mask), np.bool_)
        only[begin:end] = True
        figures = hand.figures(only)
        values: dict[str, float | None] = {"begin_s": float(hand.times[begin]), "end_s": float(hand.times[end - 1])}
        values |= {name: getattr(figures, name) for name in _SEGMENT_NAMES}
        found[str(len(found) + 1)] = values
    return found


def _medians(segments: dict[str, dict[str, float | None]]) -> dict[str, float | None]:
    out: dict[str, float | None] = {"count": len(segments)}
    for name in _SEGMENT_NAMES:
        known = [v for segment in segments.values() if (v := segment[name]) is not None]
        out[name] = float(np.median(known)) if known else None
    return out


def _strokes(mask: Mask) -> int:
    """Number of times a mask changes to True."""
    return int((mask & ~np.concatenate(([False], mask[:-1]))).sum())


def _percent(share: float | None) -> str:
    return number(None if share is None else 100.0 * share)


def _hand_rows(hand: MotionFigures) -> list[TableRow]:
    numbers = (
        ("path", "mm", hand.path_mm),
        ("speed, median", "mm/s", hand.speed_median_mm_s),
        ("speed, 95 %", "mm/s", hand.speed_p95_mm_s),
        ("acceleration, 95 %", "m/s²", hand.acceleration_p95_m_s2),
        ("half of power below", "Hz", hand.frequency_50_hz),
        ("95 % of power below", "Hz", hand.frequency_95_hz),
    )
    shares = (("power in 1–3 Hz", hand.power_1_3), ("time below 5 mm/s", hand.idle_share))
    return [
        *(row(HAND, label, unit, value) for label, unit, value in numbers),
        *(TableRow(HAND, label, "%", _percent(value)) for label, value in shares),
        row(HAND, "submovements", "1/s", hand.peaks_per_s),
        TableRow(HAND, "reversals", "", str(hand.reversals)),
        row(HAND, "smoothness SPARC", "", hand.sparc),
        row(HAND, "smoothness LDLJ", "", hand.ldlj),
        row(HAND, "tremor, 8–12 Hz", "µm", hand.tremor_um),
        row(HAND, "tremor at rest", "µm", hand.tremor_at_rest_um),
    ]
