"""Forward kinematics says what it found: closed loops, another assembly, or none."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from teleop_core.base.errors import ClosureError
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import FkStatus, dexterity, list_robots, load_robot
from teleop_core.robots.robot import Robot
from teleop_machines import rps3, stewart

# Loops are solved to rounding of their lengths; a pose loses the condition of its assembly.
CLOSED, SAME = 1e-9, 1e-6
WITH_LOOPS = ("four_bar", "rps3", "scara_stewart", "stewart", "three_finger_hand")
# The triple of which fk gave a pose that is no assembly.
TILTED = (1.715, 1.165, 1.687)


def torn_rps3(T: Array, legs: Sequence[float] | Array, b: float = 1.0, a: float = 0.5) -> float:
    """Largest error [m]: each ball joint in its leg's plane, as far from its hinge as the leg."""
    worst = 0.0
    for i, leg in enumerate(legs):
        out = rotation("z", 2.0 * math.pi * i / 3.0)
        joint = out.T @ (T[:3, 3] + T[:3, :3] @ out @ (a, 0.0, 0.0))
        length = np.hypot(joint[0] - b, joint[2])
        worst = max(worst, abs(joint[1]), abs(length - leg))
    return worst


def torn_stewart(T: Array, legs: Array) -> float:
    """Largest error of a leg [m]."""
    ends = T[:3, 3] + stewart.PAIRED.platform @ T[:3, :3].T
    return np.abs(np.linalg.norm(ends - stewart.PAIRED.base, axis=1) - legs).max()


TORN = {"rps3": torn_rps3, "stewart": torn_stewart}
loops = pytest.mark.parametrize("name", TORN)


def legal(robot: Robot, count: int, seed: int, share: float = 1.0) -> Array:
    """Leg sets (count, n) spread evenly over a share of the strokes around home."""
    lower = robot.home + share * (robot.lower - robot.home)
    upper = robot.home + share * (robot.upper - robot.home)
    return np.random.default_rng(seed).uniform(lower, upper, (count, robot.n))


@pytest.mark.parametrize("name", [name for name in list_robots() if name not in WITH_LOOPS])
def test_a_robot_without_loops_closes_exactly_everywhere(name: str) -> None:
    robot = load_robot(name)
    q = legal(robot, 20, 1)
    answer: Any = robot.solve_fk(q)
    assert (answer.status == FkStatus.CLOSED).all()
    assert (answer.residual == 0.0).all()
    assert (answer.mode == 0).all()
    assert np.array_equal(answer.T, robot.fk(q))
    assert np.array_equal(robot.fk_all(q[0]), answer.T[:1])


@pytest.mark.parametrize("name", WITH_LOOPS)
def test_home_is_closed_in_the_mode_of_home_and_first_of_all_assemblies(name: str) -> None:
    robot = load_robot(name)
    answer = robot.solve_fk(robot.home)
    assert answer.status == FkStatus.CLOSED
    assert answer.residual <= CLOSED
    assert answer.mode == 1
    assert np.allclose(robot.fk_all(robot.home)[0], answer.T, atol=SAME)
    assert np.array_equal(robot.fk(robot.home), answer.T)


@loops
def test_the_residual_is_the_error_of_the_loops_whatever_the_status_and_none_is_left_open(name: str) -> None:
    robot = load_robot(name)
    q = legal(robot, 300, 3)
    for k, search in enumerate((True, False)):
        answer: Any = robot.solve_fk(q, search=search)
        torn = np.array([TORN[name](T, legs) for T, legs in zip(answer.T, q, strict=True)])
        is_closed: Any = answer.status < FkStatus.NOT_CLOSED
        assert (torn[is_closed] <= CLOSED).all()
        assert (answer.residual[is_closed] <= CLOSED).all()
        assert (answer.residual[~is_closed] > CLOSED).all()
        assert np.isfinite(answer.T).all()
        assert (~is_closed).any() or (name, k) == ("rps3", 0)
        for legs in q[~is_closed][:30] if search else ():
            with pytest.raises(ClosureError) as refusal:
                robot.fk(legs)
            assert refusal.value.residual > CLOSED
            assert refusal.value.value == legs.tolist()


def test_the_triple_that_had_no_assembly_next_to_home_has_one() -> None:
    robot = load_robot("rps3")
    answer = robot.solve_fk(TILTED)
    assert answer.status == FkStatus.OTHER_MODE
    assert answer.mode == -1
    assert torn_rps3(answer.T, TILTED) <= CLOSED
    assert np.array_equal(robot.fk(TILTED), answer.T)
    assert robot.solve_fk(TILTED, search=False).status == FkStatus.NOT_CLOSED
    tilts = np.degrees(np.arccos(robot.fk_all(TILTED)[:, 2, 2]))
    assert np.abs(tilts - 57.8).min() < 0.01


