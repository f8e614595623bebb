"""Master bridge: a device's poses, buttons and forces, against scipy's rotations."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from present import present
from teleop_core.base import build
from teleop_core.hand.master import master_bridge
from teleop_core.kernels.axes import AXES
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot

MASTERS = sorted((Path(__file__).parents[2] / "config" / "masters").glob("*.yaml"))
NOW_NS = 1_700_000_000_000_000_000
TURNED = ("+y", "+z", "+x")
ROWS = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])  # of TURNED


def frames() -> Iterator[tuple[str, str, str]]:
    """All right-handed triples of axes."""
    for x in AXES:
        for y in AXES:
            for z in AXES:
                if rows((x, y, z)) is not None:
                    yield x, y, z


def rows(axes: tuple[str, str, str]) -> Any:
    matrix = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        matrix[row, "xyz".index(axis[1])] = -1.0 if axis[0] == "-" else 1.0
    return matrix if np.linalg.det(matrix) == 1.0 else None


FRAMES = list(frames())


def bridge(**values: Any) -> master_bridge.MasterBridge:
    return master_bridge.MasterBridge(master_bridge.MasterBridgeParameters(**values))


def pose(place: Any = (0.0, 0.0, 0.0), turn: Rotation | None = None) -> Array:
    turn = Rotation.identity() if turn is None else turn
    return np.array([*place, *turn.as_quat(scalar_first=True)])


def said(stage: master_bridge.MasterBridge) -> tuple[Array, Rotation]:
    found = np.array(stage.signals["master_measured_cp"])
    return found[:3], Rotation.from_quat(found[3:], scalar_first=True)


@given(st.integers(0, 2**32 - 1))
def test_a_pose_is_seen_in_the_axes_of_the_master_in_metres(seed: int) -> None:
    rng = np.random.default_rng(seed)
    base, stylus = (FRAMES[k] for k in rng.integers(0, 24, 2))
    stage = bridge(device_axes=base, stylus_axes=stylus, unit=0.001)
    place, turn = rng.uniform(-200.0, 200.0, 3), Rotation.random(rng=rng)
    assert stage.hear(pose(place, turn), NOW_NS, NOW_NS)
    at, turned = said(stage)
    assert np.allclose(at, 1e-3 * present(rows(base)) @ place, rtol=0, atol=1e-15)
    expected = Rotation.from_matrix(rows(base) @ turn.as_matrix() @ present(rows(stylus)).T)
    assert (turned * expected.inv()).magnitude() < 1e-12


def test_a_force_is_given_along_the_axes_of_the_device_and_never_above_its_bound() -> None:
    stage = bridge(device_axes=TURNED, force_gain=0.5, largest_force=2.0)
    stage.hear(pose(), NOW_NS, NOW_NS)
    for asked in ([1.0, 0.0, 0.0], [0.5, -1.0, 2.0], [30.0, 0.0, -40.0]):
        stage.signals["master_servo_cf"][:3] = asked
        expected: Any
        given_force, expected = stage.force(0.01, NOW_NS), 0.5 * ROWS.T @ asked
        expected *= min(1.0, 2.0 / np.linalg.norm(expected))
        assert np.allclose(given_force, expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("late", ["force", "device", "never", "nan"])
def test_a_device_is_given_no_force_where_either_side_is_silent(late: str) -> None:
    stage = bridge(force_timeout=0.1)
    if late != "never":
        stage.hear(pose(), NOW_NS, NOW_NS)
    stage.signals["master_servo_cf"][0] = np.nan if late == "nan" else 1.0
    now_ns = NOW_NS + (200_000_000 if late == "device" else 0)
    assert not stage.force(0.2 if late == "force" else 0.0, now_ns).any()


WRONG = {
    "nan": (pose((np.nan, 0.0, 0.0)), 0, "form"),
    "no quaternion": (np.zeros(7), 0, "form"),
    "old": (pose(), -200_000_000, "stamp"),
    "ahead": (pose(), 200_000_000, "stamp"),
    "again": (pose(), -10_000_000, "stamp"),
}


@pytest.mark.parametrize(("given_pose", "off_ns", "reason"), WRONG.values(), ids=WRONG)
def test_a_pose_that_is_none_is_refused_counted_and_told_and_a_sound_one_ends_that(
    given_pose: Array, off_ns: int, reason: str
) -> None:
    stage = bridge()
    assert stage.hear(pose((0.1, 0.0, 0.0)), NOW_NS - 10_000_000, NOW_NS)
    before = stage.signals["master_measured_cp"].copy()
    assert not stage.hear(given_pose, NOW_NS + off_ns, NOW_NS)
    assert np.array_equal(stage.signals["master_measured_cp"], before)
    assert stage.refused == {reason: 1}
    assert "messages are refused" in stage.concerns()[0]
    assert stage.hear(pose(), NOW_NS, NOW_NS)
    assert not stage.concerns()


def test_a_device_whose_poses_have_no_stamp_is_told_so_with_the_option_that_does_without() -> None:
    stage = bridge()
    assert not stage.hear(pose(), 0, NOW_NS)
    assert "no stamp; pose_stamps: sent" in stage.concerns()[0]


def test_buttons_are_taken_from_where_they_are_and_missing_ones_are_released() -> None:
    stage = bridge(button_places=(2, -1, 0))
    assert stage.press([1, 1, 0])
    assert stage.signals["master_buttons"].tolist() == [0.0, 0.0, 1.0]
    assert stage.press([0, 0, 1])
    assert stage.signals["master_buttons"].tolist() == [1.0, 0.0, 0.0]
    assert not stage.press([1, 0])
    assert stage.refused == {"buttons": 1}


def test_a_jointed_device_is_where_the_forward_kinematics_of_its_robot_says() -> None:
    robot = load_robot("scara")
    stage = bridge(
        pose_message=master_bridge.POSE_MESSAGES[-1],
        handle="scara",
        device_axes=TURNED,
        handle_joints=[f"{robot.joint_names[0]}=turn"],
        handle_signs=[-1.0] + [1.0] * 3,
    )
    names = ["turn", *robot.joint_names[1:], "gripper"]
    q = robot.home + 0.1
    assert stage.hear_joints(names, [-q[0], *q[1:], 0.0], NOW_NS, NOW_NS)
    at, turned = said(stage)
    T = robot.fk(q)
    assert np.allclose(at, ROWS @ T[:3, 3], rtol=0, atol=1e-12)
    assert np.allclose(turned.as_matrix(), ROWS @ T[:3, :3], rtol=0, atol=1e-12)
    assert not stage.hear_joints(names[1:], [*q[1:], 0.0], NOW_NS + 1, NOW_NS)
    assert "turn" in stage.concerns()[0]
    assert stage.refused == {"names": 1}


# -- known devices ---------------------------------------------------------------------------------


@pytest.mark.parametrize("file", MASTERS, ids=lambda path: path.stem)
def test_the_configuration_of_each_device_has_parameters_that_exist(file: Path) -> None:
    groups = {k: v["ros__parameters"] for k, v in yaml.safe_load(file.read_text()).items()}
    made = build(master_bridge.MasterBridgeParameters, groups["master_bridge"])
    assert made.pose_topic


@pytest.mark.parametrize(
    ("name", "axes", "direction", "turn"),
    [
        ("joy", [0.0, 1.0], (0, 0, -1), (0, 0, 0)),  # left stick pushed away
        ("joy", [1.0, 0.0], (-1, 0, 0), (0, 0, 0)),  # to the left
        ("joy", [0.0, 0.0, 1.0, 0.0, 1.0], (0, 1, 0), (0, 0, 0)),  # up; a trigger is no axis
        ("joy", [0.0, 0.0, 0.0, 1.0], (0, 0, 0), (0, 1, 0)),
        ("spacenav", [1.0], (0, 0, -1), (0, 0, 0)),
        ("spacenav", [0.0, 0.0, 1.0, 0.0, 0.0, 1.0], (0, 1, 0), (0, 1, 0)),
    ],
)
def test_rates_of_a_joy_move_the_stylus_in_the_axes_of_the_master(
    name: str, axes: list[float], direction: tuple[int, ...], turn: tuple[int, ...]
) -> None:
    (file,) = (path for path in MASTERS if path.stem == name)
    given = yaml.safe_load(file.read_text())["master_bridge"]["ros__parameters"]
    stage = master_bridge.MasterBridge(build(master_bridge.MasterBridgeParameters, given))
    axes, held = [*axes, *[0.0] * (8 - len(axes))], [0, 0, 0, 0, 1]

    def after(seconds: float, buttons: list[int], start_ns: int) -> int:
        end_ns = start_ns + round(1e9 * seconds)
        for now_ns in range(start_ns, end_ns, 20_000_000):
            assert stage.hear_joy(axes, buttons, now_ns, now_ns)
        return end_ns

    after(0.02, held, NOW_NS - 20_000_000)
    start = said(stage)[1]
    end_ns = after(1.0, held, NOW_NS)
    place, turned = said(stage)
    assert np.allclose(place, 0.04 * np.array(direction), rtol=0, atol=1e-12)
    assert np.allclose((turned * start.inv()).as_rotvec(), 0.6 * np.array(turn), rtol=0, atol=1e-12)
    if name == "joy":  # nothing moves while the shoulder button is released
        end_ns = after(1.0, [0, 0, 0, 0, 0], end_ns)
        assert np.array_equal(said(stage)[0], place)
    after(10.0, held, end_ns)
    assert np.abs(said(stage)[0]).max() <= 0.1 + 1e-12


def test_a_joy_with_fewer_axes_than_are_named_is_refused_and_moves_nothing() -> None:
    stage = bridge(pose_message="sensor_msgs/msg/Joy")
    assert not stage.hear_joy([1.0, 0.0], [], NOW_NS, NOW_NS)
    assert "fewer than the parameters name" in stage.concerns()[0]
    assert not stage.hear_joy([np.nan] * 6, [], NOW_NS + 1, NOW_NS)
