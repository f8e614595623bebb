"""Joints that follow others: what pinocchio makes of the file, and every mistake by its name."""

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest

import teleop_core as tc
from present import present
from random_arms import random_urdf
from teleop_core.kinematics import IkStatus
from teleop_core.robots.arms.as_chain import chain_of
from teleop_core.robots.bodies import bodies_of, urdf_of
from teleop_core.robots.dynamics.followers import follower_inertia

pytestmark = pytest.mark.filterwarnings("ignore::teleop_core.TeleopWarning")
REACHED = (IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR)
SEEDS = range(0, 12, 3)


def followed(seed: int, *, is_upstream: bool = False) -> Any:
    """Random chain in which some joints follow others: text, tip, leader, factor, offset by name.

    A leader may lie behind its followers, and a follower may lead; upstream, leaders come first
    and do not follow, as pinocchio's own reader needs it.
    """
    text, tip = random_urdf(seed, 4 + seed % 7)
    root, rng, found = ElementTree.fromstring(text), np.random.default_rng(1000 + seed), {}
    chain = [j for j in root.iter("joint") if present(j.get("name")).startswith("to_l")]
    moving: Any = [j.get("name") for j in chain if j.get("type") != "fixed"]
    order: Any = moving if is_upstream else list(rng.permutation(moving))
    for i, name in list(enumerate(order))[1:]:
        leaders: Any = [n for n in order[:i] if not (is_upstream and n in found)]
        if rng.random() < 0.45:
            leader, factor = str(rng.choice(leaders)), float(rng.uniform(0.3, 2.0))
            factor *= float(rng.choice([-1.0, 1.0]))
            found[name] = (leader, factor, float(rng.uniform(-0.2, 0.2)))
    if not found:
        found[order[-1]] = (order[0], -0.7, 0.1)
    for joint in chain:
        if joint.get("name") in found:
            leader, factor, offset = found[joint.get("name")]
            texts = {"multiplier": repr(factor), "offset": repr(offset)}
            ElementTree.SubElement(joint, "mimic", texts, joint=leader)
        limit = present(joint.find("limit"))
        for key, value in (("lower", "-3.1"), ("upper", "3.0"), ("effort", "1e5")):
            limit.set(key, value)
    return ElementTree.tostring(root, encoding="unicode"), tip, found


def free(text: str) -> str:
    """The same file without mimic, and so with all joints free."""
    return re.sub(r"<mimic[^>]*/>", "", text)


def mixing(robot: tc.Robot, names: list[str], found: dict[str, tuple[Any, ...]]) -> tuple[Any, ...]:
    """A (m, n) and b (m,) of the motions ``names`` of the joints of a robot."""
    A, b = np.zeros((len(names), robot.n)), np.zeros(len(names))
    for row, name in enumerate(names):
        factor, leader = 1.0, name
        while leader in found:
            leader, own, offset = found[leader]
            b[row] += factor * offset
            factor *= own
        A[row, robot.joint_names.index(leader)] = factor
    return A, b


def reduced(text: str, tip: str) -> pinocchio.Model:
    """Pinocchio's model of all joints to the tip, free, the branches at zero."""
    whole = pinocchio.buildModelFromXML(free(text).replace("continuous", "revolute"))
    held = [whole.getJointId(n) for n in whole.names if n.startswith("to_b")]
    return pinocchio.buildReducedModel(whole, held, pinocchio.neutral(whole))


