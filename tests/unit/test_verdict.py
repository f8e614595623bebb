"""The verdict on a session: one line, the worst first, the same wherever a score is shown."""

import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import teleop_core as tc
from teleop_core.bags.memory import MemoryBag
from teleop_core.bags.reports import report
from teleop_core.bags.series import Series
from teleop_core.base import NoParameters, Registry
from teleop_core.base.errors import EvaluationError
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.evaluation.rows import fixed, number
from teleop_core.evaluation.verdict import verdict_of
from teleop_core.graph import STAGES, Stage, register_stage, topics
from teleop_core.robots import ROBOTS, load_robot, register_robot
from teleop_core.shapes import SHAPES, register_shape, sphere
from teleop_core.slave.controllers import CONTROLLERS, register_controller
from teleop_core.slave.controllers.source_pid import SOURCE_PID

FINE = {
    "reach.followed_share": 0.999, "asked_error_mm.max": 6.0, "command_error_mm.max": 5.5,
    "position_error_mm.rms": 0.3, "latency_ms.total.p99": 3.0, "ticks.executed": 10000,
    "ticks.made_up": 0, "ticks.dropped": 0, "topics.slave/servo_cp.count": 9000,
    "topics.slave/servo_cp.gaps": 0,
    "fixture.penetration_max_mm": None, "fixture.kind": "box",
}  # fmt: skip


def ports(*energies: float) -> dict[str, float]:
    """Energies [mJ] in at hand and slave, then out."""
    keys = ("hand.in_mj", "slave.in_mj", "hand.out_mj", "slave.out_mj")
    return {f"passivity.{key}": value for key, value in zip(keys, energies, strict=True)}


def test_a_drift_is_named_before_the_share_that_was_followed() -> None:
    drifted = FINE | {"reach.followed_share": 0.94, "asked_error_mm.max": 67.0, "reach.joint_share": 0.06}
    found = verdict_of(drifted)
    assert found.text == ("largest lag behind the hand 67 mm; followed 94 % of the time (6.0 % at a joint's end)")
    assert found.worst == "asked_error_mm.max"
    assert not found.is_good


@pytest.mark.parametrize(
    ("changes", "worst", "text"),
    [
        ({}, None, "nothing stands out: followed 99.9 % of the time, tracking error 0.3 mm RMS"),
        ({"asked_error_mm.max": 12.0, "command_error_mm.max": 11.0}, None, "nothing"),  # filters
        ({"latency_ms.total.p99": 80.0}, "latency_ms.total.p99", "delay p99 80 ms"),
        ({"latency_ms.total.p99": 103.0, "latency_ms.asked.p99": 100.0}, None, "nothing"),
        (
            {"latency_ms.total.p99": 130.0, "latency_ms.asked.p99": 100.0},
            "latency_ms.total.p99",
            "delay p99 130 ms, hand to setpoint, 100 ms of it asked for",
        ),
        (
            {"gap.longest_s": 0.3, "gap.at_s": 10.0, "ticks.dropped": 300, "reach.followed_share": 0.985},
            "gap.longest_s",
            "the recording has a gap of 0.3 s, at 10 s; ",
        ),
        (
            {"halt.share": 0.3, "halt.at_s": 4.0, "halt.reason": "FAULT: emergency stop", "reach.followed_share": 0.7},
            "halt.share",
            "the arm was stopped for 30 % of the time, from 4 s on: FAULT: emergency stop; followed 70 %",
        ),
        ({"halt.share": 0.009, "halt.at_s": 4.0, "halt.reason": "PAUSED"}, None, "nothing"),
        ({"topics.network/servo_cp.gaps": 1000}, None, "nothing"),  # losses that were asked for
        ({"task.attempts": 5, "task.successes": 0}, "task.successes", "no success in 5 attempts at the task"),
        ({"task.attempts": 5, "task.successes": 1}, None, "nothing"),
        ({"ticks.made_up": 300}, "ticks.made_up", "300 control ticks made up late"),
        ({"ticks.dropped": 300}, "ticks.dropped", "300 control ticks never executed (3 %)"),
        (
            {"topics.slave/servo_cp.gaps": 1000, "topics.slave/servo_cp.lost": 400},
            "topics",
            "1000 messages missing (10 %), 400 of them lost on the way",
        ),
        ({"topics.slave/servo_cp.gaps": 1000}, "topics", "1000 messages missing (10 %)"),
        ({"fixture.penetration_max_mm": 2.5}, "fixture.penetration_max_mm", "fixture penetration"),
        ({"position_error_mm.rms": 4.0}, "position_error_mm.rms", "tracking error 4 mm RMS"),
        (ports(40.0, 3.0, 11.0, 64.0), "passivity.slave.out_mj", "hand and slave gave 75 mJ, 32"),
        (ports(40.0, 3.0, 11.0, 32.5), None, "nothing"),  # what is lent
    ],
)
def test_whatever_is_worst_comes_first(changes: dict[str, float], worst: str | None, text: str) -> None:
    found = verdict_of(FINE | changes)
    assert found.worst == worst
    assert found.text.startswith(text)


