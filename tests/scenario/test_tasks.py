"""Tasks in sessions: what is recorded of them agrees with where the tip was, and with the hand."""

import math
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.graph import STAGES, topics
from teleop_core.hand.master.display import DisplayParameters
from teleop_core.hand.tasks import MEMORY, SCENE
from teleop_core.hand.tasks.follow import FOLLOW, FollowParameters
from teleop_core.kernels.parts import numbers_of

COLUMN = {name: i for i, name in enumerate(topics.TASK_STATE.columns)}


@pytest.fixture(scope="module")
def point() -> tc.Recording:
    return tc.run("point", duration=12.0)


def attempts(recording: tc.Recording) -> np.ndarray:
    """Rows of ``task/state`` with another count of attempts."""
    told = recording["task/state"].values
    return told[1:][np.diff(told[:, COLUMN["attempts"]]) > 0.0]


def test_presses_count_by_where_the_tip_really_was(point: tc.Recording) -> None:
    told, tip, jaw = point["task/state"], point["slave/true_cp"], point["hand/jaw"]
    closing = np.flatnonzero((jaw.values[1:, 0] > 0.5) & (jaw.values[:-1, 0] < 0.5)) + 1
    pressed = jaw.stamp_ns[closing]
    successes = 0
    for stamp in pressed:
        goal = told.values[told.stamp_ns <= stamp][-1]
        # The task sees the hand a tick later.
        at = tip.values[tip.stamp_ns <= stamp + 1_000_000][-1, :3]
        place = goal[[COLUMN["goal_x"], COLUMN["goal_y"], COLUMN["goal_z"]]]
        successes += bool(np.linalg.norm(at - place) <= 0.5 * goal[COLUMN["width"]])
    last = told.values[-1]
    assert len(pressed) >= 5
    assert last[COLUMN["attempts"]] == len(pressed)
    assert last[COLUMN["successes"]] == successes
    assert last[COLUMN["errors"]] == len(pressed) - successes


def test_targets_lie_on_a_ring_across_from_each_other(point: tc.Recording) -> None:
    told = point["task/state"].values
    told = told[told[:, COLUMN["number"]] > 0.0]
    goals = {row[0]: row[2:5] for row in told}
    places = np.array([goals[number] for number in sorted(goals)])
    middle = point["slave/true_cp"].values[:, :3]
    begin = point["task/state"].stamp_ns[point["task/state"].values[:, 0] > 0.0][0]
    center = middle[point["slave/true_cp"].stamp_ns <= begin][-1]
    assert np.linalg.norm(places - center, axis=1) == pytest.approx(0.015, abs=1e-9)
    jumps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert jumps == pytest.approx(0.03 * np.cos(np.pi / 26), abs=1e-9)


def test_throughput_is_effective_width_and_time_of_the_attempts(point: tc.Recording) -> None:
    rows = attempts(point)[1:]
    width = 4.133 * rows[:, COLUMN["off"]].std(ddof=1)
    bits = np.log2(rows[:, COLUMN["way"]].mean() / width + 1.0)
    score = point.score()
    assert score.value("task.throughput") == pytest.approx(bits / rows[:, COLUMN["time"]].mean())
    assert score.value("task.attempts") == len(rows) + 1


def test_the_operator_sees_the_slave_as_late_as_the_display_says() -> None:
    for latency in (0.0, 0.1):
        shown = tc.run("point", duration=3.0, display__latency=latency, display__rate=50.0)
        stream = shown["display/measured_cp"]
        is_new = np.diff(stream.stamp_ns, prepend=0) > 0
        ages = (stream.frame()["stamp_ns"].index.to_numpy() * 1e9)[is_new]
        age = ages - (stream.stamp_ns[is_new] - shown.bag.start_ns)
        assert np.diff(stream.stamp_ns[is_new])[1:] == pytest.approx(20_000_000, abs=1_000_000)
        assert np.median(age) == pytest.approx(1e9 * latency + 1e6, abs=1.1e6)
        # A frame is 20 ms on the screen: half of that older than when it came.
        seen, rate = (shown.score().value(f"display.{key}") for key in ("age_mean_ms", "rate_hz"))
        assert seen == pytest.approx(1e-6 * np.median(age) + 10.0, abs=0.1)
        assert rate == pytest.approx(50.0, abs=0.1)


