"""Serial arms of the D-H sources: the laws that every one of them obeys."""

import math
from typing import Any

import numpy as np
import pytest

from present import present
from teleop_core.base.errors import ParameterError, ShapeError, UnknownNameError
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import IkStatus, load_robot

BRANCHES = {"puma560": 8, "scara": 2, "planar_3r": 2, "five_axis": 4}
ARMS = {name: load_robot(name) for name in BRANCHES}
ROUNDING = 1e-13  # a few hundred products of numbers of size one
REACHED = 1e-9  # the promise of the interface [m, rad]
ROTARY = {name: np.array([j != "d3" for j in arm.joint_names]) for name, arm in ARMS.items()}

arms = pytest.mark.parametrize("name", BRANCHES)


def drawn(name: str, count: int, seed: int = 1) -> Array:
    arm, rng = ARMS[name], np.random.default_rng(seed)
    return rng.uniform(arm.lower, arm.upper, (count, arm.n))


def same_turns(name: str, a: Array, b: Array) -> Array:
    """Difference of joint vectors with whole turns taken out."""
    difference = a - b
    turns = np.round(difference / (2.0 * math.pi)) * (2.0 * math.pi)
    return difference - turns * ROTARY[name]


@arms
def test_every_branch_reaches_the_pose_and_one_is_the_original(name: str) -> None:
    arm = ARMS[name]
    for q in drawn(name, 500):
        pose = arm.fk(q)
        solutions = arm.ik_all(pose)
        assert solutions.shape == (BRANCHES[name], arm.n)
        assert np.abs(arm.fk(solutions) - pose).max() < ROUNDING
        # Next to a singularity joints are worse conditioned than the pose.
        assert np.abs(same_turns(name, solutions, q)).max(axis=1).min() < 1e-8


@arms
def test_reachable_poses_are_solved_from_any_seed_inside_the_limits(name: str) -> None:
    arm = ARMS[name]
    poses, seeds = arm.fk(drawn(name, 2000)), drawn(name, 2000, seed=2)
    result = arm.ik(poses, seeds)
    assert np.isin(result.status, (IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR)).all()
    assert result.residual.max() < REACHED
    assert np.abs(arm.fk(result.q) - poses).max() < REACHED
    assert (result.q >= arm.lower).all()
    assert (result.q <= arm.upper).all()


@arms
def test_the_chosen_branch_is_the_nearest_to_the_seed_that_limits_allow(name: str) -> None:
    arm = ARMS[name]
    for q, seed in zip(drawn(name, 300), drawn(name, 300, seed=2), strict=True):
        result = arm.ik(arm.fk(q), seed)
        turns = np.array(np.meshgrid(*([-1, 0, 1] if r else [0] for r in ROTARY[name])))
        shifts = 2.0 * math.pi * turns.reshape(arm.n, -1).T
        all_q = (arm.ik_all(arm.fk(q))[:, None] + shifts[None]).reshape(-1, arm.n)
        inside = ((all_q >= arm.lower - 1e-9) & (all_q <= arm.upper + 1e-9)).all(axis=1)
        nearest = np.abs(all_q[inside] - seed).max(axis=1).min()
        assert np.abs(result.q - seed).max() == pytest.approx(nearest, abs=1e-8)


@arms
def test_the_original_joints_come_back_when_they_are_the_seed(name: str) -> None:
    arm, q = ARMS[name], drawn(name, 2000)
    assert np.abs(arm.ik(arm.fk(q), q).q - q).max() < 1e-8


@arms
def test_the_jacobian_is_the_difference_quotient_of_forward_kinematics(name: str) -> None:
    arm, step = ARMS[name], 1e-6
    for q in drawn(name, 50):
        jacobian, pose = arm.jacobian(q), arm.fk(q)
        for j in range(arm.n):
            ahead, behind = (arm.fk(q + side * step * np.eye(arm.n)[j]) for side in (1, -1))
            rate = (ahead - behind) / (2.0 * step)
            spin = rate[:3, :3] @ pose[:3, :3].T
            numeric = [*rate[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]]
            # Rounding over the step, 1e-16 / 1e-6, and its square.
            assert np.abs(jacobian[:, j] - numeric).max() < 1e-8


@arms
def test_single_and_batched_answers_are_bit_equal(name: str) -> None:
    arm = ARMS[name]
    q, seeds = drawn(name, 50), drawn(name, 50, seed=2)
    poses = arm.fk(q)
    batch: Any = arm.ik(poses, seeds)
    for i in range(50):
        assert np.array_equal(arm.fk(q[i]), poses[i])
        single = arm.ik(poses[i], seeds[i])
        assert np.array_equal(single.q, batch.q[i])
        assert single.status == batch.status[i]
        assert np.array_equal(single.residual, batch.residual[i])


@arms
def test_a_pose_far_away_is_unreachable_and_the_answer_finite_inside_the_limits(name: str) -> None:
    arm = ARMS[name]
    result = arm.ik(transform(np.eye(3), np.array([50.0, 20.0, 0.0])))
    assert result.status is IkStatus.UNREACHABLE
    assert np.isfinite(result.q).all()
    assert (result.q >= arm.lower).all()
    assert (result.q <= arm.upper).all()
    assert result.residual[0] > 40.0