@pytest.mark.parametrize("seed", SEEDS)
def test_pose_and_jacobian_are_those_of_the_chain_through_its_map(seed: int, tmp_path: Path) -> None:
    text, tip, found = followed(seed)
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    robot, model = tc.load_robot(str(path), tip=tip), reduced(text, tip)
    assert not set(robot.joint_names) & set(found)
    A, b = mixing(robot, list(model.names)[1:], found)
    assert robot.n == model.nv - len(found)
    data, frame = model.createData(), model.getFrameId(tip)
    for q in np.random.default_rng(seed).uniform(robot.lower, robot.upper, (20, robot.n)):
        pinocchio.framesForwardKinematics(model, data, A @ q + b)
        np.testing.assert_allclose(robot.fk(q), data.oMf[frame].homogeneous, atol=1e-9)
        axes = pinocchio.LOCAL_WORLD_ALIGNED
        J = pinocchio.computeFrameJacobian(model, data, A @ q + b, frame, axes) @ A
        np.testing.assert_allclose(robot.jacobian(q), J, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_efforts_inertia_and_accelerations_are_those_of_the_chain_through_its_map(seed: int, tmp_path: Path) -> None:
    text, tip, found = followed(seed)
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    robot = tc.load_robot(str(path), tip=tip, dynamics="links")
    model, row, n = reduced(text, tip), present(robot.dynamics).parameters.copy(), robot.n
    A, b = mixing(robot, list(model.names)[1:], found)
    rng, data = np.random.default_rng(seed), model.createData()
    q, (dq, given) = rng.uniform(robot.lower, robot.upper), rng.normal(size=(2, n))
    M, weight, ddq, whole = np.empty((n, n)), np.empty(n), np.empty(n), A @ q + b
    follower_inertia(q, row, M)
    inertia = pinocchio.crba(model, data, whole)
    inertia = A.T @ (np.triu(inertia) + np.triu(inertia, 1).T) @ A
    np.testing.assert_allclose(M, inertia, rtol=0.0, atol=1e-9 * inertia.max())
    present(robot.dynamics).gravity(q, row, weight)
    expected = A.T @ pinocchio.computeGeneralizedGravity(model, data, whole)
    np.testing.assert_allclose(weight, expected, rtol=0.0, atol=1e-9 * (1 + abs(expected).max()))
    present(robot.dynamics).acceleration(q, dq, given, row, ddq)
    effort = A.T @ pinocchio.rnea(model, data, whole, A @ dq, A @ ddq)
    np.testing.assert_allclose(effort, given, rtol=0.0, atol=1e-8 * (1 + abs(weight).max()))


@pytest.mark.parametrize("seed", SEEDS)
def test_pinocchios_own_reader_of_mimic_agrees(seed: int, tmp_path: Path) -> None:
    text, tip, _ = followed(seed, is_upstream=True)
    text = text.replace('type="continuous"', 'type="revolute"')
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    robot = tc.load_robot(str(path), tip=tip, dynamics="links")
    whole = pinocchio.buildModelFromXML(text, True)
    q = np.random.default_rng(seed).uniform(robot.lower, robot.upper)
    theirs, data = pinocchio.neutral(whole), whole.createData()
    columns = [whole.joints[whole.getJointId(name)].idx_v for name in robot.joint_names]
    theirs[columns] = q
    frame = whole.getFrameId(tip)
    pinocchio.framesForwardKinematics(whole, data, theirs)
    np.testing.assert_allclose(robot.fk(q), data.oMf[frame].homogeneous, atol=1e-9)
    # By their inverse dynamics: crba of pinocchio 4.1 does not agree with it where joints mimic.
    still, M, row = (np.zeros(whole.nv), np.empty((robot.n, robot.n)), present(robot.dynamics).parameters)
    weight = pinocchio.rnea(whole, data, theirs, still, still).copy()
    rises = [pinocchio.rnea(whole, data, theirs, still, e).copy() for e in np.eye(whole.nv)]
    inertia = np.array(rises)[np.ix_(columns, columns)] - weight[columns]
    follower_inertia(q, row.copy(), M)
    np.testing.assert_allclose(M, inertia, rtol=0.0, atol=1e-9 * inertia.max())
    held = np.empty(robot.n)
    present(robot.dynamics).gravity(q, row.copy(), held)
    expected = weight[columns]
    np.testing.assert_allclose(held, expected, rtol=0.0, atol=1e-9 * (1 + abs(expected).max()))


ARM = """<robot name="r"><link name="base"/><link name="a"/><link name="b"/><link name="c"/>
<link name="d"/><link name="tip"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="50" velocity="3"/></joint>
<joint name="lead" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 0.3"/>
<axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5" effort="50" velocity="3"/>
<dynamics damping="0.5" friction="0.2"/></joint>
<joint name="follow" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0.3 0 0"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="5" velocity="4"/>
<dynamics damping="0.1" friction="0.3"/><mimic joint="lead" multiplier="-2" offset="0.4"/></joint>
<joint name="out" type="prismatic"><parent link="c"/><child link="tip"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.3" effort="50" velocity="1"/></joint>
<joint name="side" type="revolute"><parent link="base"/><child link="d"/><axis xyz="0 0 1"/>
<limit lower="-0.5" upper="0.7" effort="20" velocity="1"/></joint></robot>"""


def loaded(tmp_path: Path, old: str = "", new: str = "", **options: str) -> tc.Robot:
    assert old in ARM
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.replace(old, new, 1) if old else ARM)
    return tc.load_robot(str(path), **({"tip": "tip", "task": "x y z"} | options))


