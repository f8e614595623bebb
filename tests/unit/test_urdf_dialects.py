"""URDF files of other tools: what ROS and other readers understand is read as they do, or a note tells it."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import teleop_core as tc
from present import present
from teleop_core.robots.bodies.looks import looks_of

LIMIT = '<limit lower="-2" upper="2" effort="60" velocity="2.5"/>'
FIRST, SECOND = '<origin xyz="0 0 0.2"/>', '<origin xyz="0.3 0 0" rpy="0.4 -0.7 1.1"/>'
JOINT = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>{}<axis xyz="{}"/>{}</joint>'
JOINTS = (
    ("turn", "revolute", "floor", "turret", FIRST, "0 0 1", LIMIT),
    ("lift", "revolute", "turret", "boom", SECOND, "0 1 0", LIMIT),
    ("slide", "prismatic", "boom", "hook", "", "1 0 0", LIMIT),
)
ARM = (
    '<robot name="bench" version="1.0">'
    + "".join(f'<link name="{name}"/>' for name in ("floor", "turret", "boom", "hook"))
    + "".join(JOINT.format(*joint) for joint in JOINTS)
    + "</robot>"
)
VISUAL = '<link name="boom"><visual><origin xyz="0 0 0.1"/><geometry>{}</geometry></visual></link>'


def loaded(tmp_path: Path, *changes: tuple[str, str], tip: str = "hook") -> tc.Robot:
    text = ARM
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    return tc.load_robot(str(path), tip=tip)


pytestmark = pytest.mark.filterwarnings("ignore::teleop_core.TeleopWarning")
TURN = Rotation.from_euler("xyz", [0.4, -0.7, 1.1])
QUATERNION = " ".join(f"{value:.9f}" for value in TURN.as_quat())


@pytest.mark.parametrize("version", ["1.1", "1.2", "2.0"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_quaternion_of_an_origin_is_the_same_rotation_as_its_rpy(version: str, sign: float, tmp_path: Path) -> None:
    own = " ".join(f"{sign * value:.9f}" for value in TURN.as_quat())
    newer = loaded(tmp_path, ('version="1.0"', f'version="{version}"'), ('rpy="0.4 -0.7 1.1"', f'quat_xyzw="{own}"'))
    q = [0.3, -0.5, 0.2]
    np.testing.assert_allclose(newer.fk(q), loaded(tmp_path).fk(q), atol=1e-8)
    assert not newer.notes


@pytest.mark.parametrize("version", [' version="1.0"', ""])
def test_a_quaternion_in_a_file_of_the_first_version_is_ignored_with_a_note(version: str, tmp_path: Path) -> None:
    changes = [(' version="1.0"', version), ('rpy="0.4 -0.7 1.1"', f'quat_xyzw="{QUATERNION}"')]
    robot = loaded(tmp_path, *changes)
    plain = loaded(tmp_path, (' rpy="0.4 -0.7 1.1"', ""))
    np.testing.assert_array_equal(robot.fk([0.3, -0.5, 0.2]), plain.fk([0.3, -0.5, 0.2]))
    assert any("quat_xyzw of joint lift is ignored" in note for note in robot.notes)


def test_a_capsule_is_drawn_with_its_half_spheres(tmp_path: Path) -> None:
    robot = loaded(tmp_path, ('<link name="boom"/>', VISUAL.format('<capsule radius="0.04" length="0.2"/>')))
    (visual,) = robot.visuals
    assert (visual.kind, visual.size) == ("capsule", (0.04, 0.2))
    ((look,),) = looks_of(robot).values()
    vertices, _ = look.mesh
    turned = np.ptp(np.asarray(vertices, dtype=np.float64), axis=0)
    width = np.sort(turned)
    assert turned.max() <= 0.2 + 2 * 0.04 + 1e-9
    assert width[0] >= 2 * 0.04 * 0.9


@pytest.mark.parametrize(
    "shape", ['<cone radius="0.1"/>', '<box size="1 2"/>', '<mesh filename="a.stl" scale="1 2"/>', ""]
)
def test_a_picture_that_cannot_be_drawn_costs_no_arm_and_is_told(shape: str, tmp_path: Path) -> None:
    robot = loaded(tmp_path, ('<link name="boom"/>', VISUAL.format(shape)))
    assert robot.n == 3
    assert robot.visuals == ()
    assert any("link boom is drawn without" in note for note in robot.notes)


def test_one_number_scales_a_mesh_along_all_axes(tmp_path: Path) -> None:
    mesh = '<mesh filename="cover.stl" scale="{}"/>'
    one = loaded(tmp_path, ('<link name="boom"/>', VISUAL.format(mesh.format("0.001"))))
    three = loaded(tmp_path, ('<link name="boom"/>', VISUAL.format(mesh.format("0.001 0.001 0.001"))))
    assert one.visuals[0].size == three.visuals[0].size == (0.001, 0.001, 0.001)


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize("most", ["1e16", "1e308", "inf", "1.7976931348623157e+308", "100000"])
def test_limits_beyond_anything_are_none_for_every_kind_of_joint(kind: str, most: str, tmp_path: Path) -> None:
    robot = loaded(
        tmp_path,
        ('"lift" type="revolute"', f'"lift" type="{kind}"'),
        (f'0 1 0"/>{LIMIT}', f'0 1 0"/><limit lower="-{most}" upper="{most}" effort="60" velocity="2"/>'),
    )
    assert robot.upper[1] == -robot.lower[1] == (20.0 if kind == "prismatic" else 2.0 * math.pi)
    assert any(note.startswith("lift: ") for note in robot.notes)


@pytest.mark.parametrize("most", ["1e16", "inf", "1e308"])
def test_efforts_and_speeds_beyond_any_drive_are_unknown(most: str, tmp_path: Path) -> None:
    free = f'<limit lower="-2" upper="2" effort="{most}" velocity="{most}"/>'
    robot = loaded(tmp_path, (LIMIT, free))
    unknown = loaded(tmp_path, (LIMIT, '<limit lower="-2" upper="2" effort="0" velocity="0"/>'))
    own, others = present(robot.drives), present(unknown.drives)
    np.testing.assert_array_equal(own.speed_limit, others.speed_limit)
    np.testing.assert_array_equal(own.effort_limit, others.effort_limit)
    assert sum("turn: " in note and "unknown" in note for note in robot.notes) == 2


def test_soft_limits_of_a_continuous_joint_are_kept_and_told(tmp_path: Path) -> None:
    soft = '<safety_controller k_velocity="10" soft_lower_limit="-1.5" soft_upper_limit="1e16"/>'
    changes = [('"lift" type="revolute"', '"lift" type="continuous"'), (f'0 1 0"/>{LIMIT}', f'0 1 0"/>{soft}')]
    robot = loaded(tmp_path, *changes)
    assert (robot.lower[1], robot.upper[1]) == (-1.5, 2.0 * math.pi)
    assert "lift: narrowed to the soft limits of its safety_controller" in robot.notes


def test_an_extension_with_a_prefix_that_nothing_declares_is_no_matter(tmp_path: Path) -> None:
    more = '<gazebo reference="hook"><sensor:camera name="eye" sensor:rate="30"/></gazebo><drake:model/></robot>'
    robot = loaded(tmp_path, ("</robot>", more))
    assert robot.joint_names == ("turn", "lift", "slide")
    spaced = loaded(tmp_path, ('<robot name="bench"', '<robot xmlns="http://ros.org/urdf" name="bench"'))
    np.testing.assert_array_equal(spaced.fk([0.1, 0.2, 0.1]), robot.fk([0.1, 0.2, 0.1]))
