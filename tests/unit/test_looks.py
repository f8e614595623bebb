"""Looks: meshes of a URDF in the frames of the robot's bodies, and files that are not read."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import pinocchio
import pytest
import trimesh

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import rotations_from_quaternions
from teleop_core.robots import load_robot
from teleop_core.robots.bodies import bodies_of
from teleop_core.robots.bodies.looks import fingers_of, looks_of
from teleop_core.robots.files.visuals import mesh_file

TEXT = (Path(__file__).parents[2] / "examples" / "any_arm.urdf").read_text(encoding="utf-8")
CORNERS = np.array([(0, 0, 0), (30, 0, 0), (0, 20, 0), (0, 0, 10)], np.float64)  # mm
FACES: Any = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
LINKS = ("base", "column", "upper_arm", "forearm", "wrist_1", "wrist_2", "flange", "camera")


def visual(link: str, name: str) -> str:
    """A mesh that lies askew in a link, another way in each."""
    k = LINKS.index(link)
    origin = f'<origin xyz="0.0{k} 0.02 -0.1" rpy="{0.3 * k} -0.5 1"/>'
    mesh = f'<mesh filename="{name}" scale="0.001 0.002 0.001"/>'
    return f"<visual>{origin}<geometry>{mesh}</geometry></visual>"


def arm(folder: Path, name: str = "package://some_arm/meshes/part.stl", links: Sequence[str] = LINKS) -> Path:
    """The example as a package with a mesh at some links; path of its URDF."""
    for part in ("urdf", "meshes"):
        (folder / "some_arm" / part).mkdir(parents=True)
    trimesh.Trimesh(CORNERS, FACES).export(folder / "some_arm" / "meshes" / "part.stl")
    text = TEXT.replace('<link name="base"/>', '<link name="base"></link>')
    for link in links:
        text = text.replace(f'<link name="{link}">', f'<link name="{link}">{visual(link, name)}')
    path = folder / "some_arm" / "urdf" / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("middle", [0.0, 1.0])
def test_meshes_are_where_pinocchio_has_them_at_any_posture(middle: float, tmp_path: Path) -> None:
    path = arm(tmp_path)
    if middle:  # home of a joint without 0 in its limits is another posture than zero
        path.write_text(path.read_text().replace('lower="-2.6" upper', 'lower="0.4" upper'))
    robot = load_robot(str(path), tip="tool0")
    bodies, looks = bodies_of(robot), looks_of(robot)
    model = pinocchio.buildModelFromUrdf(str(path))
    kind = pinocchio.GeometryType.VISUAL
    solids = pinocchio.buildGeomFromUrdf(model, str(path), kind, package_dirs=[str(tmp_path)])
    data, placed = model.createData(), solids.createData()
    for q in np.random.default_rng(3).uniform(robot.lower, robot.upper, (5, robot.n)):
        pinocchio.updateGeometryPlacements(model, data, solids, placed, np.r_[q[:5], np.cos(q[5]), np.sin(q[5])])
        expected = [T.act(corner * (0.001, 0.002, 0.001)) for T in placed.oMg for corner in CORNERS]
        poses = bodies.poses(q)
        found = np.concatenate(
            [
                look.mesh[0] @ rotations_from_quaternions(poses[body, None, 3:])[0].T + poses[body, :3]
                for body, (look,) in looks.items()
            ]
        )
        found = np.unique(found.round(9), axis=0)
        np.testing.assert_allclose(found, np.unique(np.round(expected, 9), axis=0), atol=2e-9)


def test_plain_shapes_are_drawn_too_and_a_length_in_millimetres_is_read_as_such(tmp_path: Path) -> None:
    path = arm(tmp_path, links=())
    ball = '<visual><geometry><sphere radius="0.04"/></geometry></visual>'
    inch = '<visual><geometry><mesh filename="../meshes/part.dae"/></geometry></visual>'
    text = path.read_text().replace('"base"></link>', f'"base">{ball}{inch}</link>')
    path.write_text(text)
    part = cast(bytes, trimesh.Trimesh(CORNERS + 100.0, FACES).export(file_type="dae")).decode()
    assert "<asset>" in part
    unit = '<unit name="millimeter" meter="0.001"/>'
    meshes = path.parents[1] / "meshes"
    (meshes / "part.dae").write_text(part.replace("<up_axis>", f"{unit}<up_axis>"))
    ((look,),) = looks_of(load_robot(str(path), tip="tool0")).values()
    vertices, _ = look.mesh
    np.testing.assert_allclose(vertices.max(axis=0), [0.13, 0.12, 0.11], atol=1e-6)
    np.testing.assert_allclose(vertices.min(axis=0), [-0.04] * 3, atol=1e-6)


@pytest.mark.parametrize("name", ["../meshes/gone.stl", "package://other_arm/gone.stl"])
def test_a_mesh_that_is_not_there_is_told_by_its_link_and_the_link_is_drawn_as_solids(
    name: str, tmp_path: Path
) -> None:
    robot = load_robot(str(arm(tmp_path, name, ["forearm"])), tip="tool0")
    with pytest.warns(UserWarning, match=r"link forearm is drawn without: mesh is '.*gone.stl'"):
        assert looks_of(robot) == {}


def test_a_mesh_that_is_broken_is_told_by_its_link(tmp_path: Path) -> None:
    path = arm(tmp_path, links=["forearm"])
    (path.parents[1] / "meshes" / "part.stl").write_bytes(b"solid what")
    with pytest.warns(UserWarning, match="link forearm is drawn without"):
        assert looks_of(load_robot(str(path), tip="tool0")) == {}


def test_no_file_is_read_outside_the_package_and_none_that_is_no_mesh(tmp_path: Path) -> None:
    deep = tmp_path / "a" / "b" / "c" / "d" / "e"
    path = arm(deep)
    assert mesh_file("package://some_arm/meshes/part.stl", path).name == "part.stl"
    assert mesh_file("../meshes/part.stl", path).name == "part.stl"
    outside = tmp_path / "secret.stl"
    outside.write_text("solid")
    (path.parents[1] / "meshes" / "link.stl").symlink_to(outside)
    up = "../" * 20
    for name in (
        f"file://{outside}",
        str(outside),
        f"{up}{outside}",
        f"package://some_arm/{up}{outside}",
        f"package://{up}{outside}",
        "package://some_arm/meshes/link.stl",
        "../urdf/arm.urdf",
        "package://",
        "",
    ):
        with pytest.raises(ParameterError, match=r"^mesh is "):
            mesh_file(name, path)


MY_ARM = Path(__file__).parents[2] / "examples" / "my_arm.urdf"


def test_fingers_are_where_pinocchio_has_them_from_the_closed_to_the_open_jaw() -> None:
    robot = load_robot(str(MY_ARM), tip="tool0")
    bodies, fingers = bodies_of(robot), fingers_of(robot)
    assert len(fingers) == 2
    model = pinocchio.buildModelFromUrdf(str(MY_ARM))
    solids = pinocchio.buildGeomFromUrdf(model, str(MY_ARM), pinocchio.GeometryType.VISUAL)
    data, placed = model.createData(), solids.createData()
    q = np.array([0.3, -0.4, 0.9, 0.2, -0.5, 0.7])
    poses = bodies.poses(q)
    for share in (0.0, 0.5, 1.0):
        gap = 0.04 * share  # a finger; the other one mimics it
        full = pinocchio.neutral(model)
        for name, value in (
            *zip(robot.joint_names, q, strict=True),
            ("left_finger_joint", gap),
            ("right_finger_joint", gap),
        ):
            joint = model.joints[model.getJointId(name)]
            full[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        pinocchio.updateGeometryPlacements(model, data, solids, placed, full)
        for finger in fingers:
            turn = rotations_from_quaternions(poses[finger.body, None, 3:])[0]
            found = turn @ finger.pose(share)[:3] + poses[finger.body, :3]
            assert min(np.linalg.norm(T.translation - found) for T in placed.oMg) < 1e-9


@pytest.mark.parametrize("axis", ["0 1 0", "0 -1 0"])
def test_open_end_of_a_gripper_is_the_one_at_which_its_fingers_are_farther_from_the_tip(
    axis: str, tmp_path: Path
) -> None:
    text = MY_ARM.read_text(encoding="utf-8")
    if axis == "0 -1 0":  # coordinates that grow while the fingers close
        for side in ("left", "right"):
            head, tail = text.split(f'<joint name="{side}_finger_joint"')
            sign = "-" if side == "left" else ""
            tail = tail.replace('xyz="0 1 0"' if side == "left" else 'xyz="0 -1 0"', f'xyz="0 {sign}1 0"', 1)
            tail = tail.replace('lower="0" upper="0.04"', 'lower="-0.04" upper="0"', 1)
            text = f'{head}<joint name="{side}_finger_joint"{tail}'
    path = tmp_path / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    for finger in fingers_of(load_robot(str(path), tip="tool0")):
        assert abs(finger.pose(1.0)[1]) == pytest.approx(0.046)
        assert abs(finger.pose(0.0)[1]) == pytest.approx(0.006)


def test_links_have_the_colours_of_their_materials() -> None:
    robot = load_robot(str(MY_ARM), tip="tool0")
    found = {look.color for looks in looks_of(robot).values() for look in looks}
    assert found == {(0.93, 0.93, 0.90), (0.10, 0.35, 0.60)}
    assert {finger.look.color for finger in fingers_of(robot)} == {(0.85, 0.45, 0.10)}
