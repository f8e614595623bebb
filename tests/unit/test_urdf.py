"""URDFs of all robots load in a physics engine, which places their links as their bodies are."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest

import teleop_core as tc
from present import present
from teleop_core.commands.cli import main
from teleop_core.kernels.geometry import rotations_from_quaternions
from teleop_core.robots.arms import rcrt1_dynamics
from teleop_core.robots.bodies import Solid, bodies_of, urdf_of
from teleop_core.robots.dynamics.chain_dynamics import inertia_matrix

pytestmark = pytest.mark.filterwarnings("ignore::teleop_core.TeleopWarning")
ROUNDING = 1e-9
SERIAL = ("rcrt1", "puma560", "scara", "planar_3r", "five_axis", "parallelogram")
EXAMPLE = str(Path(__file__).parents[2] / "examples" / "any_arm.urdf")


def relative(parent: np.ndarray, child: np.ndarray) -> np.ndarray:
    """Pose (7,), x to z, quaternion x, y, z, w, of a child in its parent's frame."""
    turn = rotations_from_quaternions(parent[3:])
    rotation = turn.T @ rotations_from_quaternions(child[3:])
    quaternion = pinocchio.Quaternion(rotation).coeffs()
    return np.concatenate((turn.T @ (child[:3] - parent[:3]), quaternion))


def placed(xml: str, joints: dict[str, float], poses: dict[str, np.ndarray]) -> dict[str, Any]:
    """Placements of all links by Pinocchio, with joints by name and floating links where told."""
    model = pinocchio.buildModelFromXML(xml, True)  # with joints that follow others
    tree = {j.get("name"): j for j in ElementTree.fromstring(xml).iter("joint")}
    q = pinocchio.neutral(model)
    for index in range(1, model.njoints):
        name, at = model.names[index], model.joints[index].idx_q
        if tree[name].get("type") == "floating":
            ends = [present(present(tree[name].find(end)).get("link")) for end in ("parent", "child")]
            q[at : at + 7] = relative(*(poses[end] for end in ends))
        elif tree[name].find("mimic") is None:
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


@pytest.mark.parametrize("name", SERIAL)
def test_our_own_reader_finds_the_same_tip_and_limits(name: str, tmp_path: Path) -> None:
    robot, path = tc.load_robot(name), tmp_path / "arm.urdf"
    path.write_text(urdf_of(robot))
    read = tc.load_robot(str(path), tip="tip")
    assert read.joint_names == robot.joint_names
    np.testing.assert_array_equal(read.limits(1.0), robot.limits(1.0))
    np.testing.assert_array_equal(present(read.drives).effort_limit, present(robot.drives).effort_limit)
    q = np.random.default_rng(3).uniform(robot.lower, robot.upper, (200, robot.n))
    np.testing.assert_allclose(read.fk(q), robot.fk(q), rtol=0.0, atol=1e-9)


def read_model(robot: tc.Robot) -> pinocchio.Model:
    return pinocchio.buildModelFromXML(urdf_of(robot), True)


@pytest.mark.parametrize("d2", [0.0, 0.05])
def test_the_inertia_and_weight_of_the_rcrt1_are_those_of_its_equations(d2: float) -> None:
    robot, D, weight = tc.load_robot("rcrt1", d2=d2), np.empty((3, 3)), np.empty(6)
    model, row = read_model(robot), present(robot.dynamics).parameters.copy()
    motors = [rcrt1_dynamics.LINKS[f"J{i}"] for i in range(1, 4)]  # no URDF holds these
    for q in np.random.default_rng(4).uniform(robot.lower, robot.upper, (200, 6)):
        rcrt1_dynamics.inertia_matrix(q, row, D)
        found = pinocchio.crba(model, model.createData(), q)
        found = np.triu(found) + np.triu(found, 1).T
        found = found[:3, :3] + np.diag(motors)
        if d2 == 0.0:
            np.testing.assert_allclose(found, D, rtol=0.0, atol=1e-9)
        # The published equations leave out the offset, by which links 2 and 3 are off axis 1.
        beside = (rcrt1_dynamics.LINKS["m2"] + rcrt1_dynamics.LINKS["m3"]) * d2**2
        assert found[0, 0] == pytest.approx(D[0, 0] + beside, abs=1e-9)
        present(robot.dynamics).gravity(q, row, weight)
        found = pinocchio.computeGeneralizedGravity(model, model.createData(), q)
        np.testing.assert_allclose(found, weight, rtol=0.0, atol=1e-9)


def test_an_arm_of_links_is_written_with_the_links_that_were_read() -> None:
    robot = tc.load_robot(EXAMPLE, tip="tool0", dynamics="links")
    model, row = read_model(robot), present(robot.dynamics).parameters.copy()
    row[-6:] = 0.0  # the motors
    M, weight = np.empty((6, 6)), np.empty(6)
    for q in np.random.default_rng(5).uniform(robot.lower, robot.upper, (50, 6)):
        inertia_matrix(q, row, M)
        found = pinocchio.crba(model, model.createData(), q)
        np.testing.assert_allclose(np.triu(found), np.triu(M), rtol=0.0, atol=1e-9)
        present(robot.dynamics).gravity(q, row, weight)
        found = pinocchio.computeGeneralizedGravity(model, model.createData(), q)
        np.testing.assert_allclose(found, weight, rtol=0.0, atol=1e-9)