@arms
def test_any_rigid_pose_gets_a_finite_answer_with_an_honest_residual(name: str) -> None:
    arm, rng = ARMS[name], np.random.default_rng(4)
    for _ in range(300):
        turn = rotation("z", rng.uniform(-3, 3)) @ rotation("y", rng.uniform(-3, 3))
        pose = transform(turn @ rotation("x", rng.uniform(-3, 3)), rng.uniform(-1.5, 1.5, 3))
        result = arm.ik(pose, rng.uniform(arm.lower, arm.upper))
        assert np.isfinite(result.q).all()
        assert (result.q >= arm.lower).all()
        assert (result.q <= arm.upper).all()
        left = np.linalg.norm(arm.fk(result.q)[:3, 3] - pose[:3, 3])
        assert result.residual[0] == pytest.approx(left, abs=1e-12)


@arms
def test_the_base_axis_itself_is_answered_with_finite_joints(name: str) -> None:
    arm = ARMS[name]
    for height in (0.0, -0.1, 0.215):
        result = arm.ik(transform(np.eye(3), np.array([0.0, 0.0, height])))
        assert np.isfinite(result.q).all()
        assert np.isfinite(arm.ik_all(transform(np.eye(3), np.array([0.0, 0.0, height])))).all()


@arms
def test_a_path_keeps_every_joint_within_its_speed_and_its_branch(name: str) -> None:
    arm, dt = ARMS[name], 1e-3
    # Around home, where no singularity offers another branch.
    way = arm.home + 0.05 * np.linspace(-1.0, 1.0, 400)[:, None]
    result = arm.follow(arm.fk(way), way[0], dt)
    steps = np.abs(np.diff(np.vstack((way[0], result.q)), axis=0))
    assert (steps <= present(arm.drives).speed_limit * dt * (1.0 + 1e-9)).all()
    assert (result.status == IkStatus.FOLLOWED).all()
    assert np.abs(result.q - way).max() < 1e-8


@arms
def test_random_jumps_never_move_a_joint_faster_than_its_drive_or_out_of_its_limits(
    name: str,
) -> None:
    arm, dt = ARMS[name], 1e-2
    poses = arm.fk(drawn(name, 500, seed=6))
    result = arm.follow(poses, arm.home, dt)
    steps = np.abs(np.diff(np.vstack((arm.home, result.q)), axis=0))
    assert (steps <= present(arm.drives).speed_limit * dt * (1.0 + 1e-9)).all()
    assert (result.q >= arm.lower).all()
    assert (result.q <= arm.upper).all()


@arms
def test_a_path_that_stops_far_away_is_reached_in_the_end(name: str) -> None:
    arm, near = ARMS[name], ARMS[name].home + 0.3
    near = np.clip(near, arm.lower, arm.upper)
    poses = np.repeat(arm.fk(near)[None], 4000, axis=0)
    result = arm.follow(poses, arm.home, 1e-3)
    assert result.status[0] == IkStatus.LIMITED
    assert result.residual[-1].max() < REACHED
    assert np.abs(result.q[-1] - near).max() < 1e-8


@arms
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_numbers_that_are_not_finite_are_refused(name: str, bad: float) -> None:
    arm = ARMS[name]
    pose, q = np.eye(4), arm.home.copy()
    pose[0, 3] = q[0] = bad
    for call in (lambda: arm.fk(q), lambda: arm.ik(pose), lambda: arm.ik(np.eye(4), q)):
        with pytest.raises(ParameterError):
            call()


@arms
def test_matrices_that_are_not_rigid_and_wrong_shapes_are_refused(name: str) -> None:
    arm = ARMS[name]
    with pytest.raises(ParameterError):
        arm.ik(np.diag([1.0, 1.0, -1.0, 1.0]))
    with pytest.raises(ParameterError):
        arm.ik_all(2.0 * np.eye(4))
    with pytest.raises(ShapeError):
        arm.fk(np.zeros(arm.n + 1))


@arms
def test_unknown_symbols_list_the_known_ones_and_impossible_lengths_are_refused(name: str) -> None:
    with pytest.raises(UnknownNameError) as caught:
        load_robot(name, wing=1.0)
    assert set(caught.value.alternatives) == set(ARMS[name].geometry)
    for value in (-1e3, math.nan, "long"):
        for symbol in ARMS[name].geometry:
            with pytest.raises(ParameterError) as refused:
                load_robot(name, **{symbol: value})
            assert refused.value.name == symbol


@arms
def test_home_is_inside_the_limits_and_far_from_singular(name: str) -> None:
    arm = ARMS[name]
    assert (arm.lower < arm.home).all()
    assert (arm.home < arm.upper).all()
    assert arm.ik(arm.fk(arm.home)).status is IkStatus.FOLLOWED


@arms
def test_the_drive_table_is_complete_and_the_model_runs(name: str) -> None:
    arm = ARMS[name]
    for entry in present(arm.drives).entries().values():
        assert entry.shape == (arm.n,)
        assert (entry > 0.0).all()
    out = np.empty(arm.n)
    present(arm.dynamics).acceleration(
        arm.home.copy(),
        np.zeros(arm.n),
        np.ones(arm.n),
        present(arm.dynamics).parameters.copy(),
        out,
    )
    assert np.array_equal(out, 1.0 / present(arm.drives).inertia)
