"""Arms: each one as if it were alone, with its own parameters and robot, in one recording."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.bags.reader import Bag
from teleop_core.graph.layers import parse_layer
from teleop_core.graph.topics import STREAMS
from teleop_core.session import runner, virtual
from teleop_core.session.configuration import Configuration, configure

# Ticks in which the rcrt1 moves to where it starts, at half of its speed; then its hand moves.
LEAD = 3702
TICKS = LEAD + 1500
SHORT = ("approach_time=0.5", "operator.period=2.0", "buttons.fixture=[0.2]")
ARMS = (
    "teleop.arms=[right, left]",
    "left/robot=scara",
    "left/seed=7",
    "left/coarse_gain=0.5",
    "right/fixture=sphere",
    "right/fixture.sphere.radius=0.005",
)


def settings(*more: str) -> Configuration:
    return configure(settings=[*SHORT, *more])


@pytest.fixture(scope="module")
def both() -> NDArray[np.void]:
    """Rows of a session of two arms with different robots."""
    return virtual.VirtualTime(settings(*ARMS)).run(TICKS)


def assert_same_streams(block: NDArray[np.void], arm: str, other: NDArray[np.void]) -> None:
    for topic in STREAMS:
        field = topic.of_arm(arm).field
        assert np.array_equal(block[field], other[topic.field]), field
        assert np.array_equal(block[f"{field}_ns"], other[f"{topic.field}_ns"]), field


def test_default_arm_moves_as_alone_to_the_bit(both: NDArray[np.void]) -> None:
    alone = virtual.VirtualTime(settings("fixture=sphere", "fixture.sphere.radius=0.005")).run(TICKS)
    assert_same_streams(both, "", alone)
    assert np.abs(both["master_servo_cf"]).max() > 0.1


def test_second_arm_moves_as_its_robot_alone_to_the_bit(both: NDArray[np.void]) -> None:
    alone = virtual.VirtualTime(settings("robot=scara", "seed=7", "coarse_gain=0.5")).run(TICKS)
    assert_same_streams(both, "left", alone)


def test_arms_differ_in_what_is_said_of_one_alone() -> None:
    groups = settings(*ARMS, "fine_gain=0.2").groups
    assert (groups["slave_sim"].robot, groups["left/slave_sim"].robot) == ("rcrt1", "scara")
    gains = [groups[f"{arm}motion_scaling"].coarse_gain for arm in ("", "left/")]
    kinds = [groups[f"{arm}motion_scaling"].fixture.kind.kind for arm in ("", "left/")]
    fine = [groups[f"{arm}motion_scaling"].fine_gain for arm in ("", "left/")]
    assert (gains, kinds, fine) == ([1.0, 0.5], ["sphere", "box"], [0.2, 0.2])


def test_what_is_said_of_an_arm_wins_whatever_comes_later() -> None:
    groups = settings("teleop.arms=[right, left]", "left/seed=7", "seed=9").groups
    assert (groups["haptic_master"].seed, groups["left/haptic_master"].seed) == (9, 7)


def test_arms_are_said_in_files_too(tmp_path: Path) -> None:
    path = tmp_path / "arms.yaml"
    path.write_text(
        "teleop: {ros__parameters: {arms: [right, left]}}\n"
        "left/haptic_master: {ros__parameters: {seed: 7}}\n"
        "/right/haptic_master: {ros__parameters: {seed: 5}}\n"
    )
    groups = configure(files=[path]).groups
    assert (groups["haptic_master"].seed, groups["left/haptic_master"].seed) == (5, 7)


def test_text_of_two_arms_reads_back_the_same() -> None:
    configuration = settings(*ARMS)
    layer = parse_layer(yaml.safe_load(configuration.text()), "text")
    assert Configuration.from_layers([layer]) == configuration


@pytest.mark.slow
def test_one_recording_holds_both_arms_to_the_bit(tmp_path: Path, both: NDArray[np.void]) -> None:
    configuration = settings(*ARMS, "duration=1.5")
    runner.simulate(configuration, tmp_path / "bag")
    bag = Bag(tmp_path / "bag")
    for arm in ("", "left"):
        for topic in (topic.of_arm(arm) for topic in STREAMS):
            assert np.array_equal(bag.read(topic).values, both[topic.field]), topic.name


HAND_OVER: dict[str, Any] = {
    "jaw_sim.second_base": (0.0, -0.03, 0.0),
    "left/operator.tour.points": (0.0, 0.0, 0.02, 0.0, -0.03, 0.02, *(0.0, 0.0, 0.02) * 4),
    "left/operator.buttons.jaw": (5.3, 9.5),
    "right/operator.tour.points": (
        *(0.0, 0.0, 0.0),
        *(-0.03, 0.0, 0.0),
        *(-0.03, 0.0, 0.02) * 2,
        *(0.0, 0.0, 0.02) * 2,
    ),
    "right/operator.buttons.jaw": (8.5, 14.0),
}
"""The left arm lifts a block, the right one takes it from its jaw, carries it 30 mm and lets go."""


def test_a_block_is_handed_from_arm_to_arm_and_each_arm_tells_where_it_is() -> None:
    recording = tc.run("pick", duration=20.0, arms=["left", "right"], settings=HAND_OVER)
    left, right = recording.scores()
    for score in (left, right):
        assert [score.value(f"jaw.{key}") for key in ("grips", "slips", "drops")] == [1, 0, 0]
    told, also = recording["slave/jaw/board"], recording["right/slave/jaw/board"]
    assert told.values[-1, 3:6] == pytest.approx([0.261, -0.2657, -0.0911], abs=2e-3)
    assert also.values[-1, 3:6] == pytest.approx(told.values[-1, 3:6] - [0.0, -0.03, 0.0])


def test_two_arms_with_one_board_repeat_and_replay_to_the_bit(tmp_path: Path) -> None:
    given: dict[str, Any] = {"arms": ["left", "right"], "settings": HAND_OVER}
    first = tc.run("pick", duration=9.0, out=tmp_path / "first", **given)
    again = tc.run("pick", duration=9.0, **given)
    replayed = tc.replay(first)
    for topic in ("slave/jaw/board", "right/slave/jaw/board", "right/slave/jaw/grip"):
        assert np.array_equal(first[topic].values, again[topic].values)
        assert np.array_equal(first[topic].values, replayed[topic].values)