def test_a_display_is_dark_until_the_slave_says_where_it_is() -> None:
    running = STAGES.find("display").run(DisplayParameters(latency=0.0))
    row = running.signals
    for tick in range(1, 100):
        row["now_ns"] = tick * 1_000_000
        row["slave_measured_cp_ns"] = 0 if tick < 50 else tick * 1_000_000
        running.step()
        assert (row["display_measured_cp_ns"] > 0) == (tick >= 50)


def frames_of(ticks: int = 20_000, **given: Any) -> np.ndarray:
    """Times at which each frame was taken and came [s], shape (N, 2), without frames that stood for no tick."""
    running = STAGES.find("display").run(DisplayParameters(**given))
    row, found = running.signals, []
    for tick in range(1, ticks):
        row["now_ns"] = row["slave_measured_cp_ns"] = tick * 1_000_000
        before = int(row["display_measured_cp_ns"])
        running.step()
        if row["display_measured_cp_ns"] != before:
            found.append((1e-9 * row["display_measured_cp_ns"], 1e-3 * tick))
    return np.array(found)


@pytest.mark.parametrize("loss", [0.0, 0.3, 0.9, 1.0])
def test_the_given_share_of_frames_never_comes(loss: float) -> None:
    shown = frames_of(rate=100.0, latency=0.0, loss=loss)
    assert len(shown) == pytest.approx(2000 * (1.0 - loss), abs=4.0 * math.sqrt(2000 * loss * (1.0 - loss)) + 1.0)


def test_lost_frames_come_in_no_pattern() -> None:
    gone = np.round(100.0 * np.diff(frames_of(rate=100.0, latency=0.0, loss=0.5)[:, 0])) - 1.0
    # As with a coin: the next frame is lost with the same chance, however many were lost before it.
    assert [np.mean(gone[gone >= n] > n) for n in range(3)] == pytest.approx([0.5] * 3, abs=0.1)


@pytest.mark.parametrize("jitter", [0.05, 0.2])
def test_a_frame_is_late_by_up_to_the_jitter_more_and_never_comes_before_an_earlier_one(jitter: float) -> None:
    taken, came = frames_of(rate=10.0, latency=0.1, jitter=jitter).T
    late = came - taken - 0.1
    assert (np.diff(taken) > 0.0).all()
    assert late.min() >= -1e-9
    assert 0.9 * jitter < late.max() <= jitter + 1e-3
    if jitter < 0.1:  # a frame cannot reach the next one
        assert late.mean() == pytest.approx(0.5 * jitter, rel=0.15)
        assert late.std() == pytest.approx(jitter / math.sqrt(12.0), rel=0.15)


def test_a_seed_loses_and_delays_the_same_frames_each_time() -> None:
    given = {"latency": 0.05, "loss": 0.4, "jitter": 0.1}
    first, again, other = (frames_of(4000, seed=seed, **given) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:50], other[:50])


def test_who_sees_a_frame_stand_does_not_take_the_tip_for_being_at_rest() -> None:
    """Five frames a second cost little more than a steady picture of the same age, which is 0.5 s."""
    rare, steady = (
        tc.run("mouse", duration=40.0, display__rate=rate, display__latency=latency).score()
        for rate, latency in ((5.0, 0.4), (60.0, 0.492))
    )
    ages = [one.value("display.age_mean_ms") for one in (rare, steady)]
    assert ages[0] == pytest.approx(ages[1], abs=2.0)
    assert (rare.value("task.time_s") or 0.0) < 1.3 * (steady.value("task.time_s") or 0.0)


def test_more_frames_than_a_display_keeps_are_refused() -> None:
    with pytest.raises(tc.ParameterError, match=r"display\.jitter.*510 frames"):
        DisplayParameters(rate=240.0, latency=0.5, jitter=2.0)
    with pytest.raises(tc.ParameterError, match=r"loss.*1\.5"):
        tc.configuration("point", settings={"display.loss": 1.5})


def test_only_the_operator_reads_the_display_wherever_it_stands() -> None:
    for stages in (["display", "network"], ["network", "display"]):
        graph = tc.build_graph(stages=stages)
        found = {link.reader.name: link.topic.name for link in graph.links if link.port == topics.SLAVE_MEASURED_CP}
        assert found["operator"] == "display/measured_cp"
        assert found["display"] == "network/measured_cp"
        assert "display/measured_cp" not in {v for k, v in found.items() if k != "operator"}


