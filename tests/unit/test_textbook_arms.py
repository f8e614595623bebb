"""Textbook arms: numbers of lecture and thesis, singular paths.

What holds for every arm with a closed form stands in ``test_robot_laws``.
"""

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from random_arms import table
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.kinematics.closed_form.decomposition import SEARCH
from teleop_core.robots import IkStatus, load_robot
from teleop_core.robots.arms.dh import load_table
from ways import followed

NAMES = ("puma560", "scara", "planar_3r", "five_axis")
PUMA, SCARA, PLANAR, FIVE = (load_robot(name) for name in NAMES)
A2, A3, D3, D4 = PUMA.geometry.values()
ROUNDING, DEGREE, DT = 1e-14, math.pi / 180.0, 1e-3
PRINTED = 5e-7  # half of the last digit of the spec's numbers


def drawn(arm: object, count: int = 100, seed: int = 1) -> Array:
    rng = np.random.default_rng(seed)
    return rng.uniform(arm.lower, arm.upper, (count, arm.n))  # type: ignore[attr-defined]


def apart(a: Array, b: Array) -> Array:
    """Largest difference of joint vectors with whole turns taken out."""
    off: Array = np.abs((a - b + math.pi) % (2.0 * math.pi) - math.pi).max(axis=-1)
    return off


def test_slides_first_joints_and_links_that_do_not_fit_the_plane_are_searched() -> None:
    turns: list[dict[str, Any]] = [{"theta": "q"}, {"a": 0.4, "theta": "q"}, {"a": 0.3, "theta": "q"}]
    leaning = {"alpha": 30, "a": 0.1, "d": "q", "lower": 0, "upper": 1}
    for rows, task in (
        ([*turns, leaning], ["x", "y", "z", "rz"]),
        ([{"theta": "q"}, {**turns[0], "alpha": 60}, *turns[1:]], ["x", "y", "z", "rz"]),
        (turns, ["x", "y", "z"]),
    ):
        assert table(rows, task=task).robot().solution == SEARCH.text
    assert load_robot("scara", a1=0.0).solution == SEARCH.text


# PUMA 560.


def puma_links(q: Array) -> Array:
    """D4: the six link matrices of the lecture, row 2 of 5_6T repaired; their product."""
    (c1, c2, c3, c4, c5, c6), (s1, s2, s3, s4, s5, s6) = np.cos(q), np.sin(q)
    last, out = [0, 0, 0, 1], np.eye(4)
    for link in (
        [[c1, -s1, 0, 0], [s1, c1, 0, 0], [0, 0, 1, 0], last],
        [[c2, -s2, 0, 0], [0, 0, 1, 0], [-s2, -c2, 0, 0], last],
        [[c3, -s3, 0, A2], [s3, c3, 0, 0], [0, 0, 1, D3], last],
        [[c4, -s4, 0, A3], [0, 0, 1, D4], [-s4, -c4, 0, 0], last],
        [[c5, -s5, 0, 0], [0, 0, -1, 0], [s5, c5, 0, 0], last],
        [[c6, -s6, 0, 0], [0, 0, 1, 0], [-s6, -c6, 0, 0], last],
    ):
        out = out @ np.array(link)
    return out


def test_d4_d5_product_of_the_pumas_links_is_the_lectures_with_its_repair() -> None:
    for q in drawn(PUMA):
        assert np.abs(PUMA.fk(q) - puma_links(q)).max() < ROUNDING


def test_lengths_ranges_and_wrist_centre_are_those_of_roboticstoolbox() -> None:
    import roboticstoolbox as rtb  # takes seconds

    # Its zeros differ (standard table, joints 1 and 2 half a turn on), its base is on the floor.
    peer = rtb.models.DH.Puma560()
    assert (peer.links[1].a, peer.links[2].a, peer.links[2].d, peer.links[3].d) == (A2, A3, D3, D4)
    shift = np.array([0.0, math.pi, 0.0, 0.0, 0.0, 0.0])
    assert np.abs(PUMA.lower - (peer.qlim[0] - shift)).max() < ROUNDING
    assert np.abs(PUMA.upper - (peer.qlim[1] - shift)).max() < ROUNDING
    for q in drawn(PUMA):
        theirs = peer.fkine([q[0] + math.pi, q[1] + math.pi, *q[2:]]).A[:3, 3]
        theirs[2] -= 26.45 * 0.0254
        assert np.abs(PUMA.fk(q)[:3, 3] - theirs).max() < 1e-12


