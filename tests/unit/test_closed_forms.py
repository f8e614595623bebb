"""Closed forms of arms from files: all solutions, limits, whole turns, paths and classes."""

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from eaik.IK_HP import HPRobot

from present import present
from random_arms import (
    IIWA14,
    IIWA14_LIMITS,
    PARALLEL,
    SHOULDERS,
    UR5E,
    WIDE,
    parallel_axes,
    swivel_axes,
    urdf,
    wrist_axes,
)
from real_arms import urdf_of
from teleop_core.kernels import Array, kernel
from teleop_core.kinematics import IkResult
from teleop_core.kinematics.branches import turn
from teleop_core.kinematics.closed_form import candidates, swivel, swivel_arcs
from teleop_core.robots import IkStatus, dexterity, load_robot
from teleop_core.robots.arms.as_chain import chain_of
from teleop_core.robots.robot import Robot

Case = tuple[str, Callable[[np.random.Generator, str], list[tuple[Array, Array]]], str, int]
Load = Callable[..., Robot]
REACHED = (IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR)
SIX = [(kind, wrist_axes, "spherical") for kind in SHOULDERS]
SIX += [(kind, parallel_axes, "three parallel axes") for kind in PARALLEL]
MAKERS = {kind: make for kind, make, _ in SIX}
EACH = [(*case, side) for case in SIX for side in (1, -1)]
NAMES = [f"{word}, {kind}, {'base' if side > 0 else 'tip'}" for kind, _, word, side in EACH]


@pytest.fixture
def load(tmp_path: Path) -> Any:
    """Robot of axes with limits [rad], the same for all joints or one pair for each."""

    def made(
        axes: list[tuple[Array, Array]], limits: Sequence[float | tuple[float, float]] = (-math.pi, math.pi)
    ) -> Robot:
        pairs = limits if isinstance(limits, list) else [limits] * len(axes)
        path = tmp_path / "arm.urdf"
        path.write_text(urdf(axes, pairs))
        return load_robot(str(path))

    return made


def narrow(rng: np.random.Generator, n: int = 6) -> list[tuple[float, float]]:
    """Limits [rad] of about a third of a turn, some of them not around zero."""
    middle, half = rng.uniform(-2.5, 2.5, n), rng.uniform(0.5, 1.5, n)
    return [(float(m - h), float(m + h)) for m, h in zip(middle, half, strict=True)]


def apart(q: Array, others: Array) -> float:
    """Smallest of the largest differences of angles [rad], whole turns aside."""
    turns = (np.asarray(others) - q + math.pi) % (2.0 * math.pi) - math.pi
    return abs(turns).max(axis=-1).min(initial=math.inf)


@pytest.mark.parametrize("case", EACH, ids=NAMES)
def test_every_legal_pose_is_found_with_all_its_solutions(case: Case, load: Load) -> None:
    kind, make, word, side = case
    rng = np.random.default_rng(len(kind))
    for _ in range(3):
        axes, limits = make(rng, kind)[::side], narrow(rng)
        arm = load(axes, limits)
        assert word in arm.solution
        q = rng.uniform(arm.lower, arm.upper, (250, 6))
        tips, seeds = arm.fk(q), np.clip(q + rng.normal(0.0, 0.02, q.shape), arm.lower, arm.upper)
        for answer in (arm.ik_batch(tips), arm.ik_batch(tips, seeds)):
            assert np.isin(answer.status, REACHED).all()
            assert answer.residual.max() < 1e-9
            assert ((answer.q >= arm.lower) & (answer.q <= arm.upper)).all()
        for wanted, joints in zip(tips[:40], q, strict=False):
            branches = arm.ik_all(wanted)
            assert 1 <= len(branches) <= 8
            assert apart(joints, branches) < 1e-5
            np.testing.assert_allclose(arm.fk(branches), np.tile(wanted, (len(branches), 1, 1)), atol=1e-9)


TWO_ROUNDS = [WIDE, WIDE, (-1.0, 5.5), WIDE, (-6.0, 0.5), WIDE]