def test_an_error_that_encoders_do_not_see_is_named_where_all_else_is_well() -> None:
    assert verdict_of(FINE | {"true_error_mm.rms": 0.31}).text.endswith("error 0.3 mm RMS")
    text = verdict_of(FINE | {"true_error_mm.rms": 5.6}).text
    assert text.endswith("0.3 mm RMS at the encoders and 5.6 mm at the true tip")


def test_every_concern_says_what_it_means_and_what_to_do() -> None:
    wrong = {
        "reach.followed_share": 0.5,
        "asked_error_mm.max": 60.0,
        "position_error_mm.rms": 9.0,
        "latency_ms.total.p99": 80.0,
        "ticks.made_up": 3000,
        "ticks.dropped": 3000,
        "topics.slave/servo_cp.gaps": 900,
        "fixture.penetration_max_mm": 9.0,
        "contact.feeding": 3,
        "task.attempts": 3,
    }
    alone = [verdict_of(FINE | {key: value}) for key, value in wrong.items()]
    found = [*alone, verdict_of(FINE | ports(1.0, 1.0, 9.0, 9.0))]
    assert len({one.worst for one in found}) == len(found)
    assert all(one.advice for one in found)
    assert verdict_of(FINE).advice is None


@pytest.mark.parametrize(
    ("stages", "asked"),
    [
        ([], {"teleop.delays": ["slave/servo_cp@inverse_kinematics=0.1"]}),
        (["network"], {"network.there.least_delay": 0.06, "teleop.delays": ["slave/servo_jp=0.04"]}),
    ],
)
def test_a_delay_that_was_asked_for_is_no_concern(stages: list[str], asked: Any) -> None:
    score = tc.run("coarse_box", duration=4.0, stages=stages, settings=asked).score()
    values = score.to_dict()
    assert values["latency_ms.asked.p99"] == pytest.approx(100.0, abs=1.5)
    assert values["latency_ms.total.p99"] == pytest.approx(100.0, abs=1.5)
    assert "delay" not in score.verdict.text


@pytest.fixture(scope="module")
def drifting(tmp_path_factory: pytest.TempPathFactory) -> tc.Recording:
    """A hand that is too fast for the arm."""
    times = np.linspace(0.0, 4.0, 401)
    way = 0.2 * np.sin(0.25 * np.pi * times) ** 2
    hand = np.column_stack((times, way, 0.0 * times, 0.0 * times))
    path = tmp_path_factory.mktemp("verdict") / "drifting"
    return tc.run(operator=hand, duration=9.0, out=path)


def test_one_line_opens_table_json_page_and_python(drifting: Any, tmp_path: Path) -> None:
    text = drifting.score().verdict.text
    assert text.startswith("followed ")
    shown = io.StringIO()
    console = Console(file=shown, width=100)
    paths = tmp_path / "s.json", tmp_path / "page.html"
    evaluate_bags([drifting.path], *paths, console)
    advice = drifting.score().verdict.advice
    assert shown.getvalue().splitlines()[:2] == [f"drifting: {text}", f"  {advice}"]
    assert json.loads(paths[0].read_text())[0]["verdict"]["text"] == text
    page = paths[1].read_text()
    opening = page[: page.index("<details")]
    assert f'<p class="verdict bad">{text}</p><p class="advice">{advice}</p>' in opening.replace("&#x27;", "'")
    assert opening.count("<dd>") == 5
    assert text in repr(drifting.score())


def test_rows_that_say_nothing_and_figures_nobody_compares_stay_out(drifting: Any, tmp_path: Path) -> None:
    shown = io.StringIO()
    evaluate_bags([drifting.path], None, tmp_path / "page.html", Console(file=shown, width=100))
    for absent in ("0/0/0", " – ", "slave outside", "Vongbunyong", "agrees"):
        assert absent not in shown.getvalue()
    page = (tmp_path / "page.html").read_text()
    table = page[page.index("<details") : page.index("</details>")]
    assert "published" not in table


def test_scores_are_a_row_of_a_data_frame_each(drifting: tc.Recording) -> None:
    score = drifting.score()
    values = score.to_dict()
    assert values["position_error_mm.rms"] == score.position_error_mm.rms
    frame = tc.frame_of([score, score])
    assert len(frame) == 2
    assert frame["reach.followed_share"].tolist() == [score.reach.followed_share] * 2
    assert frame["verdict.text"][0] == score.verdict.text


# Parts of a user's own, without the file that registers them.


def slab() -> dict[str, Any]:
    register_shape(replace(sphere.SPHERE, name="slab"))
    return {"fixture": "slab"}


def law() -> dict[str, Any]:
    register_controller(replace(SOURCE_PID, name="law"))
    return {"controller": "law"}


def mirror() -> dict[str, Any]:
    topic = topics.Topic("test/mirror", topics.Kind.POSE, topics.passed_on("slave/measured_cp"))

    def step(parameters: Any, state: Any, signals: Any, dt: Any) -> None:
        signals["test_mirror"] = signals["slave_measured_cp"]

    register_stage(Stage("mirror", NoParameters, (topics.SLAVE_MEASURED_CP,), (topic,), step=step))
    return {"stages": ["mirror"]}