def test_a_straight_wrist_has_valid_branches_and_keeps_the_seed_of_joint_4() -> None:
    rng = np.random.default_rng(3)
    for q in drawn(PUMA, 300):
        q[4] = 0.0
        # Room for the seed, and for joint 6 to take over what joint 4 keeps.
        q[:] = 0.8 * q
        # Far from the other singularities, whose rounding would bend the wrist by 1e-8.
        q[1:3] = PUMA.home[1:3]
        pose = PUMA.fk(q)
        assert np.abs(PUMA.fk(PUMA.ik_all(pose)) - pose).max() < 1e-9
        seed = q + rng.uniform(-0.1, 0.1, 6)
        result = PUMA.ik(pose, seed)
        assert result.status is IkStatus.NEAR_SINGULAR
        assert result.q[3] == pytest.approx(seed[3], abs=1e-12)
        assert result.residual.max() < 1e-9


def test_the_cylinder_around_axis_1_and_a_folded_arm_cannot_be_reached() -> None:
    for place in ((0.1, 0.0, 0.3), (0.0, D3, 0.0)):
        pose = transform(np.eye(3), np.array(place))
        assert len(PUMA.ik_all(pose)) == 0
        assert PUMA.ik(pose).status is IkStatus.UNREACHABLE


def swung(tilt: float, most: float, count: int) -> Array:
    """Poses of the PUMA's tool swung about its y axis through a straight wrist, tilted about x."""
    straight = PUMA.home.copy()
    straight[4] = 0.0
    pose, tilted = PUMA.fk(straight), rotation("x", tilt)
    turns = [pose[:3, :3] @ rotation("y", a) @ tilted for a in np.linspace(most, -most, count)]
    return np.array([transform(turn, pose[:3, 3]) for turn in turns])


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-4, 1e-2, -0.1])
def test_the_wrist_passes_through_and_beside_its_singularity_without_a_halt(tilt: float) -> None:
    path = swung(tilt, 0.4, 2000)
    result = followed(PUMA, path, PUMA.ik(path[0], PUMA.home).q)
    assert result.residual[-1].max() < 1e-9
    assert not (result.status == IkStatus.UNREACHABLE).any()
    assert result.residual[:, 1].max() < 0.05
    assert (result.residual[:, 1] > 1e-9).sum() < 400
    # Lagging costs little position: the wrist axes pass through the tip.
    assert result.residual[:, 0].max() < 0.01


def test_a_slow_path_through_the_straight_wrist_has_no_error_at_all() -> None:
    path = swung(0.0, 0.2, 2001)
    result = PUMA.follow(path, PUMA.ik(path[0], PUMA.home).q, DT)
    assert result.residual.max() < 1e-9
    assert np.abs(np.diff(result.q, axis=0)).max() < 1e-3


@pytest.mark.parametrize("beyond", [1.001, 1.4])
@pytest.mark.parametrize("arm", [PUMA, FIVE], ids=["puma560", "five_axis"])
def test_reaching_out_beyond_the_stretched_arm_and_back_keeps_the_elbow(arm: Any, beyond: float) -> None:
    is_puma = arm is PUMA
    q = np.array([0.1, -0.5, -1.3, 0.2, 0.7, 0.1] if is_puma else [0.2, -0.6, 1.0, -0.4, 0.3])
    reach = math.hypot(A2 + math.hypot(A3, D4), D3) if is_puma else arm.geometry["a2"] + arm.geometry["a3"]
    pose = arm.fk(q)
    far, held = pose[:3, 3].copy(), 3 if is_puma else 2  # directions in which it reaches out
    far[:held] *= beyond * reach / np.linalg.norm(far[:held])
    result = followed(arm, out_and_back(pose, far), q)
    assert (result.status == IkStatus.UNREACHABLE).any()
    assert result.residual[-1].max() < 1e-9