NEAREST = {
    "two rounds": (lambda _: UR5E, TWO_ROUNDS),
    "one side": (lambda _: UR5E, [(-0.3, 4.5)] * 6),
    "wrist": (lambda rng: wrist_axes(rng, "2 and 3 parallel"), TWO_ROUNDS),
    "skew": (lambda rng: wrist_axes(rng, "skew")[::-1], WIDE),
}


@pytest.mark.parametrize("kind", NEAREST)
def test_the_nearest_branch_inside_the_limits_answers_whole_turns_included(kind: str, load: Load) -> None:
    rng = np.random.default_rng(8)
    axes, limits = NEAREST[kind]
    arm = load(axes(rng), limits)
    q, seeds = rng.uniform(arm.lower, arm.upper, (2, 2000, 6))
    answer = arm.ik_batch(arm.fk(q), q)
    np.testing.assert_allclose(answer.q, q, atol=1e-6)
    seeds[: len(seeds) // 2] = arm.home
    answer = arm.ik_batch(arm.fk(q), seeds)
    assert np.isin(answer.status, REACHED).all()
    # No branch is nearer by the largest move, in any round that the limits allow.
    rounds = 2.0 * math.pi * np.array([-1.0, 0.0, 1.0])
    for joints, seed, chosen in zip(q[900:1100], seeds[900:], answer.q[900:], strict=False):
        least = math.inf
        for branch in arm.ik_all(arm.fk(joints)):
            turns = branch[:, None] + rounds
            is_legal = (turns >= arm.lower[:, None]) & (turns <= arm.upper[:, None])
            moves = np.where(is_legal, abs(turns - seed[:, None]), math.inf).min(axis=1)
            least = min(least, moves.max())
        assert abs(abs(chosen - seed).max() - least) < 1e-9


def smooth(arm: Robot, rng: np.random.Generator, count: int = 1500) -> Array:
    """Joint path (count, n), 1 ms apart, at up to 0.8 of the speed limits, inside the limits."""
    span, t = arm.upper - arm.lower, 1e-3 * np.arange(count)[:, None]
    middle = rng.uniform(arm.lower + 0.2 * span, arm.upper - 0.2 * span)
    swing = np.minimum(0.19 * span, 1.0) * rng.uniform(0.3, 1.0, arm.n)
    rate = 0.8 * present(arm.drives).speed_limit / swing * rng.uniform(0.1, 1.0, arm.n)
    return middle + swing * np.sin(rate * t + rng.uniform(0.0, 6.3, arm.n))


def least_singular_value(arm: Robot, joints: Array) -> float:
    J = np.stack([arm.jacobian(q) for q in joints[::10]])
    J[:, :3] /= arm.geometry["reach"]
    return np.linalg.svd(J, compute_uv=False)[:, -1].min()


def check_path(arm: Robot, joints: Array) -> IkResult[Any]:
    """Follow a path, then 1.5 s of its end: speeds, limits, and that what can be reached is."""
    tips = arm.fk(joints)
    tips = np.concatenate([tips, np.repeat(tips[-1:], 1500, axis=0)])
    answer = arm.follow(tips, joints[0])
    moves = abs(np.diff(answer.q, axis=0, prepend=joints[:1]))
    assert np.isfinite(answer.q).all()
    assert (moves <= 1e-3 * present(arm.drives).speed_limit + 1e-14).all()
    assert ((answer.q >= arm.lower) & (answer.q <= arm.upper)).all()
    return answer


@pytest.mark.parametrize("case", EACH[1::3], ids=NAMES[1::3])
def test_paths_are_followed_without_a_flip_and_within_speeds(case: Case, load: Load) -> None:
    kind, make, _word, side = case
    rng = np.random.default_rng(21)
    regular = singular = late = 0
    while regular < 4 or singular < 4:
        arm = load(make(rng, kind)[::side])
        joints = smooth(arm, rng)
        answer = check_path(arm, joints)
        is_reached = np.isin(answer.status, REACHED)
        if least_singular_value(arm, joints) > 0.01:
            regular += 1
            assert is_reached.all()
            np.testing.assert_allclose(answer.q[: len(joints)], joints, atol=1e-6)
        else:
            singular += 1
            stopped = (answer.q[-1] <= arm.lower + 0.05) | (answer.q[-1] >= arm.upper - 0.05)
            # Where its branch ends, at a singularity, the arm waits.
            is_end = least_singular_value(arm, answer.q[-1:]) < 1e-3
            late += not (is_reached[-1] or stopped.any() or is_end)
    assert late == 0


@pytest.mark.parametrize("kind", ["2 and 3 parallel", "5 and 6 meet"])
def test_out_of_reach_the_nearest_posture_answers_and_motion_goes_on(kind: str, load: Any) -> None:
    rng = np.random.default_rng(4)
    arm = load(MAKERS[kind](rng, kind), WIDE)
    wanted = arm.fk(arm.home)
    far = wanted.copy()
    far[:3, 3] += np.array([3.0, 1.0, 2.0])
    answer = arm.ik(far)
    assert answer.status == IkStatus.UNREACHABLE
    starts = rng.uniform(arm.lower, arm.upper, (20, 6))
    others = arm.ik_batch(np.repeat(far[None], 20, axis=0), starts).residual
    error = np.hypot(answer.residual[0] / arm.geometry["reach"], answer.residual[1])
    assert error <= np.hypot(others[:, 0] / arm.geometry["reach"], others[:, 1]).min() + 1e-6
    way = np.concatenate([np.linspace(0.0, 1.0, 1500), np.linspace(1.0, 0.0, 1500), np.zeros(800)])
    tips = np.repeat(wanted[None], len(way), axis=0)
    tips[:, :3, 3] += way[:, None] * (far - wanted)[:3, 3]
    answer = arm.follow(tips, arm.home)
    assert (answer.status == IkStatus.UNREACHABLE).any()
    assert (abs(np.diff(answer.q, axis=0)) <= 1e-3 * present(arm.drives).speed_limit + 1e-14).all()
    assert answer.status[-1] in REACHED


def test_rounded_files_are_recognised_and_solved_to_the_last_digit(load: Load) -> None:
    axes = [(np.round(w, 5), np.round(o, 5)) for w, o in UR5E]
    axes[3] = (axes[3][0] + np.array([4e-6, 0.0, 3e-6]), axes[3][1])
    arm = load(axes)
    assert "three parallel axes" in arm.solution
    q = np.random.default_rng(2).uniform(arm.lower, arm.upper, (500, 6))
    answer = arm.ik_batch(arm.fk(q))
    assert np.isin(answer.status, REACHED).all()
    assert answer.residual.max() < 1e-9


@pytest.mark.parametrize("arm", ["m1013", "m0609", "ur5e", "irb120", "iiwa14"])
def test_files_that_say_1_571_are_solved_in_closed_form_beside_the_seed(arm: str, tmp_path: Path) -> None:
    def rounded(found: "re.Match[str]") -> str:
        angles = (float(text) for text in found[1].split())
        off = rng.uniform(-2.5e-4, 2.5e-4, 3)
        return f'rpy="{" ".join(repr(float(a + b)) for a, b in zip(angles, off, strict=True))}"'

    rng, path = np.random.default_rng(5), tmp_path / "arm.urdf"
    text = urdf_of(arm)
    path.write_text(text if arm.startswith("m") else re.sub(r'rpy="([^"]*)"', rounded, text))
    robot = load_robot(str(path))
    assert "closed form" in robot.solution
    assert "within 1e-3 of the class" in robot.solution
    q = rng.uniform(robot.lower, robot.upper, (2000, robot.n))
    seeds = np.clip(q + rng.normal(0.0, 0.05, q.shape), robot.lower, robot.upper)
    for answer in (robot.ik_batch(robot.fk(q)), robot.ik_batch(robot.fk(q), seeds)):
        assert np.isin(answer.status, REACHED).all()
        assert answer.residual.max() < 1e-9
    assert (np.abs(answer.q - seeds).max(axis=1) > 0.5).mean() < 0.003  # by stretched elbows


@pytest.mark.parametrize(("tilt", "told"), [(2e-3, "0.162°"), (0.1, "8.05°")])
def test_arms_that_do_not_decompose_are_searched_and_say_what_their_axes_miss(
    tilt: float, told: str, load: Load
) -> None:
    axes = list(UR5E)
    axes[3] = (axes[3][0] + np.array([tilt, 0.0, tilt]), axes[3][1])
    solution = load(axes).solution
    assert solution.startswith("search")
    assert f"axes 2, 3, 4 are {told} from parallel" in solution
    assert "axes 4, 5, 6 miss a point by 1" in solution


def test_the_arm_as_built_has_the_constants_of_its_chain_alone(load: Load) -> None:
    arm = load(UR5E)
    np.testing.assert_array_equal(present(chain_of(arm)).fixed[0][3], [0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("kind", ["2 and 3 parallel", "1 and 2 meet", "5 and 6 meet"])
def test_eaik_knows_as_many_solutions(kind: str, load: Load) -> None:
    rng = np.random.default_rng(12)
    axes = MAKERS[kind](rng, kind)
    arm = load(axes)
    points = [np.zeros(3), *(o for _, o in axes), arm.fk(np.zeros(6))[:3, 3]]
    peer = HPRobot(np.array([w for w, _ in axes]), np.diff(np.array(points), axis=0))
    zero = arm.fk(np.zeros(6))[:3, :3]
    for q in rng.uniform(arm.lower, arm.upper, (100, 6)):
        wanted = arm.fk(q)
        theirs = wanted.copy()
        theirs[:3, :3] = wanted[:3, :3] @ zero.T
        found = peer.IK(theirs)
        exact = [b for b, is_ls in zip(found.Q, found.is_LS, strict=True) if not is_ls]
        assert len(arm.ik_all(wanted)) == len(exact)


@pytest.mark.parametrize("seed", range(3))
def test_narrow_limits_of_seven_axes_lose_no_reachable_pose(seed: int, load: Load) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(4):
        middle, half = rng.uniform(-2.5, 2.5, 7), rng.uniform(0.05, 0.6, 7)
        arm = load(swivel_axes(rng), list(zip((middle - half).tolist(), (middle + half).tolist(), strict=True)))
        assert "swivel" in arm.solution
        q = rng.uniform(arm.lower, arm.upper, (300, 7))
        tips, seeds = arm.fk(q), np.clip(q + rng.normal(0.0, 0.02, q.shape), arm.lower, arm.upper)
        for answer in (arm.ik_batch(tips), arm.ik_batch(tips, seeds)):
            assert np.isin(answer.status, REACHED).all()
            assert answer.residual.max() < 1e-9
            assert ((answer.q >= arm.lower) & (answer.q <= arm.upper)).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_arcs_of_the_swivel_hold_a_legal_posture_without_any_search(seed: int, load: Load) -> None:
    rng = np.random.default_rng(40 + seed)
    middle, half = rng.uniform(-2.5, 2.5, 7), rng.uniform(0.02, 0.5, 7)
    arm = load(swivel_axes(rng), [(float(m - h), float(m + h)) for m, h in zip(middle, half, strict=True)])
    found, work = np.empty((13, 8)), np.empty((60, 4))
    for q in rng.uniform(arm.lower, arm.upper, (100, 7)):
        count, _ = swivel._branches(arm.fk(q), arm.geometry_row, arm.home.copy(), arm.limits(), True, found, work)
        off = (found[:count, :7] - middle + math.pi) % (2.0 * math.pi) - math.pi
        assert ((abs(off) <= half + 1e-9).all(axis=1) & (found[:count, 7] > 0.5)).any()


@kernel
def psi_of(branch: Any, elbow: Any, seed: Array, limits: Array, geometry: Array, work: Array) -> float:
    """Psi [rad] that is taken of a branch; infinity where none is legal."""
    S, W = work[16 + 20 * elbow : 25 + 20 * elbow], work[25 + 20 * elbow : 34 + 20 * elbow]
    K, arcs = geometry[candidates.constants_at(7) :], np.empty(swivel_arcs.ARCS)
    swivel_arcs.cut_circle(S, W, K, limits, arcs)
    return swivel_arcs.swivel_of(branch, S, W, K, seed, limits, arcs)


@kernel
def write_at(
    branch: Any, psi: Any, elbow: Any, seed: Array, limits: Array, geometry: Array, work: Array, q: Any
) -> None:
    """Write the joints (8,) of a branch at psi [rad], by whole turns into limits if any are."""
    S, W = work[16 + 20 * elbow : 25 + 20 * elbow], work[25 + 20 * elbow : 34 + 20 * elbow]
    K, M, angles = geometry[candidates.constants_at(7) :], work[8:12], work[12:14]
    swivel._write(S, W, psi, K, seed, M, angles, q, branch)
    turn(q, seed, limits, 0, 7)


def test_no_legal_swivel_is_nearer_to_the_seed_than_the_answer_less_its_margin(load: Load) -> None:
    rng, scan, legal = np.random.default_rng(6), np.arange(-3.14, 3.14, 0.02), 0
    for _ in range(4):
        arm, found, work = (load(swivel_axes(rng), narrow(rng, 7)), np.empty((13, 8)), np.empty((60, 4)))
        limits, row, others = arm.limits(), arm.geometry_row, [0, 1, 2, 4, 5, 6]
        for q in rng.uniform(arm.lower, arm.upper, (15, 7)):
            seed = rng.uniform(arm.lower, arm.upper)
            swivel._branches(arm.fk(q), row, seed, limits, False, found, work)
            for elbow, branch in np.ndindex(2, 4):
                psi = psi_of(branch, elbow, seed, limits, row, work)
                legal += math.isfinite(psi)
                for at in scan[abs(scan) < abs(psi) - swivel_arcs.MARGIN - 1e-9]:
                    write_at(branch, at, elbow, seed, limits, row, work, found[8])
                    joints = found[8, others]
                    is_in = (joints >= arm.lower[others]) & (joints <= arm.upper[others])
                    assert not (is_in.all() and found[8, 7] > 0.5)
    assert legal > 20


@pytest.mark.parametrize("limits", [IIWA14_LIMITS, [(-0.9, 0.7)] * 7], ids=["iiwa 14", "narrow"])
def test_seven_axes_use_their_freedom_to_follow_paths_within_speeds_and_limits(
    limits: list[tuple[float, float]], load: Load
) -> None:
    arm, rng, regular = load(IIWA14, limits), np.random.default_rng(5), 0
    for _ in range(10):
        joints = smooth(arm, rng)
        joints[:, 3] = abs(joints[:, 3]) * 0.7 + 0.2  # not through the straight elbow
        answer = check_path(arm, joints)
        if least_singular_value(arm, joints) > 0.02:
            regular += 1
            assert np.isin(answer.status, REACHED).all()
        assert answer.status[-1] in REACHED
    assert regular > 0


@kernel
def least_move(T: Any, seed: Array, limits: Array, geometry: Array, q: Array) -> bool:
    return swivel._least_move(T, seed, limits, geometry, q)


def moved_least(arm: Robot, tips: Array, q: Array) -> Array:
    """Joints (count, n) of a path by the least move alone."""
    limits, path = arm.limits().copy(), []
    limits[2] = 1e-3 * present(arm.drives).speed_limit
    for tip in tips:
        path.append(q.copy())
        assert least_move(tip, q, limits, arm.geometry_row, path[-1])
        q = path[-1]
    return np.array(path)


def past_singular(rng: np.random.Generator, flat: int, beside: int) -> Array:
    """Joint path (5000, 7) past a posture whose shoulder or wrist is flat."""
    middle, slope = rng.uniform(-1.0, 1.0, 7), rng.uniform(-0.15, 0.15, 7)
    middle[3], middle[6 - flat] = rng.choice((-1, 1), 2) * rng.uniform(0.8, 1.2, 2)
    middle[flat], middle[beside] = 0.02, rng.choice((-1, 1)) * 0.5 * math.pi
    slope[flat] = rng.choice((-1, 1)) * 0.5
    return middle + slope * np.linspace(-1.0, 1.0, 5000)[:, None]


def least_manipulability(arm: Robot, joints: Array) -> float:
    reach = arm.geometry["reach"]
    return min(dexterity.manipulability(arm, q, reach) for q in joints[::20])


@pytest.mark.parametrize(("flat", "beside"), [(1, 2), (5, 4)], ids=["shoulder", "wrist"])
def test_slow_paths_past_a_singular_posture_keep_more_manipulability(flat: int, beside: int, load: Load) -> None:
    arm, rng = load(IIWA14, IIWA14_LIMITS), np.random.default_rng(3)
    for _ in range(5):
        joints = past_singular(rng, flat, beside)
        answer = check_path(arm, joints)
        assert np.isin(answer.status, REACHED).all()
        plain = moved_least(arm, arm.fk(joints), joints[0])
        ours = least_manipulability(arm, answer.q)
        assert ours > 1.1 * least_manipulability(arm, plain)
        bends = [abs(np.diff(path, 2, axis=0)).max() for path in (answer.q[:5000], plain)]
        assert bends[0] < bends[1] + 1e-6  # 1 rad/s²
        standing = abs(np.diff(answer.q[5000:], axis=0))
        assert (standing <= 0.3e-3 * present(arm.drives).speed_limit + 1e-9).all()
        np.testing.assert_array_equal(arm.follow(arm.fk(joints), joints[0]).q, answer.q[:5000])


def test_far_from_singular_postures_the_least_move_alone_is_made(load: Load) -> None:
    arm = load(IIWA14, IIWA14_LIMITS)
    joints = np.array([0.3, 0.8, -0.4, 1.2, 0.5, -0.9, 0.2]) + 0.1 * np.sin(
        np.linspace(0.0, 6.0, 3000)[:, None] + np.arange(7)
    )
    plain = moved_least(arm, arm.fk(joints), joints[0])
    np.testing.assert_array_equal(check_path(arm, joints).q[:3000], plain)


@pytest.mark.parametrize("beside", [0.0, 0.02, 0.1])
def test_seven_axes_stay_in_the_branch_of_the_seed_and_give_up_the_margin_first(beside: float, load: Load) -> None:
    rng = np.random.default_rng(8)
    arms = [load(IIWA14, IIWA14_LIMITS), *(load(swivel_axes(rng), narrow(rng, 7)) for _ in "abc")]
    for arm in arms:
        q = rng.uniform(arm.lower, arm.upper, (2000, 7))
        seeds = np.clip(q + rng.uniform(-beside, beside, q.shape), arm.lower, arm.upper)
        moves = np.abs(arm.ik_batch(arm.fk(q), seeds).q - seeds).max(axis=1)
        known = np.abs(q - seeds).max(axis=1)
        longer = moves - known
        # The least move is looked for in eight rounds, by its sum of squares.
        assert (longer > 0.3 + 1e-9).mean() <= (0.005 if beside else 0.0)
        assert longer.max() < 1.0


def test_from_seeds_farther_beside_few_answers_leave_the_branch(load: Callable[..., Robot]) -> None:
    """Where a limit is in the way the search for the least move goes on: 2 in 1000 left without."""
    arm, rng = load(IIWA14, IIWA14_LIMITS), np.random.default_rng(8)
    q = rng.uniform(arm.lower, arm.upper, (6000, 7))
    seeds = np.clip(q + rng.uniform(-0.3, 0.3, q.shape), arm.lower, arm.upper)
    moves = np.abs(arm.ik_batch(arm.fk(q), seeds).q - seeds).max(axis=1)
    assert (moves > 1.0).sum() <= 6
