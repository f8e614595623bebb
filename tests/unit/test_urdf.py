"""URDFs of all robots load in a physics engine, which places their links as their bodies are."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest

import teleop_core as tc
from teleop_core.cli import main
from teleop_core.kernels.geometry import rotations_from_quaternions
from teleop_core.robots.bodies import bodies_of, urdf_of

ROUNDING = 1e-7  # of angles that went through roll, pitch and yaw near the pole


def relative(parent: np.ndarray, child: np.ndarray) -> np.ndarray:
    """Pose (7,), x to z, quaternion x, y, z, w, of a child in its parent's frame."""
    turn = rotations_from_quaternions(parent[3:])
    rotation = turn.T @ rotations_from_quaternions(child[3:])
    quaternion = pinocchio.Quaternion(rotation).coeffs()
    return np.concatenate((turn.T @ (child[:3] - parent[:3]), quaternion))


def placed(xml: str, joints: dict[str, float], poses: dict[str, np.ndarray]) -> dict[str, object]:
    """Placements of all links by Pinocchio, with joints by name and floating links where told."""
    model = pinocchio.buildModelFromXML(xml)
    tree = {j.get("name"): j for j in ElementTree.fromstring(xml).iter("joint")}
    q = pinocchio.neutral(model)
    for index in range(1, model.njoints):
        name, at = model.names[index], model.joints[index].idx_q
        if tree[name].get("type") == "floating":
            ends = [tree[name].find(end).get("link") for end in ("parent", "child")]
            q[at : at + 7] = relative(*(poses[end] for end in ends))
        else:
            q[at] = joints[name]
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, q)
    return {frame.name: data.oMf[i] for i, frame in enumerate(model.frames)}


@pytest.mark.parametrize("name", tc.list_robots())
def test_an_engine_places_every_link_where_the_body_is(name: str) -> None:
    robot = tc.load_robot(name)
    bodies, xml = bodies_of(robot), urdf_of(robot, prefix="left/slave_")
    width = 0.1 * (robot.upper - robot.lower)
    for q in np.random.default_rng(7).uniform(-width, width, (5, robot.n)) + robot.home:
        joints = {f"left/slave_{n}": v for n, v in zip(robot.joint_names, q, strict=True)}
        poses = {f"left/slave_{n}": p for n, p in zip(bodies.names, bodies.poses(q), strict=True)}
        found = placed(xml, joints, poses)
        for link, pose in poses.items():
            expected = rotations_from_quaternions(pose[3:])
            assert found[link].translation == pytest.approx(pose[:3], abs=ROUNDING)
            assert found[link].rotation == pytest.approx(expected, abs=ROUNDING)


@pytest.mark.parametrize("name", ["rcrt1", "puma560", "scara", "planar_3r", "five_axis"])
def test_all_joints_of_a_serial_robot_are_real_with_its_limits(name: str) -> None:
    robot = tc.load_robot(name)
    model = pinocchio.buildModelFromXML(urdf_of(robot))
    assert tuple(model.names)[1:] == robot.joint_names
    assert model.lowerPositionLimit == pytest.approx(robot.lower, abs=0.0)
    assert model.upperPositionLimit == pytest.approx(robot.upper, abs=0.0)
    assert model.velocityLimit == pytest.approx(robot.drives.speed_limit, abs=0.0)
    assert model.effortLimit == pytest.approx(robot.drives.effort_limit, abs=0.0)


def test_a_robot_with_loops_keeps_the_joints_that_move_one_body() -> None:
    kinds = {}
    for name in ("mma", "three_finger_hand", "scara_stewart"):
        xml = ElementTree.fromstring(urdf_of(tc.load_robot(name)))
        kinds[name] = {j.get("name"): j.get("type") for j in xml.iter("joint")}
    assert all(kinds["mma"][joint] == "revolute" for joint in tc.load_robot("mma").joint_names)
    assert kinds["mma"]["link4_joint"] == "floating"
    hand = tc.load_robot("three_finger_hand").joint_names
    assert all(kinds["three_finger_hand"][joint] == "revolute" for joint in hand)
    assert kinds["scara_stewart"]["d3"] == "prismatic"
    assert kinds["scara_stewart"]["platform_joint"] == "floating"


def test_every_solid_of_a_body_is_drawn() -> None:
    robot = tc.load_robot("rcrt1")
    xml = ElementTree.fromstring(urdf_of(robot, "arm"))
    assert xml.get("name") == "arm"
    shapes = {"capsule": 3, "cylinder": 1, "sphere": 1, "box": 1}
    for body in bodies_of(robot).bodies:
        visuals = xml.findall(f"./link[@name='{body.name}']/visual")
        assert len(visuals) == sum(shapes[solid.kind] for solid in body.solids)


def test_the_command_writes_what_an_engine_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "arm.urdf"
    assert main(["robot", "rcrt1", "--geometry", "L6=0.05", "--urdf", str(out)]) == 0
    assert str(out) in capsys.readouterr().out
    assert out.read_text(encoding="utf-8") == urdf_of(tc.load_robot("rcrt1", L6=0.05))
    assert pinocchio.buildModelFromUrdf(str(out)).nq == 6
