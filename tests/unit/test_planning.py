"""Planning: excerpts of paths, maps of axes, placements as parameters, and the walk itself."""

import shlex
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import teleop_core as tc
import teleop_lab as lab
from people import PEOPLE, moves, recorded
from teleop_core.coupling.mapping import gains, inverse_kinematics
from teleop_core.kernels import IS_COMPILED
from teleop_core.robots.freedom import free_postures, freedom
from teleop_core.robots.selection import RobotParameters
from teleop_lab.planning import turns, walk
from teleop_lab.planning.aim import Aim
from teleop_lab.planning.asked import STRETCHES, AskedPath, asked_path
from teleop_lab.planning.placement import Placement

START = tuple(tc.load_robot("puma560").start.tolist())
PUMA = RobotParameters(robot="puma560")
GIVEN = Placement.of(gains.MotionScalingParameters(), PUMA, START)


def path_of(name: str, seconds: float, seed: int = 1) -> AskedPath:
    return asked_path(recorded(*moves(PEOPLE[name], seconds, seed)).bag)


def walker(path: AskedPath, robot: str = "puma560") -> walk.Walker:
    solving = inverse_kinematics.InverseKinematicsParameters(robot=robot)
    return walk.Walker(path, gains.MotionScalingParameters(), solving)


def test_an_excerpt_has_no_more_samples_a_second_than_asked_and_keeps_the_buttons() -> None:
    stamps, poses = moves(PEOPLE["pen"], 20.0)
    pressed = np.zeros((len(stamps), 3))
    pressed[3001:3003, 0] = 1.0
    path = asked_path(recorded(stamps, poses, pressed).bag)
    part = path.excerpt(20.0, 10_000)
    assert 400 <= len(part) <= 404
    assert (np.diff(part.stamp_ns) > 0).all()
    assert np.isin(part.stamp_ns, path.stamp_ns).all()
    assert np.count_nonzero(np.diff(part.buttons[:, 0])) == 2


def test_an_excerpt_of_a_long_path_is_stretches_of_all_of_it() -> None:
    path = path_of("motion_capture", 60.0)
    part = path.excerpt(100.0, 1_000)
    assert len(part) <= 1_000
    gaps = np.diff(part.stamp_ns) > 1_000_000_000
    assert np.count_nonzero(gaps) == STRETCHES - 1
    assert part.time[-1] > 0.95 * path.time[-1]


def test_a_path_that_is_short_enough_is_not_cut() -> None:
    path = path_of("da_vinci_30", 5.0)
    assert path.limited(1_000) is path
    assert len(path.limited(50)) <= 52


def test_stamps_that_come_twice_are_one_sample() -> None:
    stamps, poses = moves(PEOPLE["da_vinci_30"], 5.0)
    stamps[7] = stamps[6]
    path = asked_path(recorded(stamps, poses).bag)
    assert len(path) == len(stamps) - 1
    assert (np.diff(path.stamp_ns) > 0).all()


def test_a_single_pose_is_no_motion() -> None:
    stamps, poses = moves(PEOPLE["da_vinci_30"], 5.0)
    with pytest.raises(tc.RecordingError, match="fewer than two poses"):
        asked_path(recorded(stamps[:1], poses[:1]).bag)


def test_there_are_24_turns_and_all_are_maps_that_parameters_take() -> None:
    assert len(set(turns.turns())) == 24
    for axes in turns.turns():
        gains.MotionScalingParameters(axes=axes)


def test_a_placement_is_the_same_as_file_as_texts_and_as_settings(tmp_path: Path) -> None:
    placement = Placement(
        robot="puma560",
        start=START,
        axes=("+y", "-x", "+z"),
        coarse_gain=0.3,
        fine_gain=0.03,
        rotation_gain=0.25,
        tool_axes=("-x", "+y", "-z"),
        tool_roll=-1.25,
    )
    file = tmp_path / "placement.yaml"
    file.write_text(placement.parameter_file())
    assert yaml.safe_load(file.read_text())["slave"]["ros__parameters"]["start"] == list(START)
    texts = shlex.split(" ".join(shlex.quote(text) for text in placement.texts()))
    ways = ({"files": [file]}, {"texts": texts}, {"settings": placement.settings()})
    for way in ways:
        made = tc.configuration(**way)
        slave = made.group("slave")
        taken = Placement.of(made.group("motion_scaling"), slave, slave.start)
        assert taken == placement