def out_and_back(pose: Array, far: Array) -> Array:
    way = np.linspace(pose[:3, 3], far, 3000)
    points = np.concatenate((way, way[::-1], way[:1].repeat(1000, axis=0)))
    return np.array([transform(pose[:3, :3], p) for p in points])


LINES: dict[str, tuple[Any, Array, tuple[float, float], float, tuple[float, ...]]] = {
    "puma560": (PUMA, rotation("y", math.pi), (0.4, -0.4), 0.5, (0.0, 0.05, D3 - 1e-3, D3, D3 + 1e-6, D3 + 1e-3, 0.3)),
    "scara": (SCARA, np.eye(3), (0.5, -0.5), -0.1, (0.0, 1e-9, 1e-3, 0.1, 0.3)),
    "planar_3r": (PLANAR, np.eye(3), (1.1, -0.1), 0.0, (0.0, 1e-9, 1e-3, 0.1, 0.19, 0.21)),
    "five_axis": (FIVE, FIVE.fk(FIVE.home)[:3, :3], (0.2, -0.2), 0.3, (0.0, 1e-9, 1e-4, 1e-2)),
}
"""Lines along x past axis 1, or the hole in the middle: arm, attitude, ends, height, distances in y."""


@pytest.mark.parametrize("name", LINES)
def test_lines_over_and_beside_the_first_axis_keep_speeds_and_go_on(name: str) -> None:
    arm, attitude, ends, height, distances = LINES[name]
    x = np.concatenate((np.linspace(*ends, 4000), np.full(4000, ends[1])))
    for y in distances:
        poses = np.array([transform(attitude, np.array([value, y, height])) for value in x])
        result = followed(arm, poses, arm.ik(poses[0]).q)
        if arm is PUMA and y > D3:  # no branch flips, and no limit is in the way on this side
            assert result.residual[-1, 0] < 1e-9


# SCARA.


def test_d9_numbers_and_the_other_elbow() -> None:
    q = np.array([25.0 * DEGREE, 50.0 * DEGREE, 0.12, -30.0 * DEGREE])
    pose = SCARA.fk(q)
    assert np.abs(pose[:3, 3] - (0.440169, 0.458825, -0.12)).max() < PRINTED
    assert math.atan2(pose[1, 0], pose[0, 0]) == pytest.approx(45.0 * DEGREE, abs=ROUNDING)
    first, second = SCARA.ik_all(pose)
    assert np.abs(first - q).max() < 1e-12
    scale = np.array([DEGREE, DEGREE, 1.0, DEGREE])
    assert np.abs(second / scale - (67.377701, -50.0, 0.12, 27.622299)).max() < PRINTED


def test_h11_proximal_and_distal_tables_of_the_thesis_are_one_arm() -> None:
    # Singh 2014, tables 3.1 and 3.3: theta2 and d3 change sign, d2 = d5 = 0.
    slide = {"lower": -1, "upper": 1}
    distal = [
        {"a": 0.4, "alpha": 180, "d": 0.3, "theta": "q"},
        {"a": 0.3, "theta": "q"},
        {"d": "q", **slide},
        {"d": 0.05, "theta": "q"},
    ]
    proximal = [
        {"d": 0.3, "theta": "q"},
        {"a": 0.4, "theta": "q"},
        {"a": 0.3, "d": "q", **slide},
        {"alpha": 180, "d": 0.05, "theta": "q"},
    ]
    sheth_uicker = [
        {"a": 0.4, "alpha": 180, "c": 0.3, "gamma": "q"},
        {"a": 0.3, "gamma": "q"},
        {"c": "q", **slide},
        {"c": 0.05, "gamma": "q"},
    ]
    task = ["x", "y", "z", "rz"]
    one, two = table(distal, "standard", task=task).robot(), table(proximal, task=task).robot()
    three = table(sheth_uicker, "sheth_uicker", task=task).robot()
    for q in np.random.default_rng(2).uniform(-1.0, 1.0, (50, 4)):
        assert np.abs(one.fk(q) - two.fk(q * (1, -1, -1, 1))).max() < ROUNDING
        assert np.abs(one.fk(q) - three.fk(q)).max() < ROUNDING
        for arm in (one, two, three):
            assert "closed form, 2" in arm.solution
            assert apart(arm.ik_all(arm.fk(q)), q).min() < 1e-9