def test_every_legal_triple_of_the_3_rps_has_an_assembly_and_fk_finds_it() -> None:
    robot = load_robot("rps3")
    answer: Any = robot.solve_fk(legal(robot, 4000, 4))
    assert (answer.status <= FkStatus.OTHER_MODE).all()
    assert 0.4 < (answer.status == FkStatus.OTHER_MODE).mean() < 0.6


def test_assemblies_of_the_3_rps_are_those_of_its_polynomial() -> None:
    robot = load_robot("rps3")
    for q in np.random.default_rng(5).uniform(0.3, 2.5, (60, 3)):
        found, modes = robot.fk_all(q), rps3.assembly_modes(q, b=1.0, a=0.5).transforms
        assert len(found) == len(modes)
        for T in modes:
            assert np.abs(found - T).max(axis=(1, 2)).min() < SAME


def test_legs_of_a_real_pose_always_assemble() -> None:
    robot, rng = load_robot("stewart"), np.random.default_rng(6)
    turned = [
        rotation("z", a) @ rotation("y", b) @ rotation("x", c) for a, b, c in rng.uniform(-math.pi, math.pi, (3000, 3))
    ]
    places = rng.uniform([-0.08, -0.08, 0.12], [0.08, 0.08, 0.28], (3000, 3))
    poses = np.array([transform(R, p) for R, p in zip(turned, places, strict=True)])
    q = np.array([robot.ik_all(T)[0] for T in poses])
    is_legal = ((q >= robot.lower) & (q <= robot.upper)).all(axis=1)
    q, poses = q[is_legal], poses[is_legal]
    answer: Any = robot.solve_fk(q)
    assert is_legal.sum() > 300
    assert (answer.status < FkStatus.NOT_CLOSED).all()
    assert (answer.status == FkStatus.OTHER_MODE).any()
    # From its own pose as the seed, each is the pose itself.
    own: Any = robot.solve_fk(q, poses)
    assert (own.status <= FkStatus.NEAR_SINGULAR).all()
    assert np.allclose(own.T, poses, atol=SAME)


@loops
def test_all_assemblies_close_differ_begin_with_that_of_fk_and_are_kept_as_seeds(name: str) -> None:
    robot, checked = load_robot(name), 0
    for q in legal(robot, 12, 7, share=0.6):
        found = robot.fk_all(q)
        if not len(found):
            continue
        checked += 1
        assert max(TORN[name](T, q) for T in found) <= CLOSED
        apart = np.abs(found[:, None] - found).max(axis=(2, 3)) + np.eye(len(found))
        assert apart.min() > SAME
        assert np.allclose(found[0], robot.fk(q), atol=SAME)
        for T in found:
            kept = robot.solve_fk(q, T)
            assert kept.status <= FkStatus.NEAR_SINGULAR
            assert np.allclose(kept.T, T, atol=SAME)
    assert checked > 5


@loops
def test_closed_is_the_end_of_the_straight_way_from_home(name: str) -> None:
    robot = load_robot(name)
    q = legal(robot, 400, 9)
    answer = robot.solve_fk(q)
    shares = np.linspace(0.0, 1.0, 400)[1:, None]
    compared = 0
    for k in np.flatnonzero(answer.status == FkStatus.CLOSED):
        legs, T = q[k], answer.T[k]
        way = robot.follow_fk(robot.home + shares * (legs - robot.home))
        assert (way.status <= FkStatus.NEAR_SINGULAR).all()
        assert np.allclose(way.T[-1], T, atol=SAME)
        compared += 1
    assert compared > 50


@loops
def test_a_path_stays_in_its_assembly(name: str) -> None:
    robot, rng = load_robot(name), np.random.default_rng(10)
    angles = np.linspace(0.0, 2.0 * math.pi, 1500)[:, None] + rng.uniform(0.0, 6.0, robot.n)
    swing = 0.05 * (robot.upper - robot.lower)
    path = robot.home + swing * (np.sin(angles) - np.sin(angles[0]))
    for seed in robot.fk_all(path[0])[:4]:
        way = robot.follow_fk(path, seed)
        if (way.status > FkStatus.NEAR_SINGULAR).any():
            continue  # this assembly ends on the path
        assert (way.mode == way.mode[0]).all()
        assert np.allclose(way.T[-1], seed, atol=SAME)  # the path is closed, and so is the way
    home = robot.follow_fk(path)
    assert (home.status == FkStatus.CLOSED).all()


