"""Evaluation: scores of recordings made for the purpose, against what was put into them."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from present import present
from recipes import JOINTS, START_NS, Recipe, pose_rows, state, terminal
from teleop_console.report.report_page import report_page
from teleop_core.bags import reader, reports
from teleop_core.bags.writer import BagWriter
from teleop_core.base.errors import EvaluationError, RecordingError
from teleop_core.evaluation import evaluate, key_table, keys, study
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.evaluation.score_table import score_tables
from teleop_core.evaluation.windows import WINDOW_NS, DisorderError, windows
from teleop_core.graph.signals import STATE_FIELDS, TICK_NS
from teleop_core.graph.topics import (
    ALL,
    DIAGNOSTICS,
    MASTER_MEASURED_CF,
    MASTER_MEASURED_CP,
    REMOTE_CENTRE,
    SLAVE_JAW_BOARD,
    SLAVE_JAW_GRIP,
    SLAVE_JAW_MEASURED_JS,
    SLAVE_JAW_SERVO_JP,
    SLAVE_MEASURED_CF,
    SLAVE_MEASURED_CP,
    SLAVE_REACH,
    SLAVE_SERVO_CP,
    SLAVE_SERVO_JP,
    SLAVE_SETPOINT_CP,
    SLAVE_SETPOINT_JS,
    SLAVE_TRUE_CF,
    TELEOP_STATE,
    Topic,
)

# Positions of some hundred millimetres in doubles, scaled to millimetres.
EXACT_MM = 1e-9
EXACT_DEG = 1e-7
STAGES = ("haptic_master", "motion_scaling", "inverse_kinematics", "slave", "total")
BOX: dict[str, Any] = {
    "is_fixture_on": 1.0,
    "fixture_center_x": 0.4,
    "fixture_center_z": -0.18,
    "fixture_size_x": 0.03,
    "fixture_size_y": 0.03,
    "fixture_size_z": 0.03,
}


@pytest.fixture
def recipe() -> Any:
    return Recipe()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "bag"


# -- errors ----------------------------------------------------------------------------------------


def test_constant_offset_gives_its_length_as_rms_and_maximum_and_no_deviation(recipe: Any, path: Path) -> None:
    recipe.values(SLAVE_MEASURED_CP)[:, :3] += [3e-4, 0.0, 4e-4]
    error: Any = evaluate(recipe.write(path)).position_error_mm
    assert np.allclose((error.rms, error.sd, error.max), (0.5, 0.0, 0.5), atol=EXACT_MM)


def test_errors_against_reference_and_command_are_told_apart(recipe: Recipe, path: Path) -> None:
    recipe.values(SLAVE_SERVO_CP)[:, 0] += 2e-3
    recipe.values(SLAVE_MEASURED_CP)[:, 1] += 1e-3
    score = evaluate(recipe.write(path))
    assert np.isclose(present(score.position_error_mm.max), 1.0, atol=EXACT_MM)
    assert np.isclose(present(score.command_error_mm.max), np.sqrt(5.0), atol=EXACT_MM)


def test_command_error_takes_the_command_that_was_known_at_the_sampling_time(recipe: Recipe, path: Path) -> None:
    stamps, values, logs = recipe.rows[SLAVE_SERVO_CP]
    values[1500:, 0] += 5e-3
    recipe.rows[SLAVE_SERVO_CP] = (stamps + 200, values, logs + 200)  # 0.2 us after the sampling
    score = evaluate(recipe.write(path))
    expected = np.sqrt(25.0 * 1499 / 2999)
    assert np.isclose(present(score.command_error_mm.rms), expected, atol=EXACT_MM)


@pytest.mark.parametrize(
    ("angles", "expected"), [((0.3, 66.6, 0.0), "roll"), ((0.0, 66.9, 0.0), "pitch"), ((0.0, 66.6, 0.3), "yaw")]
)
def test_turn_about_one_fixed_axis_is_an_error_of_its_angle_alone(
    recipe: Recipe, path: Path, angles: tuple[float, float, float], expected: str
) -> None:
    recipe.values(SLAVE_MEASURED_CP)[:] = pose_rows(3000, angles=angles)
    error = evaluate(recipe.write(path)).orientation_error_deg
    for name in ("roll", "pitch", "yaw"):
        spread, largest = getattr(error, name), 0.3 if name == expected else 0.0
        assert np.allclose((spread.rms, spread.sd, spread.max), (largest, 0, largest), atol=EXACT_DEG)
    assert error.degenerate_share == 0.0


def test_orientation_straight_down_has_no_roll_and_no_yaw_but_an_angle(recipe: Recipe, path: Path) -> None:
    recipe.values(SLAVE_SETPOINT_CP)[:] = pose_rows(3000, angles=(0.0, 90.0, 0.0))
    recipe.values(SLAVE_MEASURED_CP)[:] = pose_rows(3000, angles=(0.0, 90.0, 0.5))
    error = evaluate(recipe.write(path)).orientation_error_deg
    assert error.degenerate_share == 1.0
    assert error.roll.rms is error.yaw.rms is None
    assert np.isclose(present(error.angle.rms), 0.5, atol=EXACT_DEG)


def test_lost_messages_do_not_pair_a_pose_with_the_reference_of_another_tick(recipe: Any, path: Path) -> None:
    motion = np.linspace(0.0, 0.3, 3000)[:, None] * [1.0, 0.0, 0.0]  # 0.1 mm each tick
    for topic in recipe.rows:
        recipe.values(topic)[:, :3] += motion
    recipe.delay(SLAVE_MEASURED_CP, 40_000)
    recipe.drop(SLAVE_SETPOINT_CP, [500, 1200, 1201, 1202])
    recipe.drop(SLAVE_MEASURED_CP, [900, 2100])
    score = evaluate(recipe.write(path))
    assert present(score.position_error_mm.max) < EXACT_MM
    assert (score.samples.scored, score.samples.unpaired) == (2994, 4)


def test_poses_that_are_no_numbers_are_counted_and_left_out(recipe: Recipe, path: Path) -> None:
    recipe.values(SLAVE_MEASURED_CP)[10, 0] = np.nan
    recipe.values(SLAVE_SETPOINT_CP)[20, 2] = np.inf
    recipe.values(SLAVE_SETPOINT_CP)[30, 3:] = 0.0
    score = evaluate(recipe.write(path))
    assert score.samples.invalid == 3
    assert score.position_error_mm.max == 0.0
    json.dumps(score.to_json(), allow_nan=False)


# -- fixture, force --------------------------------------------------------------------------------


def test_penetration_counts_only_while_the_box_is_on(recipe: Recipe, path: Path) -> None:
    on, off = START_NS + 1000 * TICK_NS, START_NS + 2000 * TICK_NS
    recipe.singles += [(TELEOP_STATE, on, state(on, **BOX)), (TELEOP_STATE, off, state(off))]
    tip = recipe.values(SLAVE_MEASURED_CP)
    tip[500:600, 0] += 0.1  # before it came on
    tip[1200:1300, 0] += 0.015 + 0.7e-3
    tip[1300:1400, :2] += 0.015 + np.array([0.3e-3, 0.4e-3])  # beyond an edge
    tip[2500:, 1] += 0.1
    box = evaluate(recipe.write(path)).fixture
    assert np.isclose(box.on_s, 1.0)
    assert np.isclose(present(box.outside_share), 0.2)
    assert np.isclose(present(box.penetration_max_mm), 0.7, atol=EXACT_MM)
    assert np.isclose(present(box.penetration_rms_mm), np.sqrt((0.49 + 0.25) / 10), atol=EXACT_MM)


def test_hand_is_as_far_out_as_its_command_divided_by_the_gain(recipe: Recipe, path: Path) -> None:
    fine: dict[str, Any] = BOX | {"gain": 0.1} | {f"fixture_size_{axis}": 0.003 for axis in "xyz"}
    recipe.singles = [(TELEOP_STATE, START_NS, state(START_NS, **fine))]
    recipe.values(SLAVE_SERVO_CP)[100:200, 2] -= 0.0015 + 0.05e-3
    score = evaluate(recipe.write(path))
    assert np.isclose(present(score.fixture.hand_penetration_max_mm), 0.5, atol=1e-8)
    assert score.session.gain == 0.1


def test_force_is_scored_by_its_magnitude(recipe: Recipe, path: Path) -> None:
    force = np.zeros((3000, 6))
    force[:, 0], force[:, 1] = 3.0, -4.0
    recipe.rows[MASTER_MEASURED_CF] = (recipe.stamps, force, recipe.stamps)
    assert np.isclose(present(evaluate(recipe.write(path)).force_n.rms), 5.0)


def test_without_state_and_force_their_scores_are_not_applicable(recipe: Recipe, path: Path) -> None:
    recipe.singles = []
    score = evaluate(recipe.write(path))
    assert score.session.gain is None
    assert score.latency_ms["slave"].median is score.latency_ms["haptic_master"].max is None
    assert score.fixture.penetration_max_mm is None
    assert score.force_n.max is None
    for name in ("touch.count", "touch.drop_n", "touch.share", "remote_centre.off_rms_mm"):
        assert score.value(name) is None


def test_a_fall_of_the_force_on_the_tip_counts_from_sample_to_sample_but_not_over_a_pause(
    recipe: Recipe, path: Path
) -> None:
    force = np.zeros((len(recipe.stamps), 6))
    force[100:200, 0], force[200:300, 0] = -2.0, -1.5  # falls by 0.5 N, and then by 1.5
    force[1000:1100, 2] = 3.0
    recipe.rows[SLAVE_MEASURED_CF] = (recipe.stamps, force, recipe.stamps)
    recipe.drop(SLAVE_MEASURED_CF, np.arange(1050, 1200))  # nobody saw how 3 N went
    score = evaluate(recipe.write(path))
    assert score.value("touch.count") == 2
    assert score.value("touch.peak_n") == pytest.approx(3.0)
    assert score.value("touch.drop_n") == pytest.approx(1.5)


def test_a_tool_that_follows_misses_its_remote_centre_by_the_distance_of_its_shaft(recipe: Recipe, path: Path) -> None:
    poses = recipe.values(SLAVE_MEASURED_CP)
    poses[:, 3:7] = [1.0, 0.0, 0.0, 0.0]
    beside = np.where(np.arange(len(poses)) % 2, 3e-3, 4e-3)
    centre = [0.3, 0.0, 0.2, 0.0, 0.0, 1.0]  # m, and the shaft along z
    poses[:, :3] = centre[:3]
    poses[:, 0] += beside
    poses[:, 2] -= np.linspace(0.15, 0.10, len(poses))
    begin = recipe.stamps[200]
    poses[:200, 0] += 0.05  # not led yet
    recipe.singles = [
        (TELEOP_STATE, recipe.stamps[0], state(recipe.stamps[0], is_following=0.0)),
        (TELEOP_STATE, begin, state(begin)),
    ]
    rows = np.tile(centre, (len(poses), 1))
    recipe.topics.append(REMOTE_CENTRE)
    recipe.rows[REMOTE_CENTRE] = (recipe.stamps, rows, recipe.stamps)
    score = evaluate(recipe.write(path))
    assert score.value("remote_centre.off_max_mm") == pytest.approx(4.0, abs=EXACT_MM)
    assert score.value("remote_centre.off_rms_mm") == pytest.approx(12.5**0.5, abs=EXACT_MM)
    least = 1e3 * np.hypot(3e-3, 0.10)
    assert score.value("remote_centre.least_depth_mm") == pytest.approx(least, abs=EXACT_MM)


def test_grips_slips_and_drops_of_the_recording_count_and_the_delay_is_from_hand_to_grip(
    recipe: Recipe, path: Path
) -> None:
    count = len(recipe.stamps)
    grip, asked = np.zeros((count, 6)), np.full((count, 1), 0.8)
    grip[:, 3:] = [7.0, 5.0, 3.0]  # what was before
    for begin, push in ((300, 4.0), (900, 6.0)):
        asked[begin - 100 : begin - 50, 0] = np.linspace(0.8, 0.0, 51)[1:]  # closes for 50 ms
        asked[begin - 50 : begin + 200, 0] = 0.0
        grip[begin : begin + 200, :2] = push, 1.0
        grip[begin:, 3] += 1.0
    grip[1000:, 4:] += [1.0, 2.0]
    topics = {SLAVE_JAW_GRIP: grip, SLAVE_JAW_SERVO_JP: asked, SLAVE_JAW_MEASURED_JS: grip[:, :3]}
    recipe.topics += topics
    recipe.rows |= {t: (recipe.stamps, rows, recipe.stamps) for t, rows in topics.items()}
    score = evaluate(recipe.write(path))
    names = ("grips", "slips", "drops", "peak_force_n")
    assert [score.value(f"jaw.{name}") for name in names] == [2, 1, 2, 6.0]
    assert score.value("jaw.delay_s") == pytest.approx(0.1, abs=1e-9)


def test_a_transfer_takes_from_the_last_grip_to_rest_and_what_was_before_does_not_count(
    recipe: Recipe, path: Path
) -> None:
    count = len(recipe.stamps)
    grip, board = np.zeros((count, 6)), np.zeros((count, len(SLAVE_JAW_BOARD.columns)))
    grip[:, 3], board[:, :2] = 7.0, [4.0, 2.0]  # what was before
    for begin in (300, 600, 900):
        grip[begin:, 3] += 1.0
    board[:, 2] = np.where(np.arange(count) == 650, 1.25, 0.0)
    board[500:, 0] += 1.0  # 200 ms after the first grip
    board[1000:, 0] += 1.0  # 100 ms after the last one
    board[700:, 1] += 1.0
    topics = {SLAVE_JAW_GRIP: grip, SLAVE_JAW_BOARD: board}
    recipe.topics += topics
    recipe.rows |= {t: (recipe.stamps, rows, recipe.stamps) for t, rows in topics.items()}
    score = evaluate(recipe.write(path))
    names = ("transferred", "dropped", "peak_pull_n")
    assert [score.value(f"transfer.{name}") for name in names] == [2, 1, 1.25]
    assert score.value("transfer.time_s") == pytest.approx(0.15, abs=1e-9)


def test_a_hand_waits_where_it_rests_for_longer_than_three_tenths_of_a_second(recipe: Recipe, path: Path) -> None:
    stamps = recipe.stamps[0] // 10**9 * 10**9 + np.arange(4000) * 1_000_000
    poses = pose_rows(len(stamps))
    speed = np.full(len(stamps), 0.02)  # 2 mm in a tenth of a second
    speed[1000:2000] = speed[2500:2700] = 0.0  # rests of 1.0 s and of 0.2 s
    poses[:, 0] = np.cumsum(speed) * 1e-3
    recipe.rows[MASTER_MEASURED_CP] = (stamps, poses, stamps)
    score = evaluate(recipe.write(path))
    assert score.value("waits.count") == 1
    assert score.value("waits.share") == pytest.approx((10 - 3) / 40, abs=1 / 40)


def test_peaks_of_a_force_count_where_it_rises_and_falls_by_a_tenth_of_a_newton(recipe: Recipe, path: Path) -> None:
    force = np.zeros((len(recipe.stamps), 6))
    for begin, height in ((100, 0.5), (300, 1.0), (500, 0.09), (700, 0.2)):
        force[begin : begin + 100, 2] = height * np.sin(np.linspace(0.0, np.pi, 100))
    force[340:360, 2] += 0.05  # a bump on a peak
    recipe.topics.append(SLAVE_TRUE_CF)
    recipe.rows[SLAVE_TRUE_CF] = (recipe.stamps, force, recipe.stamps)
    assert evaluate(recipe.write(path)).value("force_peaks.count") == 3


# -- latency, ticks, gaps --------------------------------------------------------------------------


def chain(recipe: Recipe, delays_us: tuple[int, int, int, int]) -> None:
    """Give the recording all four links of the chain; each comes so much after the one before."""
    count, at = len(recipe.stamps), 0
    widths = {SLAVE_SERVO_JP: 6, SLAVE_SETPOINT_JS: 6}
    links = (MASTER_MEASURED_CP, SLAVE_SERVO_CP, SLAVE_SERVO_JP, SLAVE_SETPOINT_JS)
    for topic, delay_us in zip(links, delays_us, strict=True):
        at += delay_us * 1000
        rows = np.zeros((count, 6)) if topic in widths else pose_rows(count)
        recipe.rows[topic] = (recipe.stamps, rows, recipe.stamps + at)


def test_known_delays_come_out_per_stage_and_in_total(recipe: Recipe, path: Path) -> None:
    chain(recipe, (100, 250, 50, 900))
    latency = evaluate(recipe.write(path)).latency_ms
    for stage, delay in zip(STAGES, (0.1, 0.25, 0.05, 0.9, 1.3), strict=True):
        found: Any = latency[stage]
        assert np.allclose((found.median, found.p99, found.max), delay), stage


def test_command_that_is_held_counts_once(recipe: Recipe, path: Path) -> None:
    chain(recipe, (0, 0, 0, 1000))
    stamps, values, logs = recipe.rows[SLAVE_SETPOINT_JS]
    held = stamps.copy()
    held[1000:1500] = stamps[1000]
    held[:10] = 0  # no command yet
    recipe.rows[SLAVE_SETPOINT_JS] = (held, values, logs)
    score = evaluate(recipe.write(path))
    assert score.latency_ms["total"].max == 1.0
    assert score.topics["slave/setpoint_js"].gaps == 0


def test_dropped_samples_are_gaps_of_their_topic_alone(recipe: Recipe, path: Path) -> None:
    stamps, values, logs = recipe.rows[SLAVE_SERVO_CP]
    recipe.rows[SLAVE_SERVO_CP] = (stamps[::10], values[::10], logs[::10])  # at a tenth of the rate
    recipe.drop(SLAVE_MEASURED_CP, [100, 101, 102, 999, 1000, 2500])
    score = evaluate(recipe.write(path))
    assert (score.topics["slave/measured_cp"].count, score.topics["slave/measured_cp"].gaps) == (2994, 6)
    assert score.topics["slave/servo_cp"].gaps == 0
    assert score.topics["teleop/state"].gaps is None
    assert (score.ticks.executed, score.ticks.late, score.ticks.dropped) == (2994, None, 6)


def test_ticks_are_those_that_the_slave_reported_last(recipe: Recipe, path: Path) -> None:
    for second in (1, 2):
        at = START_NS + second * 1000 * TICK_NS
        values = {
            "ticks": str(1000 * second),
            "late": str(3 * second),
            "missed": str(9 * second),
            "caught_up": str(8 * second),
            "rate_hz": "999.9",
            "refused.slave/servo_jp.jump": "0",
        }
        recipe.singles.append((DIAGNOSTICS, at, reports.report(at, "slave_sim", 0, "ACTIVE", values)))
    score = evaluate(recipe.write(path))
    assert (score.ticks.executed, score.ticks.late) == (2000, 6)
    assert (score.ticks.made_up, score.ticks.dropped) == (16, 2)
    assert "rate_hz" not in score.nodes["slave_sim"]
    assert score.nodes["slave_sim"]["refused.slave/servo_jp.jump"] == 0


# -- whole recordings ------------------------------------------------------------------------------


def test_long_recording_scores_the_same_window_by_window_as_at_once(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = Recipe(13_000)
    rng = np.random.default_rng(1)
    recipe.values(SLAVE_MEASURED_CP)[:, :3] += rng.normal(scale=1e-4, size=(13_000, 3))
    chain(recipe, (100, 250, 50, 900))
    bag = recipe.write(path)
    parts = list(windows(bag, recipe.rows))
    assert len(parts) > 13_000 * TICK_NS // (2 * WINDOW_NS)
    assert sum(p.own(SLAVE_MEASURED_CP).stop - p.own(SLAVE_MEASURED_CP).start for p in parts) == 13_000
    streamed: dict[str, Any] = evaluate(bag).to_json()
    monkeypatch.setattr("teleop_core.evaluation.windows.WINDOW_NS", 10**15)
    once: dict[str, Any] = evaluate(bag).to_json()
    assert np.isclose(streamed["position_error_mm"]["sd"], once["position_error_mm"]["sd"])
    for part in ("latency_ms", "topics", "ticks", "samples"):
        assert streamed[part] == once[part]


def test_recording_out_of_order_is_scored_all_the_same(path: Path) -> None:
    recipe = Recipe(9000)
    recipe.values(SLAVE_MEASURED_CP)[:, 0] += np.linspace(0, 1e-3, 9000)
    straight = evaluate(recipe.write(path))
    shuffled = path.with_name("shuffled")
    with BagWriter(shuffled, ALL, JOINTS, start_ns=START_NS) as writer:
        for topic in (SLAVE_MEASURED_CP, SLAVE_SERVO_CP, SLAVE_SETPOINT_CP):  # one after the other
            writer.write_block({topic: recipe.rows[topic]})
    with pytest.raises(DisorderError):
        list(windows(reader.Bag(shuffled), recipe.rows))
    other = evaluate(reader.Bag(shuffled))
    assert np.isclose(present(other.position_error_mm.rms), present(straight.position_error_mm.rms))
    assert other.samples == straight.samples


def test_json_has_exactly_the_documented_keys(recipe: Recipe, path: Path) -> None:
    chain(recipe, (1, 1, 1, 1))
    at = START_NS + 5 * TICK_NS
    recipe.singles.append((DIAGNOSTICS, at, reports.report(at, "slave_sim", 0, "", {"ticks": "5"})))
    found = set(leaves(evaluate(recipe.write(path)).to_json()))
    patterns = [re.compile(pattern(key.path)) for key in keys()]
    for leaf in found:
        assert any(p.fullmatch(leaf) for p in patterns), f"{leaf} is not documented"
    for key, p in zip(keys(), patterns, strict=True):
        assert any(p.fullmatch(leaf) for leaf in found), f"{key.path} does not occur"
    lines = key_table().splitlines()
    assert len(lines) == len(keys()) + 2
    assert {line.count("|") for line in lines} == {4}


def leaves(tree: Any, before: str = "") -> Iterator[str]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{before}{name}.")
        else:
            assert value is None or isinstance(value, str | int | float)
            yield before + name


def pattern(key: str) -> str:
    parts = []
    for part in key.split("."):
        parts.append("[^.]+" if part.startswith("<") else f"(?:{part})")
    return r"\.".join(parts)


# -- the command -----------------------------------------------------------------------------------


def test_command_writes_table_scores_and_page(recipe: Recipe, path: Path, tmp_path: Path) -> None:
    recipe.values(SLAVE_MEASURED_CP)[:, 0] += 0.5e-3
    followed = np.zeros((len(recipe.stamps), len(SLAVE_REACH.columns)))
    recipe.rows[SLAVE_REACH] = (recipe.stamps, followed, recipe.stamps)
    recipe.write(path)
    shown = terminal()
    target, page = tmp_path / "scores.json", tmp_path / "page.html"
    page.write_text("old")
    (score,) = evaluate_bags([path], target, page, shown)
    text = shown.export_text()
    session = score.session
    assert (session.name, session.scenario, session.robot, session.seed) == ("bag", "at_rest", "rcrt1", 7)
    assert np.isclose(session.duration_s, 2.999)
    assert "0.500✗ (0.338)" in text
    assert "0.500 (0.702)" in text
    assert json.loads(target.read_text())[0] == score.to_json()
    assert page.read_text().startswith("<!DOCTYPE html>")


def test_three_recordings_fit_side_by_side_on_a_narrow_terminal(recipe: Recipe, path: Path) -> None:
    score = evaluate(recipe.write(path))
    assert [len(table.columns) for table in score_tables([score] * 4, 80)] == [4, 2]
    shown = terminal()
    shown.print(score_tables([score] * 3, 80)[0])
    assert "…" not in shown.export_text()


def test_texts_of_a_recording_cannot_become_markup(recipe: Recipe, tmp_path: Path) -> None:
    recipe.metadata |= {"scenario": "</script><b>[red]x", "robot": '"><img src=x onerror=alert(1)>'}
    bag = recipe.write(tmp_path / "<i>bag")
    page = report_page([study(bag)])
    assert "<b>[red]" not in page
    assert "<img" not in page.split("page-data")[0]
    assert "<i>bag" not in page
    shown = terminal()
    shown.print(score_tables([evaluate(bag)], 80)[0])
    assert "[red]x" in shown.export_text()


@pytest.mark.parametrize("topic", [SLAVE_MEASURED_CP, SLAVE_SETPOINT_CP, SLAVE_SERVO_CP])
def test_missing_topic_is_named_with_what_there_is(recipe: Recipe, path: Path, topic: Topic) -> None:
    del recipe.rows[topic]
    recipe.write(path)
    with pytest.raises(RecordingError) as caught:
        evaluate_bags([path], None, None, terminal())
    missing, present = str(caught.value).split("; it has ")
    assert f"lacks {topic.name}" in missing
    assert set(present.split(", ")) >= {other.name for other in recipe.rows}
    assert "\n" not in str(caught.value)


def test_poses_that_never_meet_their_reference_are_refused(recipe: Recipe, path: Path) -> None:
    recipe.delay(SLAVE_SETPOINT_CP, 10_000 * TICK_NS)
    with pytest.raises(EvaluationError, match="must be recorded together"):
        evaluate(recipe.write(path))


@pytest.mark.parametrize(("text", "told"), [("wide", "must be a number"), (None, "lacks gain")])
def test_state_of_another_make_is_refused_in_one_line(recipe: Recipe, path: Path, text: Any, told: str) -> None:
    values = dict.fromkeys(STATE_FIELDS, "0.0") | {"gain": text}
    values = {name: value for name, value in values.items() if value is not None}
    recipe.singles = [(TELEOP_STATE, START_NS, reports.report(START_NS, "teleop", 0, "", values))]
    with pytest.raises(EvaluationError, match=told):
        evaluate(recipe.write(path))


def test_nothing_is_written_when_one_recording_cannot_be_scored(recipe: Recipe, path: Path, tmp_path: Path) -> None:
    recipe.write(path)
    target = tmp_path / "scores.json"
    with pytest.raises(RecordingError):
        evaluate_bags([path, tmp_path / "none"], target, None, terminal())
    assert not target.exists()


def test_output_into_a_missing_directory_is_refused_before_scoring(tmp_path: Path) -> None:
    with pytest.raises(EvaluationError, match="does not exist; make it first"):
        evaluate_bags([tmp_path / "none"], tmp_path / "a" / "b.json", None, terminal())
    with pytest.raises(EvaluationError, match="is a directory"):
        evaluate_bags([tmp_path / "none"], None, tmp_path, terminal())
