"""Metrics: one of a user stands beside ours, and wrong ones are refused by name."""

import ast
import inspect
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from rich.console import Console

from present import present
from recipes import terminal
from teleop_core import evaluation
from teleop_core.bags.reader import Bag, Series
from teleop_core.bags.writer import BagWriter
from teleop_core.base.errors import EvaluationError, PartError, UnknownNameError
from teleop_core.evaluation import METRICS, Context, Key, Metric, Moments, Spread, TableRow, Window, evaluate
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.evaluation.figure import Figure, line, time_axis
from teleop_core.evaluation.metrics.clutches import ClutchesMetric
from teleop_core.evaluation.metrics.economy import EconomyMetric
from teleop_core.evaluation.metrics.looks import LooksMetric
from teleop_core.evaluation.metrics.steps import StepsMetric
from teleop_core.evaluation.score_table import score_tables
from teleop_core.graph.signals import TICK_NS
from teleop_core.graph.topics import (
    ALL,
    MASTER_MEASURED_CF,
    SLAVE_MEASURED_CP,
    SLAVE_MEASURED_JS,
    SLAVE_SERVO_CP,
    SLAVE_SETPOINT_CP,
    TASK_STATE,
    TELEOP_STATE,
    Topic,
)
from teleop_core.kernels.geometry import Array

JOINTS = ("joint_1", "joint_2")
COUNT = 6000  # some windows
JERK = 6.0  # [m/s³], of the path x = t³
# Third differences of positions up to 216 m with 16 digits, at 1 kHz.
ROUNDING = 1e-3


class JerkMetric(Metric):
    """Jerk of the slave's tip along x, and where it was."""

    name = "jerk"
    keys = (
        Key("jerk.rms|max", "m/s³", "jerk of slave/measured_cp along x"),
        Key("jerk.samples", "1", "from so many samples"),
    )
    topics: ClassVar[tuple[Topic, ...]] = (SLAVE_MEASURED_CP,)

    def __init__(self, context: Context) -> None:
        self._jerk, self._begin_ns = Moments(), context.bag.start_ns
        self._last = np.empty(0)

    def add(self, window: Window) -> None:
        samples = window.samples(SLAVE_MEASURED_CP)
        x = np.concatenate((self._last, samples.values[:, 0]))
        self._jerk.add(np.diff(x, 3) / (TICK_NS * 1e-9) ** 3)
        self._last = x[-3:]

    def values(self) -> dict[str, object]:
        spread = self._jerk.spread()
        return {"rms": spread.rms, "max": spread.max, "samples": np.int64(self._jerk.count)}

    def figures(self) -> list[Figure]:
        x, y = np.arange(2.0), np.zeros(2)
        trace = line(x, y, "jerk", "#000000", 1.0, "m/s³")
        return [Figure("Jerk <along> x", "A plot of a user.", [trace], {"xaxis": time_axis()})]


