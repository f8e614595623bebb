"""Robots from URDF: what pinocchio reads from the same file, and every mistake by its element."""

import math
import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from pinocchio import Data, Model

from present import present
from random_arms import random_urdf
from teleop_core.base.errors import ParameterError, ShapeError, TeleopWarning
from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import DIRECTIONS, IkStatus
from teleop_core.robots import freedom, load_robot, load_robot_set
from teleop_core.robots.dynamics.chain_dynamics import inertia_matrix, inverse_dynamics, tip_efforts
from teleop_core.robots.rank import directions_of
from teleop_core.robots.robot import Robot
from teleop_core.session.api import configuration, run
from teleop_core.session.notes import notes_of

pytestmark = pytest.mark.filterwarnings("ignore::teleop_core.TeleopWarning")
EXAMPLE = Path(__file__).parents[2] / "examples" / "any_arm.urdf"
TEXT = EXAMPLE.read_text()


def model_and_q(text: str, robot: Robot, q: Array, model: Model | None = None) -> tuple[Model, Data, Array, list[int]]:
    model = model or pinocchio.buildModelFromXML(text)
    out = pinocchio.neutral(model)
    for name, value in zip(robot.joint_names, q, strict=True):
        joint = model.joints[model.getJointId(name)]
        out[joint.idx_q] = np.cos(value) if joint.nq == 2 else value
        if joint.nq == 2:
            out[joint.idx_q + 1] = np.sin(value)
    columns = [model.joints[model.getJointId(name)].idx_v for name in robot.joint_names]
    return model, model.createData(), out, columns


@pytest.mark.parametrize("seed", [0, 2, 5, 11])
def test_pose_jacobian_and_home_inertia_are_those_of_pinocchio(seed: int, tmp_path: Path) -> None:
    text, tip = random_urdf(seed, 1 + seed)
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    robot = load_robot(str(path), tip=tip)
    assert robot.n == 1 + seed
    q = np.random.default_rng(seed).uniform(robot.lower, robot.upper)
    model, data, theirs, columns = model_and_q(text, robot, q)
    frame = model.getFrameId(tip)
    pinocchio.framesForwardKinematics(model, data, theirs)
    np.testing.assert_allclose(robot.fk(q), data.oMf[frame].homogeneous, atol=1e-10)
    J = pinocchio.computeFrameJacobian(model, data, theirs, frame, pinocchio.LOCAL_WORLD_ALIGNED)[:, columns]
    np.testing.assert_allclose(robot.jacobian(q), J, atol=1e-10)
    model, data, home, columns = model_and_q(text, robot, robot.home)
    inertia = np.diag(pinocchio.crba(model, data, home))[columns]
    np.testing.assert_allclose(present(robot.drives).inertia, inertia, rtol=1e-10)


@pytest.mark.parametrize("seed", [0, 2, 5, 11])
def test_efforts_and_accelerations_of_the_links_and_of_a_wrench_are_those_of_pinocchio(
    seed: int, tmp_path: Path
) -> None:
    text, tip = random_urdf(seed, 1 + seed)
    path = tmp_path / "arm.urdf"
    path.write_text(text.replace('effort="20"', 'effort="1e4"'))
    robot = load_robot(str(path), tip=tip, dynamics="links")
    rng = np.random.default_rng(seed)
    q = rng.uniform(robot.lower, robot.upper)
    dq, ddq, given = rng.normal(size=(3, robot.n))
    whole = pinocchio.buildModelFromXML(text)
    held = [whole.getJointId(n) for n in whole.names if n not in ("universe", *robot.joint_names)]
    model = pinocchio.buildReducedModel(whole, held, pinocchio.neutral(whole))
    data, theirs = model.createData(), model_and_q(text, robot, q, model)[2]
    row, effort, found = (present(robot.dynamics).parameters.copy(), np.empty(robot.n), np.empty(robot.n))
    inverse_dynamics(q, dq, ddq, row, effort)
    expected = pinocchio.rnea(model, data, theirs, dq, ddq)
    np.testing.assert_allclose(effort, expected, rtol=0.0, atol=1e-10 * abs(expected).max())
    present(robot.dynamics).gravity(q, row, effort)
    expected = pinocchio.computeGeneralizedGravity(model, data, theirs)
    np.testing.assert_allclose(effort, expected, rtol=0.0, atol=1e-10 * (1 + abs(expected).max()))
    M, inertia = np.empty((robot.n, robot.n)), pinocchio.crba(model, data, theirs)
    inertia_matrix(q, row, M)
    np.testing.assert_allclose(M, inertia, rtol=0.0, atol=1e-10 * inertia.max())
    present(robot.dynamics).acceleration(q, dq, given, row, found)
    expected = pinocchio.aba(model, data, theirs, dq, given)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10 * abs(expected).max())
    found = robot.forward_dynamics(q, dq, given)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10 * abs(expected).max())
    wrench = rng.normal(0.0, 30.0, 6)
    frame = model.frames[model.getFrameId(tip)]
    pinocchio.framesForwardKinematics(model, data, theirs)
    turned = pinocchio.SE3(data.oMf[model.getFrameId(tip)].rotation.T, np.zeros(3))
    forces = [pinocchio.Force.Zero() for _ in range(model.njoints)]
    forces[frame.parentJoint] = frame.placement.act(turned.act(pinocchio.Force(wrench)))
    more = np.empty(robot.n)
    inverse_dynamics(q, dq, ddq, row, effort)
    tip_efforts(q, wrench, row, more)
    expected = pinocchio.rnea(model, data, theirs, dq, ddq, forces)
    np.testing.assert_allclose(effort - more, expected, rtol=0.0, atol=1e-10 * abs(expected).max())
    found = robot.forward_dynamics(q, dq, given, wrench)
    expected = pinocchio.aba(model, data, theirs, dq, given, forces)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10 * abs(expected).max())


