"""Laws of all robots, and of all serial arms with a closed form."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from present import present
from teleop_core.base.errors import ParameterError, ShapeError, UnknownNameError
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import IkStatus, list_robots, load_robot
from teleop_core.robots.robot import Robot
from ways import followed

TABLES = sorted(map(str, (Path(__file__).parents[2] / "config/robots").glob("*.yaml")))
BRANCHES = {"rcrt1": 4, "puma560": 8, "scara": 2, "planar_3r": 2, "five_axis": 4}
BRANCHES |= {table: 2 if "scara" in table else 4 for table in TABLES if "rcrt1" not in table}  # that is searched


class _Loaded(dict[str, Robot]):
    """Robots by name, loaded when a test asks: some compile kernels for seconds."""

    def __missing__(self, name: str) -> Robot:
        self[name] = load_robot(name)
        return self[name]


ARMS = _Loaded()
ROUNDING = 1e-13  # a few hundred products of numbers of size one
REACHED = 1e-9  # the promise of the interface [m, rad]
arms = pytest.mark.parametrize("name", BRANCHES)
robots = pytest.mark.parametrize("name", list_robots())


def drawn(name: str, count: int, seed: int = 1) -> Array:
    arm, rng = ARMS[name], np.random.default_rng(seed)
    return rng.uniform(arm.lower, arm.upper, (count, arm.n))


def near_home(name: str, count: int) -> Array:
    """Joint vectors whose poses are next to home: their loops are closed."""
    arm, rng = ARMS[name], np.random.default_rng(3)
    turn = rotation("x", 0.04) @ rotation("y", -0.03) @ rotation("z", 0.02)
    moves = [transform(turn, shift) for shift in rng.uniform(-2e-3, 2e-3, (count, 3))]
    q: Array = arm.ik(arm.fk(arm.home) @ moves).q
    return q


def rotary(name: str) -> Array:
    """Which joints turn (n,)."""
    return np.array([joint != "d3" for joint in ARMS[name].joint_names])


def same_turns(name: str, a: Array, b: Array) -> Array:
    """Difference of joint vectors with whole turns taken out."""
    difference = a - b
    turns = np.round(difference / (2.0 * math.pi)) * (2.0 * math.pi)
    return difference - turns * rotary(name)


@arms
def test_every_branch_reaches_the_pose_and_one_is_the_original(name: str) -> None:
    arm = ARMS[name]
    for q in drawn(name, 200):
        pose = arm.fk(q)
        solutions = arm.ik_all(pose)
        assert solutions.shape == (BRANCHES[name], arm.n)
        assert np.abs(arm.fk(solutions) - pose).max() < ROUNDING
        # Next to a singularity joints are worse conditioned than the pose.
        assert np.abs(same_turns(name, solutions, q)).max(axis=1).min() < 1e-8


@robots
def test_every_branch_of_any_robot_reaches_its_pose_and_ik_gives_one_of_them(name: str) -> None:
    arm = ARMS[name]
    for q in near_home(name, 20):
        pose = arm.fk(q)
        solutions = arm.ik_all(pose)
        # Legs of the hybrid that agree to rounding leave the pose as the root of that.
        assert np.abs(arm.fk(solutions) - pose).max() < (1e-6 if name == "scara_stewart" else 1e-9)
        assert np.abs(arm.fk(arm.ik(pose, q).q) - pose).max() < 1e-6


@arms
def test_reachable_poses_are_solved_from_any_seed_inside_the_limits(name: str) -> None:
    arm = ARMS[name]
    poses, seeds = arm.fk(drawn(name, 1000)), drawn(name, 1000, seed=2)
    result = arm.ik(poses, seeds)
    assert np.isin(result.status, (IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR)).all()
    assert result.residual.max() < REACHED
    assert np.abs(arm.fk(result.q) - poses).max() < REACHED
    assert (result.q >= arm.lower).all()
    assert (result.q <= arm.upper).all()


@arms
def test_the_chosen_branch_is_the_nearest_to_the_seed_that_limits_allow(name: str) -> None:
    arm = ARMS[name]
    for q, seed in zip(drawn(name, 150), drawn(name, 150, seed=2), strict=True):
        result = arm.ik(arm.fk(q), seed)
        turns = np.array(np.meshgrid(*([-1, 0, 1] if r else [0] for r in rotary(name))))
        shifts = 2.0 * math.pi * turns.reshape(arm.n, -1).T
        all_q = (arm.ik_all(arm.fk(q))[:, None] + shifts[None]).reshape(-1, arm.n)
        inside = ((all_q >= arm.lower - 1e-9) & (all_q <= arm.upper + 1e-9)).all(axis=1)
        nearest = np.abs(all_q[inside] - seed).max(axis=1).min()
        assert np.abs(result.q - seed).max() == pytest.approx(nearest, abs=1e-8)


# The legs of the hybrid contradict each other by a step; pinned loops are the test of its Jacobian.
@pytest.mark.parametrize("name", [name for name in (*list_robots(), *TABLES) if name != "scara_stewart"])
def test_the_jacobian_is_the_difference_quotient_of_forward_kinematics(name: str) -> None:
    arm, step, is_chain = ARMS[name], 1e-6, name in BRANCHES
    for q in drawn(name, 50) if is_chain or name == "mma" else near_home(name, 6):
        jacobian, pose = arm.jacobian(q), arm.fk(q)
        for j in range(arm.n):
            ahead, behind = (arm.fk(q + side * step * np.eye(arm.n)[j]) for side in (1, -1))
            rate = (ahead - behind) / (2.0 * step)
            spin = rate[:3, :3] @ pose[:3, :3].T
            numeric = [*rate[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]]
            # Rounding over the step, 1e-16 / 1e-6, and its square; loops are solved to rounding.
            assert np.abs(jacobian[:, j] - numeric).max() < (1e-8 if is_chain else 1e-5)


@robots
def test_single_and_batched_answers_are_bit_equal(name: str) -> None:
    arm = ARMS[name]
    q, seeds = near_home(name, 20), near_home(name, 20)[::-1].copy()
    poses = arm.fk(q)
    for given, seed_of in ((seeds, lambda i: seeds[i]), (seeds[0], lambda i: seeds[0])):
        batch: Any = arm.ik(poses, given)
        for i in range(20):
            assert np.array_equal(arm.fk(q[i]), poses[i])
            single = arm.ik(poses[i], seed_of(i))
            assert np.array_equal(single.q, batch.q[i])
            assert single.status == batch.status[i]
            assert np.array_equal(single.residual, batch.residual[i])
    empty: Any = arm.ik(np.empty((0, 4, 4)))
    assert (empty.q.shape, empty.status.shape) == ((0, arm.n), (0,))
    assert arm.fk(np.empty((0, arm.n))).shape == (0, 4, 4)


@pytest.mark.parametrize("name", [*BRANCHES, "mma", "three_finger_hand"])
def test_a_pose_far_away_is_unreachable_and_the_answer_finite_inside_the_limits(name: str) -> None:
    arm = ARMS[name]
    result = arm.ik(transform(np.eye(3), np.array([50.0, 20.0, 0.0])))
    assert result.status is IkStatus.UNREACHABLE
    assert np.isfinite(result.q).all()
    assert (result.q >= arm.lower).all()
    assert (result.q <= arm.upper).all()
    assert result.residual[0] > 40.0
    assert name in BRANCHES or not len(arm.ik_all(transform(np.eye(3), np.array([50.0, 20.0, 0.0]))))


@arms
def test_any_rigid_pose_gets_a_finite_answer_with_an_honest_residual(name: str) -> None:
    arm, rng = ARMS[name], np.random.default_rng(4)
    poses = [transform(np.eye(3), np.array([0.0, 0.0, height])) for height in (0.0, -0.1, 0.215)]  # on the base axis
    for _ in range(150):
        turn = rotation("z", rng.uniform(-3, 3)) @ rotation("y", rng.uniform(-3, 3))
        poses.append(transform(turn @ rotation("x", rng.uniform(-3, 3)), rng.uniform(-1.5, 1.5, 3)))
    for pose in poses:
        assert np.isfinite(arm.ik_all(pose)).all()
        result = arm.ik(pose, rng.uniform(arm.lower, arm.upper))
        assert np.isfinite(result.q).all()
        assert (result.q >= arm.lower).all()
        assert (result.q <= arm.upper).all()
        left = np.linalg.norm(arm.fk(result.q)[:3, 3] - pose[:3, 3])
        assert result.residual[0] == pytest.approx(left, abs=1e-12)


@arms
def test_a_path_keeps_every_joint_within_its_speed_and_its_branch(name: str) -> None:
    arm = ARMS[name]
    # Around the start, where no singularity offers another branch.
    way = arm.start + 0.05 * np.linspace(-1.0, 1.0, 4000)[:, None]
    result = followed(arm, arm.fk(way), way[0])
    assert (result.status == IkStatus.FOLLOWED).all()
    assert np.abs(result.q - way).max() < 1e-8


@pytest.mark.parametrize("name", [*BRANCHES, "mma"])
def test_random_jumps_never_move_a_joint_faster_than_its_drive_or_out_of_its_limits(name: str) -> None:
    arm = ARMS[name]
    followed(arm, arm.fk(drawn(name, 500, seed=6)), arm.home, 1e-2)


@arms
def test_a_path_that_stops_far_away_is_reached_in_the_end(name: str) -> None:
    arm, near = ARMS[name], ARMS[name].home + 0.3
    near = np.clip(near, arm.lower, arm.upper)
    poses = np.repeat(arm.fk(near)[None], 4000, axis=0)
    result = arm.follow(poses, arm.home, 1e-3)
    assert result.status[0] == IkStatus.LIMITED
    assert result.residual[-1].max() < REACHED
    assert np.abs(result.q[-1] - near).max() < 1e-8


@robots
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_numbers_that_are_not_finite_are_refused(name: str, bad: float) -> None:
    arm = ARMS[name]
    pose, q = np.eye(4), arm.home.copy()
    pose[0, 3] = q[0] = bad
    calls: Any = (arm.fk, q), (arm.ik, pose), (arm.ik_all, pose), (arm.ik, np.eye(4), q)
    for call, *given in calls:
        with pytest.raises(ParameterError):
            call(*given)


@robots
def test_matrices_that_are_not_rigid_and_wrong_shapes_are_refused(name: str) -> None:
    arm = ARMS[name]
    for bad in (np.zeros((4, 4)), 2.0 * np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0])):
        for call in (arm.ik, arm.ik_all):
            with pytest.raises(ParameterError):
                call(bad)
    poses = np.repeat(arm.fk(arm.home)[None], 3, axis=0)
    poses[2, 0, 0] += 0.1
    with pytest.raises(ParameterError) as error:
        arm.ik(poses)
    assert error.value.name == "T[2]"
    longer, pair = np.zeros(arm.n + 1), np.zeros((2, arm.n))
    wrong: Any = (arm.fk, longer), (arm.jacobian, pair), (arm.ik, np.eye(3))
    for method, *given in (*wrong, (arm.ik, np.eye(4), longer), (arm.ik, np.eye(4)[None], pair)):
        with pytest.raises(ShapeError):
            method(*given)


@robots
def test_unknown_symbols_are_refused_with_the_known_ones(name: str) -> None:
    with pytest.raises(UnknownNameError) as caught:
        load_robot(name, wing=1.0)
    assert name not in BRANCHES or set(caught.value.alternatives) == set(ARMS[name].geometry)


IMPOSSIBLE = (
    ("mma", "model", "D"), ("mma", "a2", 0.0), ("scara_stewart", "heading", "floating"), ("scara_stewart", "l1", 0.0),
    ("scara_stewart", "sigma_b", 1.0), ("four_bar", "l1", 0.0), ("four_bar", "mode", 0.5),
    ("three_finger_hand", "l12", 0.0), ("three_finger_hand", "side", -1.0), ("three_finger_hand", "side", 1.0),
    ("parallelogram", "l1", -1.0), ("rps3", "a", -1.0), ("rps3", "l_home", 0.4), ("four_bar", "l0", 60.0),
)  # fmt: skip


@robots
def test_impossible_lengths_are_refused(name: str) -> None:
    wrong = [(symbol, value) for symbol in ARMS[name].geometry for value in (math.nan, math.inf, "long")]
    wrong += [(symbol, -1e3) for symbol in ARMS[name].geometry if name in BRANCHES]
    wrong += [(symbol, value) for robot, symbol, value in IMPOSSIBLE if robot == name]
    for symbol, value in wrong:
        with pytest.raises((ParameterError, UnknownNameError)) as refused:
            load_robot(name, **{symbol: value})
        assert symbol in refused.value.name or symbol == refused.value.value


@robots
def test_home_is_inside_the_limits_and_the_answer_to_its_own_pose(name: str) -> None:
    arm = ARMS[name]
    assert (arm.lower <= arm.home).all()
    assert (arm.home <= arm.upper).all()
    answer = arm.ik(arm.fk(arm.home))
    assert answer.status is (IkStatus.NEAR_SINGULAR if name == "rcrt1" else IkStatus.FOLLOWED)
    assert np.abs(answer.q - arm.home).max() < REACHED


@robots
def test_the_drive_table_is_complete_and_the_model_runs(name: str) -> None:
    arm = ARMS[name]
    for entry in present(arm.drives).entries().values():
        assert entry.shape == (arm.n,)
        assert (entry > 0.0).all()
    out, model = np.empty(arm.n), present(arm.dynamics)
    rest, push = np.zeros(arm.n), np.ones(arm.n)
    model.acceleration(arm.home.copy(), rest, push, model.parameters.copy(), out)
    assert np.isfinite(out).all()
    if name != "rcrt1":  # the only one whose joints feel each other and gravity
        assert np.array_equal(out, 1.0 / present(arm.drives).inertia)