def test_tilt_and_height_that_an_arm_lacks_are_left_as_residual_and_the_rest_is_followed() -> None:
    for arm, q, axis, height in (
        (SCARA, [0.3, 0.8, 0.1, -0.4], "x", 0.0),
        (PLANAR, [0.4, 0.9, -0.5], "y", 0.25),
        (FIVE, FIVE.home, "x", 0.0),
    ):
        for tilt, lift in ((0.3, 0.0), (0.0, height)):
            pose = arm.fk(q)
            pose[2, 3] += lift
            pose[:3, :3] = pose[:3, :3] @ rotation(axis, tilt)
            result = arm.ik(pose, q)
            assert result.status is IkStatus.FOLLOWED
            assert np.abs(result.q - q).max() < 1e-12
            assert result.residual == pytest.approx((lift, tilt), abs=1e-12)
            assert (len(arm.ik_all(pose)) == 0) == (tilt + lift > 0.0)
    masks = [[int(is_held) for is_held in arm.task_mask] for arm in (SCARA, PLANAR, FIVE)]
    assert masks == [[1, 1, 1, 0, 0, 1], [1, 1, 0, 0, 0, 1], [1, 1, 1, 0, 1, 1]]


def test_a_height_beyond_the_slide_is_limited_not_unreachable() -> None:
    pose = SCARA.fk([0.3, 0.8, 0.2, 0.0])
    pose[2, 3] = -0.25
    result = SCARA.ik(pose)
    assert result.status is IkStatus.LIMITED
    assert result.residual[0] == pytest.approx(0.05)
    assert result.q[2] == 0.2


def test_the_tool_turns_on_over_a_whole_turn_without_unwinding() -> None:
    q, turns = SCARA.home, np.linspace(-math.pi, math.pi, 4001)
    poses = np.array([transform(rotation("z", a), SCARA.fk(q)[:3, 3]) for a in turns])
    seed = SCARA.ik(poses[0], q - (0.0, 0.0, 0.0, 3.0)).q
    result = SCARA.follow(poses, seed, DT)
    assert result.residual.max() < 1e-9
    assert result.q[-1, 3] - result.q[0, 3] == pytest.approx(2.0 * math.pi, abs=1e-9)


# Planar 3R.


def test_d3_numbers_and_the_other_elbow() -> None:
    q = np.array([30.0, 45.0, -60.0]) * DEGREE
    pose = PLANAR.fk(q)
    assert np.abs(pose[:2, 3] - (1.556044, 1.402150)).max() < PRINTED
    assert math.atan2(pose[1, 0], pose[0, 0]) == pytest.approx(15.0 * DEGREE, abs=ROUNDING)
    wrist = load_robot("planar_3r", l3=0.0).fk(q)
    assert np.abs(wrist[:2, 3] - (1.073081, 1.272741)).max() < PRINTED
    solutions = PLANAR.ik_all(pose)
    assert np.abs(solutions[0] - q).max() < 1e-12
    assert np.abs(solutions[1] / DEGREE - (69.7298, -45.0, -9.7298)).max() < 5e-5


