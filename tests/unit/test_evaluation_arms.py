"""Arms: a recording of two arms is scored arm by arm, each as if it had been recorded alone."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from present import present
from recipes import terminal
from teleop_core.bags import arms, reports
from teleop_core.bags.reader import Bag
from teleop_core.bags.writer import BagWriter
from teleop_core.base.errors import EvaluationError, RecordingError, UnknownNameError
from teleop_core.evaluation import evaluate, scores
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.graph.signals import STATE_FIELDS, TICK_NS
from teleop_core.graph.topics import (
    ALL,
    DIAGNOSTICS,
    SLAVE_MEASURED_CP,
    SLAVE_MEASURED_JS,
    SLAVE_SERVO_CP,
    SLAVE_SETPOINT_CP,
    TELEOP_STATE,
    Topic,
)

COUNT = 5000
JOINTS = {"": ("a", "b"), "left": ("c", "d", "e")}
MM = 1e-3
ROUNDING = 1e-9  # [mm], of metres in doubles
METADATA = {
    "arms": "right left",
    "scenario": "pair",
    "robot": "rcrt1",
    "seed": "7",
    "left/robot": "puma560",
    "left/seed": "8",
}


def state(gain: float) -> bytes:
    values = {name: repr(gain if name == "gain" else 0.0) for name in STATE_FIELDS}
    return reports.report(0, "teleop", 0, "FOLLOWING", values)


def write(
    path: Path, offsets: dict[str, float], metadata: dict[str, str] = METADATA, lost: Sequence[Topic] = ()
) -> Path:
    """A recording of arms whose tips are so far [m] from their references."""
    stamps = np.arange(1, COUNT + 1) * TICK_NS
    rest = np.tile([0.4, 0, 0, 1, 0, 0, 0], (COUNT, 1))
    rows = {}
    for arm, offset in offsets.items():
        measured = rest + offset * np.array([1.0, 0, 0, 0, 0, 0, 0])
        joints = np.zeros((COUNT, 3 * len(JOINTS[arm])))
        poses = {SLAVE_SERVO_CP: rest, SLAVE_SETPOINT_CP: rest, SLAVE_MEASURED_CP: measured}
        for topic, values in (poses | {SLAVE_MEASURED_JS: joints}).items():
            rows[topic.of_arm(arm)] = (stamps, values, stamps)
    for topic in lost:
        del rows[topic]
    topics = [topic.of_arm(arm) for arm in offsets for topic in ALL if topic is not DIAGNOSTICS]
    with BagWriter(path, [*topics, DIAGNOSTICS], JOINTS, metadata=metadata) as writer:
        for arm, gain in zip(offsets, (1.0, 0.1), strict=False):
            writer.write(TELEOP_STATE.of_arm(arm), 0, state(gain))
        for name, ticks in (("slave_sim", 1000), ("left/slave_sim", 2000), ("/left/play", 3000)):
            writer.write(DIAGNOSTICS, 1, reports.report(1, name, 0, "", {"ticks": str(ticks)}))
        writer.write_block(rows)
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("bags") / "pair", {"": 1 * MM, "left": 3 * MM})


@pytest.fixture
def bag(path: Path) -> Bag:
    return Bag(path)


def test_each_arm_has_a_score_of_its_own(bag: Bag) -> None:
    right, left = scores(bag)
    assert np.isclose(present(right.position_error_mm.max), 1.0, atol=ROUNDING)
    assert np.isclose(present(left.position_error_mm.max), 3.0, atol=ROUNDING)
    assert (right.session.arm, left.session.arm) == ("right", "left")
    assert (right.session.robot, left.session.robot) == ("rcrt1", "puma560")
    assert (right.session.seed, left.session.seed) == (7, 8)
    assert right.session.scenario == left.session.scenario == "pair"
    assert (right.session.gain, left.session.gain) == (1.0, 0.1)


def test_default_arm_has_the_first_name_and_no_name(bag: Bag) -> None:
    plain, named = evaluate(bag), evaluate(bag, "right")
    assert plain.session.arm == "right"
    assert plain.to_json() == named.to_json()


def test_arm_is_scored_as_if_it_had_been_recorded_alone(bag: Bag, tmp_path: Path) -> None:
    alone = evaluate(Bag(write(tmp_path / "pair", {"": 3 * MM}, {"scenario": "pair"})))
    left = evaluate(bag, "left")
    assert left.position_error_mm == alone.position_error_mm
    assert set(left.topics) == set(alone.topics)
    assert left.topics["slave/measured_js"] == alone.topics["slave/measured_js"]


def test_nodes_are_those_of_the_arm(bag: Bag) -> None:
    right, left = scores(bag)
    assert right.nodes == {"slave_sim": {"ticks": 1000}}
    assert left.nodes == {"slave_sim": {"ticks": 2000}, "play": {"ticks": 3000}}
    assert (right.ticks.executed, left.ticks.executed) == (1000, 2000)


def test_view_of_an_arm_reads_what_the_recording_holds_of_it(bag: Bag) -> None:
    left = arms.of_arm(bag, "left")
    series = left.read(SLAVE_MEASURED_JS)
    assert series.names == ("c", "d", "e")
    assert series.values.shape == (COUNT, 9)
    assert {name for name, *_ in left.raw(["slave/servo_cp"])} == {"slave/servo_cp"}
    assert sum(1 for _ in left.raw()) == sum(info.count for info in left.topics.values())
    assert "left/slave/measured_cp" not in arms.of_arm(bag).topics


def test_json_table_and_page_show_every_arm(path: Path, tmp_path: Path) -> None:
    shown = terminal()
    target, page = tmp_path / "scores.json", tmp_path / "page.html"
    evaluate_bags([path], target, page, shown)
    assert [s["session"]["arm"] for s in json.loads(target.read_text())] == ["right", "left"]
    lines = [text.split() for text in shown.export_text().splitlines()]
    assert ["arm", "right", "arm", "left"] in lines
    assert ["position,", "max", "mm", "1.000", "3.000"] in [
        [word.partition("✗")[0] for word in line if not word.startswith("≤")] for line in lines
    ]
    text = page.read_text()
    assert "pair · right</th>" in text
    assert "pair · left</th>" in text


def test_recording_without_names_of_arms_has_one_without_a_name(tmp_path: Path) -> None:
    bag = Bag(write(tmp_path / "one", {"": 1 * MM}, {}))
    assert arms.arm_names(bag) == ("",)
    assert arms.of_arm(bag) is bag
    assert [score.session.arm for score in scores(bag)] == [""]


def test_arm_that_was_recorded_alone_is_found_by_its_topics(tmp_path: Path) -> None:
    bag = Bag(write(tmp_path / "alone", {"left": 3 * MM}, {"robot": "puma560", "seed": "8"}))
    assert arms.arm_names(bag) == ("left",)
    (score,) = scores(bag)
    assert np.isclose(present(score.position_error_mm.max), 3.0, atol=ROUNDING)
    assert (score.session.arm, score.session.robot, score.session.seed) == ("left", "puma560", 8)
    assert score.nodes == {"slave_sim": {"ticks": 2000}, "play": {"ticks": 3000}}
    assert evaluate(bag).to_json() == evaluate(bag, "left").to_json() == score.to_json()
    assert arms.topic_prefix(bag, "") == arms.topic_prefix(bag, "left") == "left/"


def test_arms_without_names_are_the_plain_one_and_those_with_topics_of_their_own(tmp_path: Path) -> None:
    bag = Bag(write(tmp_path / "pair", {"": 1 * MM, "left": 3 * MM}, {"robot": "rcrt1"}))
    assert arms.arm_names(bag) == ("", "left")
    plain, left = scores(bag)
    assert (plain.session.arm, left.session.arm) == ("", "left")
    assert (plain.session.robot, left.session.robot) == ("rcrt1", None)
    assert plain.nodes == {"slave_sim": {"ticks": 1000}}
    assert [arms.topic_prefix(bag, arm) for arm in ("", "left")] == ["", "left/"]


def test_topics_of_an_arm_that_measures_nothing_make_no_arm(tmp_path: Path) -> None:
    lost = [t.of_arm("left") for t in (SLAVE_MEASURED_CP, SLAVE_SETPOINT_CP)]
    bag = Bag(write(tmp_path / "pair", {"": 1 * MM, "left": 3 * MM}, {}, lost=lost))
    assert arms.arm_names(bag) == ("",)
    assert evaluate(bag).samples.scored == COUNT


def test_unknown_arm_is_told_with_those_there_are(bag: Bag, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError) as caught:
        evaluate(bag, "middle")
    assert caught.value.alternatives == ("right", "left")
    single = Bag(write(tmp_path / "one", {"": 1 * MM}, {}))
    with pytest.raises(UnknownNameError, match="names no arms"):
        evaluate(single, "left")


def test_arm_named_twice_is_refused(tmp_path: Path) -> None:
    bag = Bag(write(tmp_path / "one", {"": 1 * MM}, {"arms": "left left"}))
    with pytest.raises(RecordingError, match="names the arm left twice"):
        scores(bag)


def test_what_an_arm_lacks_is_told_with_the_arm(tmp_path: Path) -> None:
    lost = (SLAVE_SERVO_CP.of_arm("left"),)
    bag = Bag(write(tmp_path / "pair", {"": 1 * MM, "left": 1 * MM}, lost=lost))
    assert evaluate(bag).samples.scored == COUNT
    with pytest.raises(RecordingError, match="arm left lacks slave/servo_cp; it has"):
        evaluate(bag, "left")


def test_arm_that_never_meets_its_reference_is_named(tmp_path: Path) -> None:
    bag = Bag(write(tmp_path / "pair", {"": 1 * MM, "left": np.nan}))
    with pytest.raises(EvaluationError, match="of arm left has a valid"):
        scores(bag)