def of_solid(solid: Solid) -> pinocchio.Inertia:
    """Pinocchio's own inertia of a solid of unit density, in the frame of its body."""
    shape, a = solid.kind, solid.size
    volume = {
        "box": lambda: a[0] * a[1] * a[2],
        "sphere": lambda: 4 / 3 * np.pi * a[0] ** 3,
        "cylinder": lambda: np.pi * a[0] ** 2 * a[1],
        "capsule": lambda: np.pi * a[0] ** 2 * (a[1] + 4 / 3 * a[0]),
    }[shape]()
    found = getattr(pinocchio.Inertia, f"From{shape.capitalize()}")(volume, *a)
    turn = rotations_from_quaternions(solid.pose[3:])
    return found.se3Action(pinocchio.SE3(turn, solid.pose[:3]))


@pytest.mark.parametrize("name", [n for n in tc.list_robots() if n != "rcrt1"])
def test_bodies_without_known_masses_are_uniform_and_the_file_says_so(name: str) -> None:
    robot = tc.load_robot(name)
    xml = urdf_of(robot)
    assert "Inertias are assumed" in xml
    links = {link.get("name"): link for link in ElementTree.fromstring(xml).iter("link")}
    for body in bodies_of(robot).bodies[1:]:
        lone = pinocchio.buildModelFromXML(alone(links[body.name]))
        expected = sum(map(of_solid, body.solids), pinocchio.Inertia.Zero())
        expected = 1000.0 * expected.toPseudoInertia().toMatrix()
        found = lone.inertias[1].toPseudoInertia().toMatrix()
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12 * expected[3, 3])
        assert found[3, 3] > 0.0


def alone(link: ElementTree.Element) -> str:
    joint = '<joint name="j" type="floating"><parent link="w"/><child link="{}"/></joint>'
    text = ElementTree.tostring(link, encoding="unicode")
    return f'<robot name="r"><link name="w"/>{text}{joint.format(link.get("name"))}</robot>'


def test_no_link_of_the_rcrt1_weighs_nothing_without_a_word() -> None:
    xml = urdf_of(tc.load_robot("rcrt1"))
    links = ElementTree.fromstring(xml).findall("link")
    assert [x.get("name") for x in links if x.find("inertial") is not None] == ["link1", "link2", "link3"]
    assert "None of link4, link5, link6, tip: others hold their masses." in xml


@pytest.mark.parametrize("name", tc.list_robots())
def test_what_is_seen_is_what_collides(name: str) -> None:
    for link in ElementTree.fromstring(urdf_of(tc.load_robot(name))).iter("link"):
        seen, solid = (
            [
                [ElementTree.tostring(part).strip() for part in shape if part.tag != "material"]
                for shape in link.findall(what)
            ]
            for what in ("visual", "collision")
        )
        assert seen == solid


def test_a_body_that_follows_one_joint_is_a_mimic_and_one_of_two_joints_floats() -> None:
    xml = ElementTree.fromstring(urdf_of(tc.load_robot("parallelogram")))
    followers = {j.get("name"): j.find("mimic") for j in xml.iter("joint")}
    coupler, rocker = followers["theta1_coupler"], followers["theta1_rocker"]
    assert (present(coupler).get("joint"), float(present(present(coupler).get("multiplier")))) == ("theta1", -1.0)
    assert (present(rocker).get("joint"), float(present(present(rocker).get("multiplier")))) == ("theta1", 1.0)
    for name, floats in (("mma", 2), ("four_bar", 2)):
        xml = ElementTree.fromstring(urdf_of(tc.load_robot(name)))
        assert sum(j.get("type") == "floating" for j in xml.iter("joint")) == floats
        assert xml.find(".//mimic") is None


@pytest.mark.parametrize("name", SERIAL)
def test_mujoco_builds_its_model_of_every_serial_arm(name: str, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    robot = tc.load_robot(name)
    model = mujoco.MjModel.from_xml_string(urdf_of(robot))
    assert model.nv >= robot.n
    assert (model.body_mass[1:] > 0.0).all()


def test_every_solid_of_a_body_is_drawn() -> None:
    robot = tc.load_robot("rcrt1")
    xml = ElementTree.fromstring(urdf_of(robot, "arm"))
    assert xml.get("name") == "arm"
    shapes = {"capsule": 3, "cylinder": 1, "sphere": 1, "box": 1}
    for body in bodies_of(robot).bodies:
        visuals = xml.findall(f"./link[@name='{body.name}']/visual")
        assert len(visuals) == sum(shapes[solid.kind] for solid in body.solids)


def test_the_command_writes_what_an_engine_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "arm.urdf"
    assert main(["robot", "rcrt1", "--geometry", "L6=0.05", "--urdf", str(out)]) == 0
    assert str(out) in capsys.readouterr().out
    assert out.read_text(encoding="utf-8") == urdf_of(tc.load_robot("rcrt1", L6=0.05))
    assert pinocchio.buildModelFromUrdf(str(out)).nq == 6