def test_a_session_with_a_task_repeats_itself_to_the_bit(point: tc.Recording) -> None:
    again = tc.run("point", duration=12.0)
    session = tc.VirtualTime(tc.configuration("point"))
    first = session.run(6000)
    session.reset()
    assert np.array_equal(session.run(6000), first)
    for topic in ("task/state", "slave/true_cp", "hand/servo_cp"):
        assert np.array_equal(again[topic].values, point[topic].values)


@pytest.mark.parametrize("task", ["follow", "trace"])
def test_a_moving_goal_is_followed_by_looks_and_steps(task: str) -> None:
    recording = tc.run("point", duration=15.0, task=task, settings={"operator.seed": 1})
    score = recording.score()
    assert (score.value("task.attempts") or 0) > 20
    assert (score.value("task.error_share") or 0.0) < 0.5


def test_a_goal_that_nobody_foresees_stays_in_its_bounds_and_comes_again_after_its_period() -> None:
    goals = [place_of(FollowParameters(size=0.02, period=30.0), time) for time in range(61)]
    ways = np.array(goals) - goals[0]
    assert np.abs(ways).max() < 0.02
    assert np.abs(ways).max(axis=0)[1:].min() > 0.25 * 0.02  # half of the first sine alone
    np.testing.assert_allclose(ways[30:61], ways[:31], atol=1e-9)
    assert len({round(float(y), 6) for _, y, _ in ways[:30]}) > 25


def place_of(p: FollowParameters, time: float) -> np.ndarray:
    """Where its goal is at a time [s], for a task that began at the origin at 0."""
    memory, state, scene = np.zeros(MEMORY), np.zeros(len(topics.TASK_STATE.columns)), np.zeros(len(SCENE))
    FOLLOW.judge(numbers_of(p), memory, scene, state)
    scene[0] = time
    FOLLOW.judge(numbers_of(p), memory, scene, state)
    return np.array(state[2:5])


@pytest.mark.parametrize("way", ["there", "back"])
def test_a_predictive_display_hides_the_network(way: str) -> None:
    late: dict[str, Any] = {"teleop.stages": ["network", "display", "task"], f"network.{way}.least_delay": 0.3}
    late |= {"task.point.by_entering": True}  # nothing delays a press, which would come before the arm
    plain, predicted = (
        tc.run("point", duration=20.0, settings={**late, "display.shows": shows}).score()
        for shows in ("slave", "command")
    )
    assert (predicted.value("task.time_s") or 9.0) < (plain.value("task.time_s") or 0.0) - 0.2


def test_a_person_turns_the_tool_as_a_reach_asks_for_with_arm_and_device_between() -> None:
    settings = {"task.reach.turn": 0.6, "task.reach.turn_width": 0.15}
    recording = tc.run("point", duration=15.0, task="reach", settings=settings)
    told, tip = recording["task/state"], recording["slave/true_cp"]
    ends = np.flatnonzero(np.diff(told.values[:, COLUMN["successes"]]) > 0.0)
    assert len(ends) >= 5
    for end in ends:  # the goal of this attempt is that of the sample before
        at = tip.values[tip.stamp_ns <= told.stamp_ns[end + 1]][-1]
        goal = told.values[end, COLUMN["goal_qw"] : COLUMN["goal_qw"] + 4]
        assert 2.0 * np.arccos(min(1.0, abs(goal @ at[3:]))) <= 0.075 + 0.01
    turns = told.values[ends, COLUMN["goal_qw"] : COLUMN["goal_qw"] + 4]
    assert np.abs(turns @ turns[0])[1:].min() < np.cos(0.5 * 0.3)  # they are turned apart


def test_a_small_gain_makes_a_person_clutch_and_each_clutch_leaves_the_slave_where_it_is() -> None:
    recording = tc.run("point", duration=25.0, coarse_gain=0.1)
    pressed, tip = recording["hand/buttons"], recording["slave/setpoint_cp"]
    edges = np.diff(pressed.values[:, 0], prepend=0.0)
    downs, ups = pressed.stamp_ns[edges > 0.0], pressed.stamp_ns[edges < 0.0]
    assert len(downs) >= 2
    for down, up in zip(downs, ups, strict=False):
        while_down = tip.values[(tip.stamp_ns > down + 100_000_000) & (tip.stamp_ns < up), :3]
        assert np.ptp(while_down, axis=0).max() < 2e-4
    assert (recording.score().value("task.successes") or 0) >= 1