def test_points_outside_the_ring_have_no_branch() -> None:
    for x, count in ((2.3 + 1e-6, 0), (0.7 - 1e-6, 0), (2.3 - 1e-6, 2), (0.7 + 1e-6, 2)):
        pose = transform(np.eye(3), np.array([x, 0.0, 0.0]))
        assert len(PLANAR.ik_all(pose)) == count
        assert (PLANAR.ik(pose).status is IkStatus.UNREACHABLE) == (count == 0)


@pytest.mark.parametrize("lateral", [0.0, 1e-9, 1e-3, 0.05])
def test_stretching_out_and_back_keeps_speeds_and_ends_on_the_path(lateral: float) -> None:
    start = transform(np.eye(3), np.array([1.6, lateral, 0.0]))
    poses = out_and_back(start, np.array([2.5, lateral, 0.0]))
    result = followed(PLANAR, poses, PLANAR.ik(poses[0]).q)
    assert result.residual[-1].max() < 1e-9
    # Beyond reach the nearest point of the ring is held.
    assert result.residual[2999, 0] == pytest.approx(math.hypot(2.0, lateral) - 1.8, abs=1e-6)


def test_equal_links_folded_onto_the_axis_keep_the_seed_of_joint_1() -> None:
    arm = load_robot("planar_3r", l1=0.5, l2=0.5, l3=0.0)
    result = arm.ik(np.eye(4), [0.7, 2.5, 0.0])
    assert result.q[0] == pytest.approx(0.7)
    assert np.isfinite(result.q).all()


# Five-axis arm.


def test_h12_the_thesis_tables_of_two_conventions_are_this_arm() -> None:
    distal = load_table("config/robots/five_axis_standard.yaml").robot()
    rolled = load_table("config/robots/five_axis_sheth_uicker.yaml").robot()
    roll = transform(rotation("z", -math.pi / 2.0), np.zeros(3))
    for q in drawn(FIVE):
        assert np.abs(distal.fk(q) - FIVE.fk(q)).max() < ROUNDING
        ours = FIVE.fk(q - (0.0, 0.0, 0.0, math.pi / 2.0, 0.0)) @ roll
        assert np.abs(rolled.fk(q) - ours).max() < ROUNDING
    assert all("closed form, 4 solutions" in arm.solution for arm in (distal, rolled))


def test_at_home_the_tool_points_straight_down_and_at_zero_of_joint_4_forward() -> None:
    assert np.abs(FIVE.fk(FIVE.home)[:3, 2] - (0.0, 0.0, -1.0)).max() < ROUNDING
    forward = FIVE.fk([0.0, 0.0, 0.0, -math.pi / 2.0, 0.0])
    assert np.abs(forward[:3, 2] - (1.0, 0.0, 0.0)).max() < ROUNDING
    d1, a2, a3, d5 = FIVE.geometry.values()
    assert np.abs(forward[:3, 3] - (a2 + a3 + d5, 0.0, d1)).max() < ROUNDING


def test_no_other_attitude_of_the_arm_is_nearer_than_the_one_it_takes() -> None:
    arm, rng, count = load_robot("five_axis", d5=0.0), np.random.default_rng(5), 0
    grid = np.linspace(-math.pi, math.pi, 61)
    for _ in range(40):
        wanted = arm.fk(arm.home)  # any pitch leaves the tip where it is
        wanted[:3, :3] = Rotation.random(random_state=rng).as_matrix()
        q, status, _ = arm.ik(wanted)
        if status is not IkStatus.FOLLOWED:
            continue  # a limit has a say

        def misses(pitch_roll: Array, q: Array = q, wanted: Array = wanted) -> Array:
            turns = arm.fk(q + np.pad(pitch_roll, ((0, 0), (3, 0))))[:, :3, :3]
            return np.asarray(Rotation.from_matrix(np.swapaxes(turns, 1, 2) @ wanted[:3, :3]).magnitude())

        best, count = misses(np.zeros((1, 2))), count + 1
        assert best <= misses(np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)).min() + 1e-12
        # And it is a stationary point: small moves never help.
        assert best <= misses(rng.uniform(-1e-4, 1e-4, (20, 2))).min() + 1e-12
    assert count > 10