def test_a_placement_that_needs_no_change_is_written_too(tmp_path: Path) -> None:
    found = lab.reach(tc.run("fine_box", duration=2.0), share=0.01)
    assert found.is_given
    file = tmp_path / "reach.yaml"
    file.write_text(found.parameter_file())
    start = found.given.placement.start
    assert tc.configuration(files=[file]).group("slave").start == tuple(start)


def test_a_placement_of_an_arm_leaves_the_other_arms_alone() -> None:
    settings = GIVEN.settings("left") | {"left/motion_scaling.coarse_gain": 0.5}
    made = tc.configuration(arms=["right", "left"], robot="puma560", settings=settings)
    assert made.group("motion_scaling", "left").coarse_gain == 0.5
    assert made.group("motion_scaling").coarse_gain == 1.0


def test_an_aimed_tool_turns_as_the_hand_does_wherever_axes_allow_it() -> None:
    robot, rng = tc.load_robot("puma560"), np.random.default_rng(6)
    tool = robot.fk(robot.start)[:3, :3]
    for axes in turns.turns()[::5]:
        # A stylus that the 24 maps and any roll bring to the tool.
        roll = rng.uniform(-np.pi, np.pi)
        matrix = np.zeros((3, 3))
        for row, axis in enumerate(axes):
            matrix[row, "xyz".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
        turned = Rotation.from_euler("z", roll).as_matrix()
        map_ = Aim(robot, np.array([1.0, 0, 0, 0]), GIVEN).wanted(GIVEN) @ tool.T  # of the axes
        stylus = Rotation.from_matrix(map_ @ tool @ (matrix.T @ turned).T)
        aim = Aim(robot, np.roll(stylus.as_quat(), 1), GIVEN)
        assert aim.misfit(aim.aimed(GIVEN)) <= np.radians(5.0) + 1e-3


def test_no_tool_is_aimed_worse_than_a_cube_allows() -> None:
    robot = tc.load_robot("puma560")
    for stylus in Rotation.random(50, rng=np.random.default_rng(3)):
        aim = Aim(robot, np.roll(stylus.as_quat(), 1), GIVEN)
        # The axis of a tool is nowhere farther than this from one of six; 5 degrees keep the given.
        assert aim.misfit(aim.aimed(GIVEN)) <= np.arccos(3**-0.5) + np.radians(5.1)


def test_a_walk_tells_the_same_of_a_path_that_was_walked_before() -> None:
    walks = walker(path_of("da_vinci_36", 10.0))
    first = walks.walk(GIVEN)
    other = gains.MotionScalingParameters(coarse_gain=3.0, rotation_gain=0.5)
    walks.walk(Placement.of(other, PUMA, START))
    again = walks.walk(GIVEN)
    np.testing.assert_array_equal(first.q, again.q)
    np.testing.assert_array_equal(first.limit, again.limit)
    assert walks.share(GIVEN) == first.share


def test_shares_and_causes_add_up_to_one() -> None:
    walked = walker(path_of("da_vinci_36", 20.0), "rcrt1")
    start = tuple(tc.load_robot("rcrt1").start.tolist())
    found = walked.walk(Placement.of(gains.MotionScalingParameters(), PUMA, start))
    assert found.share < 0.9
    assert abs(found.share + sum(found.causes.values()) - 1.0) < 1e-12


def test_time_for_the_joints_only_helps_a_path_that_is_not_cut() -> None:
    walks = walker(path_of("motion_capture", 20.0))
    slow, fast = (walks.walk(GIVEN, is_cut=False, is_fast=f) for f in (False, True))
    assert slow.share < fast.share
    np.testing.assert_allclose(slow.asked, fast.asked, atol=1e-12)


def test_nothing_moves_over_a_gap_of_the_recording() -> None:
    stamps, poses = moves(PEOPLE["motion_capture"], 20.0)
    kept = np.r_[0:700, 1300:2000]  # six seconds are missing
    walks = walker(asked_path(recorded(stamps[kept], poses[kept]).bag))
    asked = walks.walk(GIVEN).asked
    assert np.abs(asked[700, :3] - asked[699, :3]).max() < 2e-3
    assert np.abs(poses[1300, :3] - poses[699, :3]).max() > 0.05


@pytest.mark.skipif(not IS_COMPILED, reason="looks at 100 000 poses")
def test_free_postures_begin_with_the_start_and_have_room() -> None:
    robot = tc.load_robot("rcrt1")
    postures = free_postures(robot, 8)
    np.testing.assert_array_equal(postures[0], robot.start)
    freedoms = [min(freedom(robot, q)) for q in postures]
    assert len(postures) == 8
    assert min(freedoms) > 0.05