@pytest.fixture
def added() -> Iterator[Callable[[str, object], None]]:
    """Add metrics for the time of one test."""
    names = []

    def add(name: str, part: object) -> None:
        METRICS.add(name, part)
        names.append(name)

    yield add
    for name in names:
        METRICS.remove(name)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a tip on x = t³ [m], its reference 1 mm beside it."""
    out = tmp_path_factory.mktemp("bags") / "cubic"
    stamps = np.arange(1, COUNT + 1) * TICK_NS
    poses = np.tile([0.0, 0, 0, 1, 0, 0, 0], (COUNT, 1))
    poses[:, 0] = (np.arange(COUNT) * 1e-3) ** 3
    beside = poses + np.array([0, 1e-3, 0, 0, 0, 0, 0])
    with BagWriter(out, ALL, JOINTS, metadata={"scenario": "cubic"}) as writer:
        for begin in range(0, COUNT, 500):
            part = slice(begin, begin + 500)
            rows = {SLAVE_MEASURED_CP: poses, SLAVE_SETPOINT_CP: beside, SLAVE_SERVO_CP: beside}
            writer.write_block({topic: (stamps[part], values[part], stamps[part]) for topic, values in rows.items()})
    return out


@pytest.fixture
def bag(path: Path) -> Bag:
    return Bag(path)


# -- a metric of a user ----------------------------------------------------------------------------


def test_metric_of_a_user_stands_in_json_table_and_page(
    added: Callable[[str, object], None], path: Path, tmp_path: Path
) -> None:
    added("jerk", JerkMetric)
    shown = terminal()
    scores_file, page = tmp_path / "scores.json", tmp_path / "page.html"
    (score,) = evaluate_bags([path], scores_file, page, shown)
    found = json.loads(scores_file.read_text())[0]
    assert list(found)[-1] == "jerk"
    assert np.isclose(found["jerk"]["rms"], JERK, atol=ROUNDING)
    assert found["jerk"]["samples"] == COUNT - 3
    lines = [text.split() for text in shown.export_text().splitlines()]
    assert ["rms", "m/s³", "6.000"] in lines
    assert ["samples", str(COUNT - 3)] in lines
    assert "Jerk &lt;along&gt; x" in page.read_text()
    assert np.isclose(present(score.value("jerk.rms")), JERK, atol=ROUNDING)


def test_metric_can_be_given_without_registering_it(bag: Bag) -> None:
    score = evaluate(bag, further=[JerkMetric])
    assert np.isclose(present(score.value("jerk.max")), JERK, atol=ROUNDING)
    with pytest.raises(UnknownNameError):
        evaluate(bag).value("jerk.max")


def test_metric_of_a_user_leaves_the_others_as_they_are(bag: Bag) -> None:
    plain, other = evaluate(bag).to_json(), evaluate(bag, further=[JerkMetric]).to_json()
    del other["jerk"]
    assert json.dumps(plain) == json.dumps(other)


def test_recording_without_a_state_has_a_page(path: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    evaluate_bags([path], None, page, Console(quiet=True))
    assert "no fixture was on" in page.read_text()


def test_scores_with_and_without_a_metric_stand_side_by_side(bag: Bag) -> None:
    shown = terminal()
    shown.print(score_tables([evaluate(bag), evaluate(bag, further=[JerkMetric])], 80)[0])
    (row,) = [text for text in shown.export_text().splitlines() if "rms m/s³" in text]
    assert row.split()[2:] == ["–", "6.000"]


def test_metric_gets_each_sample_once_and_shares_what_others_compute(bag: Bag) -> None:
    seen = []

    class Count(Metric):
        name = "count"

        def add(self, window: Window) -> None:
            found = evaluation.tracked(window)
            assert evaluation.tracked(window) is found
            seen.extend(found.log_ns.tolist())

        def values(self) -> dict[str, object]:
            return {}

    evaluate(bag, further=[Count])
    assert seen == list(range(TICK_NS, (COUNT + 1) * TICK_NS, TICK_NS))


def test_topic_that_was_not_recorded_has_no_samples(bag: Bag) -> None:
    class Force(JerkMetric):
        topics = (MASTER_MEASURED_CF, SLAVE_MEASURED_JS)

        def add(self, window: Window) -> None:
            assert not len(window.samples(MASTER_MEASURED_CF))
            assert window.samples(MASTER_MEASURED_CF).values.shape == (0, 6)
            assert not len(window.states(MASTER_MEASURED_CF).rows)

    assert evaluate(bag, further=[Force]).value("jerk.max") is None


# -- values ----------------------------------------------------------------------------------------


def test_every_number_of_a_score_has_its_key(bag: Bag) -> None:
    score = evaluate(bag)
    assert score.value("position_error_mm.rms") == score.position_error_mm.rms
    assert score.value("session.duration_s") == score.session.duration_s
    assert score.value("topics.slave/measured_cp.count") == COUNT
    assert score.value("fixture.penetration_max_mm") is None
    assert score.record("command_error_mm", Spread) is score.command_error_mm


def test_unknown_key_is_told_with_the_alternatives_nearby(bag: Bag) -> None:
    score = evaluate(bag)
    with pytest.raises(UnknownNameError) as caught:
        score.value("position_error_mm.mean")
    assert caught.value.alternatives == tuple(f"position_error_mm.{n}" for n in ("rms", "sd", "max"))
    with pytest.raises(UnknownNameError, match=r"in all"):
        score.value("jerk.rms")
    with pytest.raises(EvaluationError, match="of cubic is 'cubic', must be a number"):
        score.value("session.name")
    with pytest.raises(EvaluationError, match="gives a Spread, must be a dict"):
        score.record("force_n", dict)
    with pytest.raises(UnknownNameError, match=r"metric is 'jerk', must be one of: .*in all"):
        score.record("jerk", dict)


def test_attribute_that_a_score_has_not_leads_to_its_values(bag: Bag) -> None:
    score = evaluate(bag)
    with pytest.raises(AttributeError, match=r"'jerk' .*score\.value\('jerk\.rms'\)"):
        score.jerk  # noqa: B018
    assert not hasattr(score, "jerk")


def test_score_tells_what_it_is_in_three_lines_and_as_a_table(bag: Bag) -> None:
    score = evaluate(bag)
    first, verdict, second = repr(score).splitlines()
    assert verdict == score.verdict.text
    assert "cubic" in first
    assert "6.0 s" in first
    assert second == "position error 1.000 mm RMS, 1.000 mm at most"
    table = score._repr_html_()
    assert table.startswith("<table>")
    assert "<td>position, RMS</td><td>1.000</td><td>mm</td>" in table


# -- wrong metrics ---------------------------------------------------------------------------------


def changed(**entries: str | Sequence[str | Key | Topic] | Callable[..., object]) -> type[JerkMetric]:
    """The jerk metric with something else in it."""
    return type("Changed", (JerkMetric,), entries)


KEYS = JerkMetric.keys
WRONG = {
    "no metric": (object(), "a class below"),
    "an object": (JerkMetric.__new__(JerkMetric), "a class below"),
    "no add": (type("NoAdd", (Metric,), {"name": "jerk", "values": dict}), "lacks add"),
    "no values": (changed(values=Metric.values), "lacks values"),
    "other name": (changed(name="snap"), "'snap'"),
    "add of two": (changed(add=lambda self, window, more: None), r"add\(self, window\)"),
    "made of nothing": (changed(__init__=lambda self: None), r"__init__\(self, context\)"),
    "rows no method": (changed(rows=[]), r"rows\(self\)"),
    "keys no tuple": (changed(keys=list(KEYS)), "tuple of Key"),
    "key no Key": (changed(keys=("jerk.rms",)), "Key\\(path, unit, meaning\\), not 'jerk.rms'"),
    "key without unit": (changed(keys=(Key("jerk.rms", "", "x"),)), "unit"),
    "key of others": (changed(keys=(Key("ticks.late", "1", "x"),)), "begin with 'jerk.'"),
    "key twice": (changed(keys=(*KEYS, Key("jerk.max", "m", "x"))), "has 'jerk.max' twice"),
    "topic a text": (changed(topics=("slave/measured_cp",)), "tuple of streams"),
    "topic of reports": (changed(topics=(TELEOP_STATE,)), "tuple of streams"),
}


@pytest.mark.parametrize(("part", "told"), WRONG.values(), ids=WRONG)
def test_wrong_metric_is_refused_before_anything_runs(
    added: Callable[[str, object], None], part: object, told: str
) -> None:
    with pytest.raises(PartError, match=told) as caught:
        added("jerk", part)
    assert (caught.value.kind, caught.value.name) == ("metric", "jerk")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["session", "a.b", ""])
def test_name_that_json_cannot_hold_is_refused(added: Callable[[str, object], None], name: str) -> None:
    with pytest.raises(PartError, match=r"without dots|named with letters"):
        added(name, changed(name=name, keys=()))


def test_name_of_another_metric_is_refused(added: Callable[[str, object], None], bag: Bag) -> None:
    with pytest.raises(PartError, match="used already"):
        added("ticks", changed(name="ticks", keys=()))
    with pytest.raises(PartError, match="used already"):
        evaluate(bag, further=[JerkMetric, JerkMetric])


def fail(self: object, *arguments: Context | Window) -> None:
    raise ZeroDivisionError("by\nzero")


@pytest.mark.parametrize("method", ["__init__", "add", "values", "rows"])
def test_metric_that_raises_is_named_in_one_line(bag: Bag, method: str) -> None:
    part = changed(**{method: fail})
    with pytest.raises(EvaluationError, match="'jerk' failed with ZeroDivisionError: by zero"):
        evaluate(bag, further=[part])


def test_metric_that_cannot_draw_is_named(added: Callable[[str, object], None], path: Path, tmp_path: Path) -> None:
    added("jerk", changed(figures=fail))
    with pytest.raises(EvaluationError, match="'jerk' failed with ZeroDivisionError"):
        evaluate_bags([path], None, tmp_path / "page.html", Console(quiet=True))
    assert not (tmp_path / "page.html").exists()


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ({"values": lambda self: {"rms": 1.0, "max": 2.0}}, "lacks jerk.samples"),
        ({"values": lambda self: {"rms": 1.0, "mean": 2.0}}, "gives jerk.mean"),
        ({"rows": lambda self: ["rms"]}, r"rows\(\) is a list of TableRow"),
        ({"rows": lambda self: TableRow("a", "b", "c", "d")}, r"rows\(\) is a list of TableRow"),
    ],
)
def test_metric_that_does_not_keep_its_word_is_refused(
    bag: Bag, entries: dict[str, Callable[..., object]], told: str
) -> None:
    with pytest.raises(PartError, match=told):
        evaluate(bag, further=[changed(**entries)])


def test_value_that_json_cannot_hold_is_refused(bag: Bag) -> None:
    part = changed(values=lambda self: {"rms": np.zeros(3), "max": 0.0, "samples": 0})
    with pytest.raises(EvaluationError, match="rms is a ndarray, must be a number"):
        evaluate(bag, further=[part])


def test_accumulator_that_is_asked_for_too_late_is_refused(bag: Bag) -> None:
    class Late:
        def __init__(self, context: Any) -> None:
            pass

        def add(self, window: Array | str) -> None:
            pass

    class LateMetric(JerkMetric):
        def __init__(self, context: Context) -> None:
            super().__init__(context)
            self._context = context

        def values(self) -> dict[Any, Any]:
            return {"rms": self._context.shared(Late)}  # type: ignore[type-var]

    with pytest.raises(EvaluationError, match="Late is requested too late"):
        evaluate(bag, further=[LateMetric])


def test_part_that_two_metrics_share_gets_every_window_once(bag: Bag) -> None:
    counts = []

    class Windows:
        def __init__(self, context: Context) -> None:
            self.count = 0

        def add(self, window: Window) -> None:
            self.count += 1

    def metric(name: str) -> type[Metric]:
        class Sharing(Metric):
            keys = (Key(f"{name}.windows", "1", "windows"),)

            def __init__(self, context: Context) -> None:
                self._windows = context.shared(Windows)
                self._own = 0

            def add(self, window: Window) -> None:
                self._own += 1
                assert self._own == self._windows.count  # it takes a window before its users

            def values(self) -> dict[str, int]:
                counts.append(self._own)
                return {"windows": self._windows.count}

        Sharing.name = name
        return Sharing

    score = evaluate(bag, further=[metric("one"), metric("two")])
    assert score.value("one.windows") == score.value("two.windows") == max(counts) > 1


def scored(metric: type[Metric], **series: tuple[Array, Array]) -> dict[str, Any]:
    """Values of a metric over times [s] and rows of topics, taken in windows of a second."""
    one = metric(None)  # type: ignore[arg-type]
    kept = {}
    for name, (times, rows) in series.items():
        stamps = np.round(1e9 * (1.0 + times)).astype(np.int64)
        kept[name.replace("__", "/")] = Series(stamps, stamps, rows, (), "")
    for second in range(60):
        one.add(Window(second * 1_000_000_000, (second + 1) * 1_000_000_000, kept))
    return dict(one.values())  # type: ignore[arg-type]


def test_looks_are_counted_where_the_hand_moves_on_after_a_rest_of_the_eye() -> None:
    times = np.arange(0.0, 20.0, 0.002)
    rests = {0.5: True, 0.2: True, 0.06: False}
    for rest, is_look in rests.items():
        place = np.zeros((len(times), 7))
        place[:, 0] = 0.01 * (times // (0.4 + rest) + np.minimum(times % (0.4 + rest) / 0.4, 1.0))
        count = scored(LooksMetric, master__measured_cp=(times, place))["count"]
        assert count == pytest.approx(20.0 / (0.4 + rest) if is_look else 0.0, abs=1.5)


def test_a_clutch_is_counted_each_time_that_it_is_pressed_and_as_long_as_it_is_down() -> None:
    times = np.arange(0.0, 10.0, 0.001)
    down = np.column_stack([(times % 2.0 < 0.5).astype(float), *[np.zeros(len(times))] * 2])
    found = scored(ClutchesMetric, master__buttons=(times, down))
    assert found == {"count": 4, "share": pytest.approx(0.25, abs=1e-3)}  # it is down at the beginning already


def test_economy_is_one_on_straight_ways_and_half_on_a_way_twice_as_long() -> None:
    times = np.arange(0.0, 10.0, 0.002)
    told = np.zeros((2, len(TASK_STATE.columns)))
    told[1, [TASK_STATE.columns.index("attempts"), TASK_STATE.columns.index("way")]] = 1.0, 0.1
    for detour, share in ((0.0, 1.0), (0.1, 0.5)):
        tip = np.zeros((len(times), 7))
        tip[:, 0] = 0.01 * times
        tip[:, 1] = 0.5 * detour * (1.0 - np.abs(times / 5.0 - 1.0)) * np.sqrt(3.0)
        found = scored(EconomyMetric, slave__true_cp=(times, tip), task__state=(np.array([0.0, 9.9]), told))
        expected = share if detour == 0.0 else 0.1 / found["path_mm"] * 1e3
        assert found["share"] == pytest.approx(expected, abs=0.02)
        assert found["path_mm"] == pytest.approx(100.0 / share, rel=0.02)


_SHORT = (
    "looks", "clutches", "economy", "waits", "force_peaks", "task", "throughput", "misses", "step_s",
    "jaw", "jaw_delay", "transfer", "insertion",
)  # fmt: skip


@pytest.mark.parametrize("name", _SHORT)
def test_a_measure_takes_fifteen_lines_beside_its_docstrings(name: str) -> None:
    source = inspect.getsource(METRICS.find(name))
    module = ast.parse(source)
    for node in ast.walk(module):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            node.body = node.body[1:] if ast.get_docstring(node) else node.body
    text = {line for node in ast.walk(module) if isinstance(node, ast.stmt | ast.expr) for line in (node.lineno,)}
    assert len(text) <= 15


def test_a_step_has_the_mean_time_of_its_completed_runs_and_none_if_never_completed() -> None:
    step = TASK_STATE.columns.index("step")
    begins = [(0.0, 1), (1.0, 2), (3.0, 1), (4.5, 2), (8.5, 1)]  # reach, grasp, reach, grasp; the last is cut off
    times = np.arange(0.0, 10.0, 0.5)
    told = np.zeros((len(times), len(TASK_STATE.columns)))
    for begin, number in begins:
        told[times >= begin, step] = number
    found = scored(StepsMetric, task__state=(times, told))
    assert found["reach"] == pytest.approx((1.0 + 1.5) / 2.0, abs=1e-6)
    assert found["grasp"] == pytest.approx((2.0 + 4.0) / 2.0, abs=1e-6)
    assert all(found[name] is None for name in ("lift", "meet", "take", "release", "retreat", "carry", "place"))
