"""Inverse kinematics of the MMA: every branch, nearest solution, paths through singularities."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.kinematics import REACHED
from teleop_core.kinematics.damped import is_near_singular, pose_error
from teleop_core.robots import IkStatus, load_robot
from teleop_core.robots.robot import Robot
from teleop_machines.mma_branches import branch, unwrapped
from ways import followed

DT = 0.001
SOLVED = {IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR}
# Closed form from a pose that carries rounding of 1e-16 m.
EXACT = 1e-12


@pytest.fixture(scope="module")
def mma() -> Any:
    return load_robot("mma")


def readings(robot: Robot, count: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).uniform(robot.lower, robot.upper, (count, robot.n))


def all_branches(robot: Robot, T: Array, seed: Array, degrees: float) -> Array:
    """Solutions inside the limits on a grid of θ10, by the closed form."""
    found, q = [], np.empty(7)
    for turn in np.radians(np.arange(-180.0, 180.0, degrees)):
        for choice in range(8):
            if branch(T, turn, choice, robot.geometry_row, seed, q) == 0.0:
                unwrapped(q, seed, robot.limits())
                if (q >= robot.lower).all() and (q <= robot.upper).all():
                    found.append(q.copy())
    return np.array(found)


def joint_path(robot: Robot, start: Array, end: Array, samples: int = 2000) -> tuple[Array, Array]:
    """Poses of a smooth joint path between two vectors [degrees], and its start [rad]."""
    start, end = np.radians(start), np.radians(end)
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, math.pi, samples))
    return robot.fk(start + share[:, None] * (end - start)), start


@pytest.mark.parametrize("model", ["A", "C"])
def test_every_reachable_pose_is_solved_from_home(model: str) -> None:
    robot = load_robot("mma", model=model)
    for seeds in (None, robot.home + 7.0):  # from outside of the limits too
        result: Any = robot.ik(robot.fk(readings(robot, 500)), seeds)
        assert set(result.status) <= SOLVED
        assert result.residual.max() <= REACHED
        assert (result.q >= robot.lower).all()
        assert (result.q <= robot.upper).all()


@pytest.mark.parametrize("degrees", [0.5, 20.0])
def test_seed_near_a_solution_gives_a_solution_at_least_as_near(mma: Any, degrees: float) -> None:
    q = readings(mma, 300, seed=1) * 0.7
    seeds = q + np.radians(np.random.default_rng(2).uniform(-degrees, degrees, q.shape))
    result = mma.ik(mma.fk(q), seeds)
    assert set(result.status) <= SOLVED
    moves = np.abs(result.q - seeds).max(axis=1)
    # The local search takes the least sum of squares; among seven joints that costs the largest
    # move at most a factor sqrt(7), when the branches do not lie nearer.
    assert (moves <= math.sqrt(7.0) * math.radians(degrees)).all()


def test_solution_is_as_near_to_the_seed_as_the_best_of_a_fine_scan_of_all_branches(mma: Robot) -> None:
    q, seeds = readings(mma, 30, seed=3), readings(mma, 30, seed=4)
    worse = []
    for T, seed in zip(mma.fk(q), seeds, strict=True):
        best = np.abs(all_branches(mma, T, seed, 1.0) - seed).max(axis=1).min()
        worse.append(np.abs(mma.ik(T, seed).q - seed).max() - best)
    # θ10 is looked at every 5° and refined; a branch that exists for less than that may be missed.
    assert np.quantile(worse, 0.9) < math.radians(0.1)
    assert max(worse) < math.radians(10.0)


def test_one_of_the_closed_form_branches_is_the_joint_vector_that_made_the_pose(mma: Robot) -> None:
    q, free = np.empty(7), np.array([[-np.inf] * 7, [np.inf] * 7])
    for true in readings(mma, 100, seed=7):
        T, nearest = mma.fk(true), math.inf
        for choice in range(8):
            if branch(T, true[6], choice, mma.geometry_row, true, q) == 0.0:
                unwrapped(q, true, free)
                nearest = min(nearest, np.abs(q - true).max())
        # A joint angle near a fold has half the digits of the pose.
        assert nearest < 1e-6


def test_all_solutions_reach_the_pose_and_differ_and_a_seed_that_does_is_kept(mma: Robot) -> None:
    for q in readings(mma, 50, seed=8):
        T = mma.fk(q)
        assert np.abs(mma.ik(T, q).q - q).max() < EXACT
        solutions = mma.ik_all(T)
        assert 1 <= len(solutions) <= 8
        for i, solution in enumerate(solutions):
            assert np.abs(mma.fk(solution) - T).max() < EXACT
            for other in solutions[:i]:
                assert np.abs(solution - other).max() > 1e-6


def test_pose_that_only_the_limits_forbid_is_limited_not_unreachable(mma: Robot) -> None:
    T, residual, q = mma.fk(mma.home + 0.5), np.empty(2), np.empty(7)
    limits = np.stack((mma.home - 0.1, mma.home + 0.1, np.full(7, np.inf)))
    status = mma.kernels.ik(T, mma.home.copy(), limits, mma.geometry_row, q, residual)
    assert status == IkStatus.LIMITED
    assert residual[0] > 1e-3
    assert (np.abs(q - mma.home) <= 0.1 + 1e-15).all()


# Wrist singularity (θ6 = ±90° with θ8 = ±90°): crossed along θ6, along θ8, along both at once.
CROSSINGS = {
    "theta8": ([0, -90, 0, 90, 90, 40, 0], [20, -80, 10, 80, 90, 140, 30]),
    "theta6": ([0, -90, 0, 90, 60, 90, 0], [20, -80, 10, 80, 120, 90, 30]),
    "both": ([0, -90, 0, 90, 60, 60, 0], [20, -80, 10, 80, 120, 120, 30]),
    "other side": ([0, -90, 0, 90, -60, -60, 0], [20, -80, 10, 80, -120, -120, 30]),
}


@pytest.mark.parametrize("beside", [0.0, 1e-6, 0.01, 0.5, 3.0])
@pytest.mark.parametrize("crossing", CROSSINGS)
def test_path_through_or_beside_the_wrist_singularity_is_followed(mma: Robot, crossing: str, beside: float) -> None:
    start, end = (np.array(angles, float) for angles in CROSSINGS[crossing])
    shift = np.array([0.0, 0.0, 0.0, 0.0, beside, 0.5 * beside, 0.0])
    T, seed = joint_path(mma, start + shift, end + shift)
    inside = np.clip(seed, mma.lower, mma.upper)
    result = followed(mma, T, inside)
    assert set(result.status) <= SOLVED
    # The path moves at most 100° in 2 s; least joint motion never needs more than its speed.
    assert np.abs(np.diff(result.q, axis=0)).max() < 0.004


def pose_along(T: Array, direction: Array, distance: float) -> Array:
    """Pose moved by a twist (6,), linear over 0.1 m, then angular."""
    turn = Rotation.from_rotvec(distance * direction[3:]).as_matrix()
    return transform(turn @ T[:3, :3], T[:3, 3] + 0.1 * distance * direction[:3])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_motion_goes_on_along_the_direction_that_a_singularity_has_lost(mma: Robot, sign: float) -> None:
    seed = np.radians([10.0, -80.0, 5.0, 85.0, 90.0, 90.0, 20.0])
    J = mma.jacobian(seed)
    J[:3] /= 0.1
    lost = sign * np.linalg.svd(J)[0][:, -1]
    shares = 0.25 - 0.25 * np.cos(np.linspace(0.0, math.pi, 2000))
    result = followed(mma, [pose_along(mma.fk(seed), lost, s) for s in shares], seed)
    # Leaving costs joint speed, so the arm may lag for a moment; it ends on the path.
    assert result.status[-1] in SOLVED
    assert result.residual.max() < 1e-3


def test_arm_that_is_led_out_of_reach_comes_back(mma: Robot) -> None:
    height = 0.3 * np.sin(np.linspace(0.0, math.pi, 2000))
    poses = np.repeat(mma.fk(mma.home)[None], 3000, axis=0)
    poses[:2000, 2, 3] += height
    result = followed(mma, poses, mma.home)
    assert IkStatus.UNREACHABLE in result.status
    assert result.status[-1] in SOLVED


def test_unmoving_target_keeps_the_joints_still(mma: Robot) -> None:
    result = mma.follow(np.repeat(mma.fk(mma.home + 0.001)[None], 50, axis=0), mma.home, DT)
    assert np.ptp(result.q[5:], axis=0).max() == 0.0


def test_closed_paths_let_the_elbow_drift_by_less_than_half_a_degree(mma: Robot) -> None:
    # Least joint motion does not bring a redundant arm back to the same joints; this is how much.
    phase = np.linspace(0.0, 2.0 * math.pi, 2000)
    poses = np.repeat(mma.fk(mma.home)[None], 2000, axis=0)
    poses[:, 0, 3] += 0.03 * np.sin(phase)
    poses[:, 1, 3] += 0.03 * (np.cos(phase) - 1.0)
    poses[:, 2, 3] += 0.03 * np.sin(2.0 * phase)
    result = mma.follow(poses, mma.home, DT)
    assert result.residual.max() <= REACHED
    assert 0.0 < np.abs(result.q[-1] - mma.home).max() < math.radians(0.5)


def test_status_tells_of_the_wrist_singularity(mma: Robot) -> None:
    q = np.radians([10.0, -80.0, 5.0, 85.0, 90.0, 90.0, 20.0])
    assert mma.ik(mma.fk(q), q).status == IkStatus.NEAR_SINGULAR
    q[5] -= 0.5
    assert mma.ik(mma.fk(q), q).status == IkStatus.FOLLOWED


def test_near_singular_is_a_smallest_singular_value_under_the_bound(mma: Robot) -> None:
    for q in readings(mma, 300, seed=10):
        J = mma.jacobian(q)
        weighted = J / np.array([0.1] * 3 + [1.0] * 3)[:, None]
        smallest = np.linalg.svd(weighted, compute_uv=False)[-1]
        for share in (0.5, 0.999, 1.001, 2.0):
            assert is_near_singular(J, 0.1, share * smallest) == (share > 1.0)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.0, math.pi - 1e-9, math.pi])
def test_pose_error_is_the_weighted_distance_and_angle(angle: float) -> None:
    here = transform(rotation("x", 0.3), np.zeros(3))
    there = transform(rotation("y", angle) @ here[:3, :3], np.array([0.0, 0.0, 0.05]))
    error = np.empty(6)
    square = pose_error(here, there, 0.1, error)
    assert math.isclose(square, 0.25 + angle**2, rel_tol=1e-9)
    assert np.allclose(error[:3], [0.0, 0.0, 0.5])
