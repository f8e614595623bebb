"""Room: a start posture has room in all directions, and the rule is what the constants say."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from jointed import urdf
from present import present
from teleop_core.base.errors import ParameterError, ShapeError
from teleop_core.graph.layers import list_scenarios
from teleop_core.kernels import IS_COMPILED
from teleop_core.robots import IkStatus, freedom
from teleop_core.robots.arms.dh import robot_from_table

ANY_ARM = str(Path(__file__).resolve().parents[2] / "examples/any_arm.urdf")
TABLES = Path(__file__).resolve().parents[2] / "config/robots"
walks_far = pytest.mark.skipif(not IS_COMPILED, reason="looks at 100 000 poses")
FROZEN = ("rcrt1", "puma560", "mma", "scara_stewart")
ROOMY = ("scara", "planar_3r", "five_axis", "stewart", "rps3", "three_finger_hand")
ONE_AXIS = ("four_bar", "parallelogram")
# Constants are written with four digits.
ROUNDED = 6e-5
ARM: dict[str, Any] = {
    "name": "arm",
    "convention": "modified",
    "angles": "degrees",
    "task": ["x", "y"],
    "rows": [
        {"theta": "q", "lower": -150, "upper": 150, "home": 0},
        {"a": 0.4, "theta": "q", "lower": -150, "upper": 150, "home": 0},
        {"a": 0.3},
    ],
}


def with_starts(*starts: float) -> tc.Robot:
    rows = [dict(row) for row in ARM["rows"]]
    for row, start in zip(rows, starts, strict=False):
        row["start"] = start
    return robot_from_table({**ARM, "rows": rows})


@walks_far
@pytest.mark.parametrize("name", FROZEN)
def test_the_start_in_the_file_is_what_the_rule_says(name: str) -> None:
    robot = tc.load_robot(name)
    np.testing.assert_allclose(freedom.start_posture(robot), robot.start, rtol=0, atol=ROUNDED)


@pytest.mark.parametrize("name", [*FROZEN, *ROOMY])
def test_from_the_start_the_tool_goes_far_in_every_direction(name: str) -> None:
    robot = tc.load_robot(name)
    metres, radians = freedom.freedom(robot, robot.start)
    reach = np.linalg.norm(robot.solve_fk_batch(freedom.samples(robot), search=False).T[:, :3, 3], axis=1).max()
    assert metres >= reach / 16
    assert radians >= math.radians(29.9)


@pytest.mark.parametrize("name", [*ROOMY, *ONE_AXIS])
def test_a_home_with_room_is_the_start(name: str) -> None:
    robot = tc.load_robot(name)
    np.testing.assert_array_equal(robot.start, robot.home)


@pytest.mark.parametrize("name", ["rcrt1", "puma560"])
def test_at_the_start_the_tool_points_as_at_home(name: str) -> None:
    robot = tc.load_robot(name)
    held, at_home = robot.fk(robot.start)[:3, :3], robot.fk(robot.home)[:3, :3]
    np.testing.assert_allclose(held, at_home, atol=3e-4)  # four digits of six joints


@pytest.mark.parametrize("name", ["rcrt1", "puma560", "scara"])
def test_the_room_is_walked_in_any_direction_without_a_limit(name: str) -> None:
    robot, rng = tc.load_robot(name), np.random.default_rng(4)
    metres, begin = freedom.freedom(robot, robot.start).metres, robot.fk(robot.start)
    for _ in range(20):
        way = rng.normal(size=3)
        shares = np.linspace(0.0, 0.75, 200)[:, None]  # between two directions that were walked
        path = np.repeat(begin[None], 200, axis=0)
        path[:, :3, 3] += shares * metres * way / np.linalg.norm(way)
        answer = robot.follow(path, robot.start, dt=1.0)
        assert (answer.status == IkStatus.FOLLOWED).all()


def test_a_joint_on_its_stop_leaves_no_room() -> None:
    robot = tc.load_robot("rcrt1")
    q = robot.start.copy()
    q[2] = robot.upper[2]
    assert freedom.freedom(robot, q).metres == 0.0


@walks_far
def test_a_stretched_arm_starts_bent() -> None:
    robot = robot_from_table(ARM)
    assert freedom.freedom(robot, robot.home).metres == 0.0
    assert abs(robot.start[1]) > math.radians(30.0)
    assert freedom.freedom(robot, robot.start).metres > 0.1
    assert freedom.freedom(robot, robot.start).radians == math.inf  # it controls x and y alone


@walks_far
@pytest.mark.parametrize("joints", [6, 12])
def test_the_start_is_the_nearest_posture_to_home_with_nine_tenths_of_the_most_room(
    joints: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(freedom, "SAMPLES", 48)
    monkeypatch.setattr(freedom, "BATCH", 6)  # of the twelve joints' postures some are not walked at all
    robot = tc.load_robot(str(urdf(joints, tmp_path)))
    found = freedom.start_posture(robot)
    spread = freedom.samples(robot)
    held = np.array([robot.fk(q) for q in spread])
    held[:, :3, :3] = robot.fk(robot.home)[:3, :3]
    answer, lever = robot.ik_batch(held), freedom.lever(robot)
    looked_at = np.vstack((robot.home, answer.q[answer.status == IkStatus.FOLLOWED]))
    for postures in (looked_at, np.vstack((looked_at, spread))):
        walks = [freedom.freedom(robot, q) for q in postures]
        rooms = np.array([min(metres / lever, radians) for metres, radians in walks])
        if rooms.max() > math.radians(29.0):
            break
    good = postures[rooms >= freedom.EQUAL * rooms.max() - 1e-9]
    away = np.abs((good - robot.home) / (robot.upper - robot.lower)).max(axis=1)
    np.testing.assert_array_equal(found, good[away.argmin()])


@walks_far
def test_another_length_makes_another_start() -> None:
    robot = tc.load_robot("rcrt1", L6=0.3)
    assert not np.array_equal(robot.start, tc.load_robot("rcrt1").start)
    assert ((robot.lower <= robot.start) & (robot.start <= robot.upper)).all()


def test_a_table_states_its_own_start() -> None:
    np.testing.assert_allclose(with_starts(10.0, 60.0).start, np.radians([10.0, 60.0]))
    np.testing.assert_allclose(with_starts(10.0).start, np.radians([10.0, 0.0]))


def test_the_table_of_the_rcrt1_starts_where_the_built_in_one_does() -> None:
    table = tc.load_robot(str(TABLES / "rcrt1.yaml"))
    np.testing.assert_allclose(table.start, tc.load_robot("rcrt1").start, rtol=0, atol=2e-4)


def test_a_start_outside_the_limits_is_refused() -> None:
    with pytest.raises(ParameterError, match="row 2 start"):
        with_starts(0.0, 151.0)
    robot = robot_from_table(ARM)
    with pytest.raises(ParameterError) as error:
        dataclasses.replace(robot, start=robot.upper + 1.0)
    assert error.value.name == "start"
    with pytest.raises(ShapeError):
        dataclasses.replace(robot, start=np.zeros(3))


@walks_far
def test_a_start_is_nobody_elses_to_change() -> None:
    mine = np.radians([10.0, 60.0])
    robot = dataclasses.replace(robot_from_table(ARM), start=mine)
    mine[:] = 0.0
    np.testing.assert_allclose(robot.start, np.radians([10.0, 60.0]))
    for start in (robot.start, tc.load_robot("rcrt1").start, robot_from_table(ARM).start):
        with pytest.raises(ValueError, match="read-only"):
            start[0] = 1.0


@pytest.mark.parametrize("scenario", list_scenarios())
def test_an_arm_from_a_urdf_starts_with_room_in_every_scenario(scenario: str) -> None:
    made = tc.configuration(scenario, robot=ANY_ARM, geometry=["tip=tool0"])
    robot = tc.load_robot(ANY_ARM, tip="tool0")
    start = made.group("slave").start_of(robot)
    assert min(
        freedom.freedom(robot, start)[1], freedom.freedom(robot, start)[0] / freedom.lever(robot)
    ) > math.radians(12.0)
    assert not np.allclose(start, robot.home, rtol=0, atol=0.1)


def test_a_posture_that_is_asked_for_is_the_start_of_an_arm_from_a_urdf_too() -> None:
    made = tc.configuration("coarse_box", robot=ANY_ARM, geometry=["tip=tool0"], slave__start=[0.1] * 6)
    assert (made.group("slave").start_of(tc.load_robot(ANY_ARM, tip="tool0")) == 0.1).all()


@pytest.mark.slow
def test_an_arm_from_a_urdf_follows_the_coarse_box_without_settings() -> None:
    score = tc.run("coarse_box", robot=ANY_ARM, geometry=["tip=tool0"]).score()
    assert score.verdict.is_good, score.verdict
    assert present(score.reach.followed_share) > 0.999