def arm() -> dict[str, Any]:
    register_robot(load_robot("puma560"), "own_arm")
    return {"robot": "own_arm"}


@pytest.mark.parametrize(
    ("register", "registry", "name", "told"),
    [
        (slab, SHAPES, "slab", "fixture 'slab'"),
        (law, CONTROLLERS, "law", "controller 'law'"),
        (mirror, STAGES, "mirror", "stage 'mirror'"),
        (arm, ROBOTS, "own_arm", "robot 'own_arm'"),
    ],
)
@pytest.mark.usefixtures("own_parts")
@pytest.mark.filterwarnings("ignore:stage 'mirror' writes")
def test_no_verdict_is_green_while_a_part_of_the_recording_is_not_known(
    register: Callable[[], dict[str, Any]], registry: Registry[Any], name: str, told: str
) -> None:
    recording = tc.run(scenario="coarse_box", duration=0.3, **register())
    known = recording.score()
    assert known.session.missing is None
    registry.remove(name)
    found = recording.score().verdict
    assert not found.is_good
    assert found.text.startswith(f"not known here: {told}; give the file that has it: ")
    assert "--parts" in found.text


def test_a_fixture_that_is_not_scored_comes_before_whatever_else_is_wrong() -> None:
    found = verdict_of(FINE | {"position_error_mm.rms": 9.0, "fixture.unscored": "slab: why"})
    assert found.worst == "fixture.unscored"
    assert found.text.startswith("not scored: slab: why; give ")


# Numbers.


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (190292.0951, "190292"), (1000.0, "1000"), (275.889, "275.9"), (24.0671, "24.07"),
        (9.99951, "10.00"), (0.338, "0.338"), (0.0064, "0.0064"), (-0.0, "0.000"),
        (2.4e-14, "0.000"), (-24.0671, "-24.07"), (None, "–"),
    ],
)  # fmt: skip
def test_numbers_have_four_digits_and_no_minus_before_nothing(value: float | None, text: str) -> None:
    assert number(value) == text
    assert fixed(-0.04, 1) == "0.0"


@pytest.fixture(scope="module")
def session() -> MemoryBag:
    bag = tc.run("coarse_box", duration=4.0).bag
    assert isinstance(bag, MemoryBag)
    return bag


def kept(bag: MemoryBag, keep: Callable[[Any], Any], only: str = "") -> MemoryBag:
    """The recording with the messages of some times [s], and of the topics whose names begin with a text."""

    def part(series: Series) -> Series:
        at = keep((series.log_ns - bag.start_ns) * 1e-9)
        return Series(series.stamp_ns[at], series.log_ns[at], series.values[at], series.names, series.frame_id)

    streams = {topic: part(one) for topic, one in bag.streams.items() if topic.name.startswith(only)}
    states = {topics.TELEOP_STATE: bag._reports[topics.TELEOP_STATE.name]}
    return MemoryBag("part", streams, {} if only else states, bag.metadata)


@pytest.mark.parametrize("length", [0.15, 0.4, 1.0])
def test_a_gap_of_the_file_stands_before_what_it_is_blamed_on(session: MemoryBag, length: float) -> None:
    score = tc.Recording(kept(session, lambda time: (time < 2.0) | (time > 2.0 + length))).score()
    assert score.verdict.worst == "gap.longest_s"
    assert score.verdict.text.startswith(f"the recording has a gap of {length:g} s, at 2 s")
    assert tc.Recording(kept(session, lambda time: time >= 0.0)).score().value("gap.longest_s") is None


def test_a_hand_without_a_slave_is_told_so_with_what_to_do(session: MemoryBag) -> None:
    with pytest.raises(EvaluationError, match=r"motion of a hand and no slave.*teleop replay"):
        tc.Recording(kept(session, lambda time: time >= 0.0, "master/")).score()


@pytest.mark.parametrize(("event", "reason"), [("stop@0", "FAULT.*emergency stop")])
def test_an_arm_that_was_stopped_throughout_is_told_with_the_reason(event: str, reason: str) -> None:
    recording = tc.run("coarse_box", duration=1.0, settings={"operation.events": (event,)})
    with pytest.raises(EvaluationError, match=reason):
        recording.score()


def test_an_arm_that_is_stopped_on_the_way_is_told_first_with_time_and_reason() -> None:
    score = tc.run("coarse_box", duration=4.0, settings={"operation.events": ("stop@3",)}).score()
    assert score.verdict.worst == "halt.share"
    assert "from 3 s on: FAULT, homed: emergency stop" in score.verdict.text


def test_an_operation_of_another_writer_without_numbers_is_no_halt(session: MemoryBag) -> None:
    bag = kept(session, lambda time: time >= 0.0)
    told = {"state": "running", "fault": "none"}
    bag._reports[topics.SLAVE_OPERATION.name] = [(bag.start_ns, report(bag.start_ns, "arm", 0, "running", told))]
    assert tc.Recording(bag).score().value("halt.share") == 0.0