def test_a_leader_keeps_the_limits_speeds_and_friction_of_those_that_follow_it(tmp_path: Path) -> None:
    robot = loaded(tmp_path)
    assert robot.joint_names == ("turn", "lead", "out")
    # -1 <= 0.4 - 2 q <= 2 is -0.8 <= q <= 0.7
    np.testing.assert_allclose(robot.lower, [-2.0, -0.8, 0.0], rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(robot.upper, [2.0, 0.7, 0.3], rtol=0.0, atol=1e-15)
    drives = present(robot.drives)
    assert drives.speed_limit[1] == 2.0  # of 4 at the follower, twice as fast
    assert drives.effort_limit[1] == 50.0
    assert drives.viscous[1] == pytest.approx(0.5 + 0.1 * 2.0**2)
    assert drives.coulomb[1] == pytest.approx(0.2 + 0.3 * 2.0)


def test_a_leader_beside_the_way_is_a_joint_of_the_robot(tmp_path: Path) -> None:
    robot = loaded(tmp_path, 'mimic joint="lead" multiplier="-2"', 'mimic joint="side"')
    assert robot.joint_names == ("turn", "lead", "side", "out")
    np.testing.assert_allclose(robot.upper, [2.0, 1.5, 0.7, 0.3])
    step = np.array([0.0, 0.0, 1e-6, 0.0])
    speed = (robot.fk(robot.home + step) - robot.fk(robot.home - step))[:3, 3] / 2e-6
    np.testing.assert_allclose(robot.jacobian(robot.home)[:3, 2], speed, atol=1e-8)


def test_legal_poses_are_found_and_all_branches_are_solutions(tmp_path: Path) -> None:
    robot = loaded(tmp_path)
    q = np.random.default_rng(3).uniform(robot.lower, robot.upper, (1000, robot.n))
    answers = robot.ik_batch(robot.fk(q))
    assert np.isin(answers.status, REACHED).mean() >= 0.995
    assert ((answers.q >= robot.lower) & (answers.q <= robot.upper)).all()
    near = robot.ik_batch(robot.fk(q), np.clip(q + 0.02, robot.lower, robot.upper))
    assert np.isin(near.status, REACHED).all()
    branches = robot.ik_all(robot.fk(q[0]))
    assert len(branches) >= 1
    for branch in branches:
        np.testing.assert_allclose(robot.fk(branch)[:3, 3], robot.fk(q[0])[:3, 3], atol=1e-9)


@pytest.mark.filterwarnings("ignore:.*directions at once:UserWarning")
def test_a_path_is_followed_by_an_arm_with_followers_in_a_session(tmp_path: Path) -> None:
    path, options = str(tmp_path / "arm.urdf"), ["tip=tip", "task=x y z"]
    Path(path).write_text(re.sub("<dynamics[^>]*/>", "", ARM))  # friction alone would be 1 mm
    recording = tc.run("coarse_box", duration=3.0, robot=path, geometry=options, starts_at_home=False)
    assert present(recording.score().value("position_error_mm.rms")) < 1.0


def test_it_is_drawn_as_a_chain_and_written_with_its_mimic(tmp_path: Path) -> None:
    robot = loaded(tmp_path)
    assert bodies_of(robot).names[-2:] == ("link4", "tip")
    q = np.random.default_rng(2).uniform(robot.lower, robot.upper, (50, robot.n))
    tips = bodies_of(robot).poses(q)[:, -1, :3]
    np.testing.assert_allclose(tips, robot.fk(q)[:, :3, 3], atol=1e-9)
    again = tmp_path / "again.urdf"
    again.write_text(urdf_of(robot))
    read = tc.load_robot(str(again), tip="tip", task="x y z")
    assert read.joint_names == robot.joint_names
    np.testing.assert_allclose(read.limits(), robot.limits(), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(read.fk(q), robot.fk(q), rtol=0.0, atol=1e-9)


def test_the_links_of_an_arm_with_followers_are_written_as_they_were_read(tmp_path: Path) -> None:
    text, tip, _ = followed(7, is_upstream=True)
    path, again = tmp_path / "arm.urdf", tmp_path / "again.urdf"
    path.write_text(text)
    robot = tc.load_robot(str(path), tip=tip, dynamics="links")
    again.write_text(urdf_of(robot))
    assert "of the robot's model" in again.read_text()
    read = tc.load_robot(str(again), tip="tip", dynamics="links")
    q, n = np.random.default_rng(1).uniform(robot.lower, robot.upper), robot.n
    first, second = np.empty((n, n)), np.empty((n, n))
    follower_inertia(q, present(robot.dynamics).parameters.copy(), first)
    follower_inertia(q, present(read.dynamics).parameters.copy(), second)
    np.testing.assert_allclose(second, first, rtol=0.0, atol=1e-9 * first.max())


def test_an_arm_with_followers_is_no_plain_chain_for_errors_of_links(tmp_path: Path) -> None:
    assert chain_of(loaded(tmp_path)) is None
    assert "follow" not in tc.load_robot(str(tmp_path / "arm.urdf"), tip="a").joint_names