def test_a_follower_and_its_leader_do_the_work_that_a_wrench_does(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    pitch, mimic = '"wrist_2"/><axis xyz="0 1 0"/>', '<mimic joint="elbow" multiplier="0.5"/>'
    assert pitch in TEXT
    path.write_text(TEXT.replace(pitch, pitch + mimic, 1))
    arm = load_robot(str(path), dynamics="links", **TOOL)
    assert arm.n == 5
    q = np.random.default_rng(2).uniform(arm.lower, arm.upper)
    zero, wrench = np.zeros(arm.n), np.array([3.0, -5.0, 8.0, 0.4, 0.2, -0.3])
    M_inverse = np.array([arm.forward_dynamics(q, zero, e) for e in np.eye(arm.n)])
    M_inverse -= arm.forward_dynamics(q, zero, zero)
    change = arm.forward_dynamics(q, zero, zero, wrench) - arm.forward_dynamics(q, zero, zero)
    np.testing.assert_allclose(change, (arm.jacobian(q).T @ wrench) @ M_inverse, atol=1e-9)


def test_forward_dynamics_are_asked_of_a_slave_with_vectors_of_its_joints() -> None:
    arm = load_robot(str(EXAMPLE), **TOOL)
    with pytest.raises(ShapeError, match="dq"):
        arm.forward_dynamics(arm.home, np.zeros(5), np.zeros(6))
    with pytest.raises(ShapeError, match="wrench"):
        arm.forward_dynamics(arm.home, np.zeros(6), np.zeros(6), np.zeros(3))
    with pytest.raises(ParameterError, match="effort"):
        arm.forward_dynamics(arm.home, np.zeros(6), np.full(6, np.nan))
    with pytest.raises(ParameterError, match="dynamics is None"):
        replace(arm, drives=None, dynamics=None).forward_dynamics(*np.zeros((3, 6)))


@pytest.mark.parametrize("dynamics", ["independent", "links"])
def test_a_start_is_looked_for_when_it_is_asked_for_and_not_before(dynamics: str, tmp_path: Path) -> None:
    text, tip = random_urdf(5, 6)
    path = tmp_path / "arm.urdf"
    path.write_text(text.replace('effort="20"', 'effort="1e4"'))
    arm = load_robot(str(path), tip=tip, dynamics=dynamics)
    assert vars(arm)["start"] is None
    assert ((arm.lower <= arm.start) & (arm.start <= arm.upper)).all()


def test_motors_of_a_row_add_to_the_inertia_and_to_the_efforts() -> None:
    arm = load_robot(str(EXAMPLE), tip="tool0", dynamics="links")
    row, q, still = present(arm.dynamics).parameters.copy(), arm.home.copy(), np.zeros(6)
    before, after, effort, more = np.empty((6, 6)), np.empty((6, 6)), np.empty(6), np.empty(6)
    inertia_matrix(q, row, before)
    inverse_dynamics(q, still, np.ones(6), row, effort)
    row[-6:] += np.arange(1.0, 7.0)
    inertia_matrix(q, row, after)
    inverse_dynamics(q, still, np.ones(6), row, more)
    np.testing.assert_allclose(after - before, np.diag(np.arange(1.0, 7.0)), atol=1e-12)
    np.testing.assert_allclose(more - effort, np.arange(1.0, 7.0), atol=1e-12)


@pytest.mark.parametrize("dynamics", ["independent", "links"])
def test_a_joint_that_turns_points_on_its_axis_has_the_inertia_of_an_assumed_motor(
    dynamics: str, tmp_path: Path
) -> None:
    path = tmp_path / "arm.urdf"
    text = re.sub(r'i(xx|yy|zz)="[\d.]+"', r'i\1="0"', TEXT).replace('xyz="0.08 0 0.02"', "")
    for lean in np.linspace(0.1, 1.5, 20):  # of the base, so that numbers round both ways
        waist = f'<child link="column"/><origin rpy="{lean} 0.3 0.2" '
        path.write_text(text.replace('<child link="column"/><origin ', waist))
        arm = load_robot(str(path), tip="tool0", dynamics=dynamics)
        assert present(arm.drives).inertia.min() > 1e-3
        ddq = np.empty(6)
        present(arm.dynamics).acceleration(
            arm.home.copy(), np.zeros(6), np.ones(6), present(arm.dynamics).parameters.copy(), ddq
        )
        assert abs(ddq).max() < 1e4


def test_the_inertia_of_the_links_at_home_with_their_motors_is_that_of_the_drives(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(TEXT.replace("<axis", '<dynamics damping="2" friction="1"/><axis'))
    arm = load_robot(str(path), tip="tool0", dynamics="links")
    M = np.empty((6, 6))
    inertia_matrix(arm.home.copy(), present(arm.dynamics).parameters.copy(), M)
    np.testing.assert_allclose(np.diag(M), present(arm.drives).inertia, rtol=1e-12)


def test_a_session_follows_with_links_that_weigh_and_drives_that_carry_them() -> None:
    options = ["tip=tool0", "dynamics=links"]
    recording = run("coarse_box", duration=6.0, robot=str(EXAMPLE), geometry=options)
    assert present(recording.score().value("position_error_mm.rms")) < 1.5
    arm = load_robot(str(EXAMPLE), tip="tool0", dynamics="links")
    joints, row = recording["slave/measured_js"], present(arm.dynamics).parameters.copy()
    q = np.stack([joints[f"{name}.position"] for name in arm.joint_names], axis=1)
    given = np.stack([joints[f"{name}.effort"] for name in arm.joint_names], axis=1)
    weight = np.empty(q.shape)
    for place, effort in zip(q, weight, strict=True):
        present(arm.dynamics).gravity(place, row, effort)
    mean = weight.mean(axis=0)
    assert abs(mean).max() > 3.0
    np.testing.assert_allclose(given.mean(axis=0), mean, atol=0.1 * abs(mean).max())


def test_drives_have_what_the_file_states_and_name_what_is_assumed() -> None:
    drives = present(load_robot(str(EXAMPLE), tip="tool0").drives)
    np.testing.assert_array_equal(drives.effort_limit, [150.0, 150.0, 80.0, 28.0, 28.0, 28.0])
    np.testing.assert_array_equal(drives.speed_limit, [2.6, 2.6, 3.1, 5.0, 5.0, 5.0])
    assert not {"effort_limit", "speed_limit"} & set(drives.assumed)
    assert "inertia" in drives.assumed  # the motors'


def test_limits_of_zero_are_unknown_ones_and_never_zero(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(re.sub(r'(effort|velocity)="[\d.]+"', r'\1="0"', TEXT))
    drives = present(load_robot(str(path), tip="tool0").drives)
    assert {"effort_limit", "speed_limit"} <= set(drives.assumed)
    assert (drives.effort_limit > 0.0).all()
    assert (drives.speed_limit > 0.0).all()


def test_a_session_says_which_limits_are_assumed_and_nothing_of_a_file_that_gives_all(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(TEXT.replace('velocity="3.1"', 'velocity="0"'))
    texts = [notes_of(configuration("coarse_box", robot=str(file), geometry=["tip=tool0"])) for file in (path, EXAMPLE)]
    assert texts[1] == []
    (note,) = texts[0]
    speeds = ", ".join(f"{v:g}" for v in present(load_robot(str(path), tip="tool0").drives).speed_limit)
    assert f"{path} does not give every joint its limits of velocity" in note
    assert f"velocity {speeds}" in note
    assert "effort" not in note


@pytest.mark.parametrize("friction", ['damping="2" friction="1"', 'damping="2"', 'friction="1"'])
def test_friction_that_would_stop_the_links_in_no_time_has_a_motor_behind_it(friction: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(TEXT.replace("<axis", f"<dynamics {friction}/><axis"))
    drives = present(load_robot(str(path), tip="tool0").drives)
    rate = (drives.viscous + drives.coulomb / drives.friction_speed) / drives.inertia
    if "damping" in friction:
        np.testing.assert_array_equal(drives.viscous, np.full(6, 2.0))
    assert (rate <= 2000.0).all()
    assert (rate >= 1500.0).any()


def test_an_inertia_of_no_body_is_no_matter_where_nothing_moves_it_or_axes_are_independent(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    none = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="1" ixz="1" iyz="1"/>'
    path.write_text(TEXT.replace('"base"/>', f'"base">{none}</inertial></link>', 1))
    for dynamics in ("independent", "links"):
        found, plain = (load_robot(str(file), dynamics=dynamics, **TOOL) for file in (path, EXAMPLE))
        np.testing.assert_array_equal(present(found.drives).inertia, present(plain.drives).inertia)
    path.write_text(TEXT.replace('izz="0.008"', 'izz="0.9"', 1))
    assert present(load_robot(str(path), **TOOL).drives).inertia[0] > present(plain.drives).inertia[0]


LOW, ELBOW = 'lower="-2.6"', '"elbow" type="revolute"'
TOOL = {"tip": "tool0"}


def changed(old: str, new: str) -> str:
    """The example with one change."""
    assert old in TEXT
    return TEXT.replace(old, new, 1)


WORDS = ("nan", "-inf", "x", "0.2m", "1e300", "-1e160", "2e9", "0 0", "nan 0.1", "0.2m 0.1")
NUMBERS = ("xyz", "lower", "upper", "effort", "velocity", "value", "ixx", "iyy", "izz")


LIMITS, HUGE = ("lower", "upper", "effort", "velocity"), ("-inf", "1e300", "-1e160", "2e9")


def means_none(path: str) -> None:
    """Such a limit counts as none, which a note tells, or contradicts the other end or its sign."""
    with suppress(ParameterError):
        robot = load_robot(path, **TOOL)
        assert any("count" in note for note in robot.notes)
        assert np.abs([robot.lower, robot.upper]).max() < 1e3


@pytest.mark.parametrize("word", WORDS)
def test_no_number_of_a_file_is_read_as_another(word: str, tmp_path: Path) -> None:
    path, refused = tmp_path / "arm.urdf", set()
    for found in re.finditer(rf'({"|".join(NUMBERS)})="([^"]*)"', TEXT):
        words = found[2].split()
        words[len(words) // 2] = word
        text = f'{TEXT[: found.start()]}{found[1]}="{" ".join(words)}"{TEXT[found.end() :]}'
        path.write_text(text)
        refused.add(found[1])
        if found[1] in LIMITS and word in HUGE:
            means_none(str(path))
            continue
        with pytest.raises(ParameterError, match=rf"^{found[1]} of "):
            load_robot(str(path), **TOOL)
    assert refused == set(NUMBERS)


def told(text: str, tmp_path: Path) -> tuple[Robot, str]:
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    robot = load_robot(str(path), **TOOL)
    return robot, "\n".join(robot.notes)


def test_soft_limits_of_a_controller_are_kept_and_told(tmp_path: Path) -> None:
    soft = '<safety_controller soft_lower_limit="-1.0" soft_upper_limit="9" k_velocity="1"/>'
    robot, notes = told(changed(f"<limit {LOW}", f"{soft}<limit {LOW}"), tmp_path)
    elbow = robot.joint_names.index("elbow")
    assert (robot.lower[elbow], robot.upper[elbow]) == (-1.0, 2.6)
    assert notes == "elbow: narrowed to the soft limits of its safety_controller"
    assert told(TEXT, tmp_path)[1] == ""
    none = '<safety_controller k_velocity="1"/>'
    robot, notes = told(changed(f"<limit {LOW}", f"{none}<limit {LOW}"), tmp_path)
    assert (robot.upper[elbow], notes) == (2.6, "")


def test_limits_that_mean_none_are_told_and_assumed_as_of_continuous_joints_whose_own_are_told(tmp_path: Path) -> None:
    text = changed(ELBOW, '"elbow" type="continuous"')
    assert told(text, tmp_path)[1] == "elbow: lower and upper are ignored: the joint is continuous"
    ends = f'<limit {LOW} upper="2.6"'
    text = changed(ends, f'<limit {LOW} upper="999999"')
    robot, notes = told(text, tmp_path)
    elbow = robot.joint_names.index("elbow")
    assert robot.upper[elbow] == 2.0 * math.pi > -robot.lower[elbow] == 2.6
    assert notes == "elbow: limits beyond 1000 rad count as no limits; 6.28 rad are assumed"
    robot, _ = told(changed(ends, '<limit lower="-999999" upper="999999"'), tmp_path)
    assert -robot.lower[elbow] == 2.0 * math.pi


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (LOW, 'lower="-170"', "limits of elbow 170 rad: are they degrees?"),
        ('velocity="3.1"', 'velocity="120"', "speeds of elbow 120 rad/s: are they degrees/s?"),
        ('xyz="0 0 0.42"', 'xyz="0 0 420"', "origins of elbow 420 m: are they mm?"),
        ('izz="0.008"', 'izz="-0.008"', "link forearm has a negative inertia, which no body has"),
    ],
)
def test_numbers_that_look_like_another_unit_are_told(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert told(changed(old, new), tmp_path)[1] == said


@pytest.mark.filterwarnings("error")
def test_an_arm_that_may_not_be_meant_so_is_loaded_with_a_warning(tmp_path: Path) -> None:
    """As a session tells it; the silent way is for those who tell it themselves."""
    path = tmp_path / "arm.urdf"
    path.write_text(changed(LOW, 'lower="-170"'))
    with pytest.warns(TeleopWarning, match=r"arm.urdf: limits of elbow 170 rad: .*degrees") as of:
        load_robot(str(path), **TOOL)
    assert [one.filename for one in of] == [__file__]
    load_robot_set(str(path), ["tip=tool0"])
    load_robot(str(EXAMPLE), **TOOL)
    with pytest.warns(TeleopWarning, match="the tip moves in only 5 of 6 directions at once"):
        load_robot(str(EXAMPLE), tip="wrist_2")


def test_a_session_tells_the_notes_of_its_arm(tmp_path: Path) -> None:
    path = tmp_path / "ARM.URDF"
    path.write_text(changed(LOW, 'lower="-170"'))
    notes = notes_of(configuration("coarse_box", robot=str(path), geometry=["tip=tool0"]))
    assert f"{path}: limits of elbow 170 rad: are they degrees?" in notes


def test_frames_that_weigh_next_to_nothing_have_no_inertia(tmp_path: Path) -> None:
    body = '<inertial><mass value="1e-8"/><inertia ixx="1e-8" iyy="0" izz="0"/></inertial>'
    text = changed('<link name="tool0"/>', f'<link name="tool0">{body}</link>')
    for dynamics in ("links", "independent"):
        path = tmp_path / "arm.urdf"
        path.write_text(text)
        found, plain = (load_robot(str(f), dynamics=dynamics, **TOOL) for f in (path, EXAMPLE))
        np.testing.assert_array_equal(present(found.dynamics).parameters, present(plain.dynamics).parameters)


def test_a_heavy_arm_of_weak_drives_is_not_held_by_a_friction_that_was_assumed(tmp_path: Path) -> None:
    heavy = re.sub(r'(value|i[xyz]{2})="([^"]*)"', lambda m: f'{m[1]}="{10 * float(m[2])}"', TEXT)
    path = tmp_path / "arm.urdf"
    path.write_text(re.sub(r'effort="[^"]*"', 'effort="30"', heavy))
    drives = present(load_robot(str(path), **TOOL).drives)
    assert (drives.coulomb <= 0.1 * drives.effort_limit * (1 + 1e-12)).all()
    most = 0.5 * drives.effort_limit / drives.speed_limit
    assert (drives.viscous <= most * (1 + 1e-12)).all()
    run("coarse_box", duration=0.05, robot=str(path), geometry=["tip=tool0"])


# -- arms that cannot hold every pose --------------------------------------------------------------

TURN, SLIDE = "revolute", "prismatic"
FEW: dict[str, tuple[tuple[tuple[str, str, str, float, float], ...], int, str]] = {
    "five axes": (
        ((TURN, "0 0 0.27", "0 0 1", -6.2, 6.2), (TURN, "0 0 0", "0 1 0", -2.0, 2.0),
         (TURN, "0.05 0 0.28", "0 1 0", -3.9, 0.2), (TURN, "0.08 0 -0.34", "0 1 0", -1.7, 3.1),
         (TURN, "0.08 0 -0.1", "0 0 -1", -6.2, 6.2)), 5, "x y z rx ry",
    ),
    "scara": (
        ((TURN, "0 0 0.3", "0 0 1", -2.5, 2.5), (TURN, "0.3 0 0", "0 0 1", -2.5, 2.5),
         (SLIDE, "0.3 0 0", "0 0 -1", 0.0, 0.2), (TURN, "0 0 0", "0 0 -1", -3.0, 3.0)),
        4, "x y z rz",
    ),
    "lift and boom": (
        ((SLIDE, "0 0 0.2", "0 0 1", 0.0, 1.1), (SLIDE, "0 -0.2 0", "0 -1 0", 0.0, 0.5),
         (TURN, "0 -0.1 0", "0 0 1", -1.7, 4.0)), 3, "x y z",
    ),
    "six, all upright": (
        tuple((TURN, "0.2 0 0", "0 0 1", -2.0, 2.0) for _ in range(6)), 3, "x y rz",
    ),
}  # fmt: skip


def few(name: str, folder: Path) -> str:
    """File of an arm of :data:`FEW`."""
    joints, *_ = FEW[name]
    text = '<robot name="few"><link name="l0"/>'
    for i, (kind, place, axis, lower, upper) in enumerate(joints):
        text += (
            f'<link name="l{i + 1}"/><joint name="j{i}" type="{kind}"><parent link="l{i}"/>'
            f'<child link="l{i + 1}"/><origin xyz="{place}"/><axis xyz="{axis}"/>'
            f'<limit lower="{lower}" upper="{upper}" effort="100" velocity="6"/></joint>'
        )
    text += (
        '<link name="tip"/><joint name="end" type="fixed"><parent link="'
        f'l{len(joints)}"/><child link="tip"/><origin xyz="0.1 0 -0.1"/></joint></robot>'
    )
    path = folder / "few.urdf"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", FEW)
def test_an_arm_controls_as_many_directions_as_its_tip_can_move_in_at_once(name: str, tmp_path: Path) -> None:
    _, rank, task = FEW[name]
    arm = load_robot(few(name, tmp_path))
    held = [direction for direction, is_held in zip(DIRECTIONS, arm.task_mask, strict=True) if is_held]
    assert " ".join(held) == task
    assert directions_of(arm, freedom.lever(arm)).rank == rank
    for q in np.random.default_rng(1).uniform(arm.lower, arm.upper, (20, arm.n)):
        assert arm.ik(arm.fk(q), q).status in {IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR}


def test_an_arm_of_full_rank_controls_all_directions_and_a_task_is_kept(tmp_path: Path) -> None:
    assert all(load_robot(str(EXAMPLE), tip="tool0").task_mask)
    arm = load_robot(few("five axes", tmp_path), task="x y z")
    assert arm.task_mask == (True, True, True, False, False, False)


@pytest.mark.parametrize(
    ("task", "told"),
    [
        ("", "it controls x y z rx ry, and not rz"),
        ("x y z rx ry rz", 'asked for x y z rx ry rz; "task=x y z rx ry" it can follow'),
    ],
)
def test_a_session_says_which_directions_such_an_arm_does_not_hold(task: str, told: str, tmp_path: Path) -> None:
    path = few("five axes", tmp_path)
    made = configuration(robot=path, geometry=[f"task={task}"] if task else [])
    (note, *_) = notes_of(made)
    assert "the tip moves in only 5 of 6 directions at once" in note
    assert told in note
    assert "teleop reach" in note


def test_no_note_is_made_of_an_arm_that_can_do_what_it_is_asked_for(tmp_path: Path) -> None:
    for path, task in ((str(EXAMPLE), "tip=tool0"), (few("five axes", tmp_path), "task=x y z")):
        told = notes_of(configuration(robot=path, geometry=[task]))
        assert not [note for note in told if "at once" in note]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["five axes", "scara", "lift and boom"])
@pytest.mark.filterwarnings("ignore:.*at once:UserWarning")
def test_arms_of_few_joints_follow_without_settings(name: str, tmp_path: Path) -> None:
    score = run("coarse_box", duration=20.0, robot=few(name, tmp_path)).score()
    assert present(score.reach.followed_share) > 0.95, score.verdict