def test_a_path_that_leaves_its_assembly_says_so_and_finds_back() -> None:
    robot = load_robot("rps3")
    there = np.linspace(robot.home, TILTED, 200)
    path = np.vstack((there, there[::-1]))
    way = robot.follow_fk(path)
    assert (way.status[[0, -1]] == FkStatus.CLOSED).all()
    assert (way.status[190:210] >= FkStatus.OTHER_MODE).all()
    assert np.allclose(way.T[-1], way.T[0], atol=SAME)


def test_opposite_modes_never_meet_without_a_singular_pose() -> None:
    # Determinants of the legs' slopes, of poses by plain finite differences, have the mode's sign.
    robot = load_robot("stewart")
    for q in legal(robot, 6, 11, share=0.5):
        for T in robot.fk_all(q):
            sign = np.linalg.slogdet(stewart.PAIRED.leg_jacobian(T))[0]
            home = np.linalg.slogdet(stewart.PAIRED.leg_jacobian(robot.fk(robot.home)))[0]
            assert robot.solve_fk(q, T).mode == sign * home


def test_a_crank_out_of_its_range_is_refused_and_both_modes_close_inside() -> None:
    robot = load_robot("four_bar", l0=4.0, l1=3.0, l2=3.0, l3=2.0)
    for theta in np.linspace(robot.lower[0] + 0.01, robot.upper[0] - 0.01, 20):
        both = robot.fk_all([theta])
        assert len(both) == 2
        assert [robot.solve_fk([theta], T).mode for T in both] == [1, -1]
        assert np.array_equal(both[0], robot.fk([theta]))
    outside = [robot.upper[0] + 0.1]
    assert robot.solve_fk(outside).status == FkStatus.NOT_CLOSED
    assert robot.fk_all(outside).shape == (0, 4, 4)
    with pytest.raises(ClosureError):
        robot.fk(outside)


def test_a_hand_whose_fingers_slip_holds_no_object() -> None:
    robot = load_robot("three_finger_hand")
    q = robot.home.copy()
    q[0] += 0.1
    answer = robot.solve_fk(q)
    assert answer.status == FkStatus.NOT_CLOSED
    assert answer.residual > 1e-3
    with pytest.raises(ClosureError):
        robot.fk(q)


def test_legs_of_the_hybrid_that_contradict_each_other_are_refused_beyond_play() -> None:
    robot = load_robot("scara_stewart")
    q = robot.home.copy()
    q[3] += 5e-5
    assert robot.fk(q).shape == (4, 4)
    q[3] += 1e-3
    with pytest.raises(ClosureError) as refusal:
        robot.fk(q)
    assert 1e-4 < refusal.value.residual < 2e-3


def test_the_hybrid_in_pairs_has_the_assemblies_of_its_platform() -> None:
    robot = load_robot("scara_stewart", sigma_b=0.26, sigma_m=0.26, heading="carried")
    found = robot.fk_all(robot.home)
    assert len(found) > 2
    for T in found:
        answer = robot.solve_fk(robot.home, T)
        assert answer.status <= FkStatus.NEAR_SINGULAR
        assert np.allclose(answer.T, T, atol=SAME)


@loops
def test_a_batch_is_its_single_questions(name: str) -> None:
    robot = load_robot(name)
    q = legal(robot, 30, 12)
    batch: Any = robot.solve_fk(q)
    for k, legs in enumerate(q):
        one = robot.solve_fk(legs)
        assert np.array_equal(one.T, batch.T[k])
        assert (one.status, one.residual, one.mode) == (batch.status[k], batch.residual[k], batch.mode[k])
    assert robot.solve_fk(np.empty((0, robot.n))).T.shape == (0, 4, 4)
    assert robot.follow_fk(np.empty((0, robot.n))).T.shape == (0, 4, 4)


def test_a_workspace_is_made_of_joints_that_close_and_of_all_where_there_are_no_loops() -> None:
    for name, low, high in (("rcrt1", 300, 300), ("rps3", 100, 200), ("three_finger_hand", 300, 300)):
        points, values = dexterity.sample_workspace(load_robot(name), 300, np.random.default_rng(13))
        assert low <= len(points) == len(values) <= high
        assert np.isfinite(points).all()
    # The platform is above its base, as next to home.
    assert dexterity.sample_workspace(load_robot("rps3"), 300, np.random.default_rng(13))[0][:, 2].min() > 0.3
