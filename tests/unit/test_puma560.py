"""PUMA 560: the lecture's matrices, eight branches, an independent oracle, three singularities."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
import roboticstoolbox as rtb

import random_arms
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import IkStatus, load_robot
from teleop_core.robots.dh import DhTable, load_table
from ways import followed

ARM = load_robot("puma560")
ROUNDING = 1e-14  # ten products of numbers of size one
DEGREE = math.pi / 180.0
DT = 1e-3
A2, A3, D3, D4 = ARM.geometry_row


def table(a2: float, a3: float, d3: float, d4: float) -> DhTable:
    """Section 3 of the spec, as a table."""
    rows = [(0, 0, 0), (-90, 0, 0), (0, a2, d3), (-90, a3, d4), (90, 0, 0), (-90, 0, 0)]
    return random_arms.table([{"alpha": k, "a": a, "d": d, "theta": "q"} for k, a, d in rows])


def printed_links(q: Array) -> Array:
    """D4: the six link matrices of the lecture, row 2 of 5_6T repaired."""
    (c1, c2, c3, c4, c5, c6), (s1, s2, s3, s4, s5, s6) = np.cos(q), np.sin(q)
    last = [0, 0, 0, 1]
    return np.array(
        [
            [[c1, -s1, 0, 0], [s1, c1, 0, 0], [0, 0, 1, 0], last],
            [[c2, -s2, 0, 0], [0, 0, 1, 0], [-s2, -c2, 0, 0], last],
            [[c3, -s3, 0, A2], [s3, c3, 0, 0], [0, 0, 1, D3], last],
            [[c4, -s4, 0, A3], [0, 0, 1, D4], [-s4, -c4, 0, 0], last],
            [[c5, -s5, 0, 0], [0, 0, -1, 0], [s5, c5, 0, 0], last],
            [[c6, -s6, 0, 0], [0, 0, 1, 0], [-s6, -c6, 0, 0], last],
        ]
    )


def product(matrices: Array) -> Array:
    out = np.eye(4)
    for matrix in matrices:
        out = out @ matrix
    return out


def random_joints(count: int = 100) -> Array:
    return np.random.default_rng(1).uniform(ARM.lower, ARM.upper, (count, 6))


def test_d4_link_matrices_are_the_lectures_with_the_repair() -> None:
    for q in random_joints():
        links = table(A2, A3, D3, D4).link_transforms(q)
        assert np.abs(links - printed_links(q)).max() < ROUNDING


def test_d5_arm_and_wrist_products_are_the_lectures_with_d4_for_d6() -> None:
    for q in random_joints():
        (c1, c2, _, c4, c5, c6), (s1, s2, _, s4, s5, s6) = np.cos(q), np.sin(q)
        c23, s23 = math.cos(q[1] + q[2]), math.sin(q[1] + q[2])
        arm = [
            [c1 * c23, -c1 * s23, -s1, A2 * c1 * c2 - D3 * s1],
            [s1 * c23, -s1 * s23, c1, A2 * s1 * c2 + D3 * c1],
            [-s23, -c23, 0, -A2 * s2],
            [0, 0, 0, 1],
        ]
        wrist = [
            [c4 * c5 * c6 - s4 * s6, -c4 * c5 * s6 - s4 * c6, -c4 * s5, A3],
            [s5 * c6, -s5 * s6, c5, D4],
            [-s4 * c5 * c6 - c4 * s6, s4 * c5 * s6 - c4 * c6, s4 * s5, 0],
            [0, 0, 0, 1],
        ]
        links = printed_links(q)
        assert np.abs(product(links[:3]) - arm).max() < ROUNDING
        assert np.abs(product(links[3:]) - wrist).max() < ROUNDING
        assert np.abs(ARM.fk(q) - product(links)).max() < ROUNDING


def test_the_second_row_as_printed_would_not_be_a_rotation() -> None:
    # Spec section 9, item 1: negative case.
    printed = printed_links(np.full(6, 0.3))[5].copy()
    printed[1, :3] = (math.sin(0.3), math.cos(0.3), 0.0)
    assert abs(np.linalg.det(printed[:3, :3])) < 0.1


def test_d6_zero_pose_with_round_lengths() -> None:
    pose = load_robot("puma560", a2=0.43, a3=0.02, d3=0.15, d4=0.43).fk(np.zeros(6))
    assert np.abs(pose[:3, 3] - (0.45, 0.15, -0.43)).max() < ROUNDING
    assert np.abs(pose[:3, :3] - np.diag([1.0, -1.0, -1.0])).max() < ROUNDING


def test_the_wrist_centre_is_where_the_spec_derives_it() -> None:
    for q in random_joints():
        u = A2 * math.cos(q[1]) + A3 * math.cos(q[1] + q[2]) - D4 * math.sin(q[1] + q[2])
        c1, s1 = math.cos(q[0]), math.sin(q[0])
        z = -A2 * math.sin(q[1]) - A3 * math.sin(q[1] + q[2]) - D4 * math.cos(q[1] + q[2])
        assert np.abs(ARM.fk(q)[:3, 3] - (c1 * u - s1 * D3, s1 * u + c1 * D3, z)).max() < ROUNDING


def test_the_example_table_is_this_arm() -> None:
    arm = load_table("config/robots/puma560.yaml").robot()
    for q in random_joints():
        assert np.abs(arm.fk(q) - ARM.fk(q)).max() < ROUNDING
        assert np.abs(arm.jacobian(q) - ARM.jacobian(q)).max() < ROUNDING
    assert np.abs(arm.lower - ARM.lower).max() < ROUNDING
    assert np.abs(arm.upper - ARM.upper).max() < ROUNDING
    assert np.abs(arm.home - ARM.home).max() < ROUNDING


def test_roboticstoolbox_agrees_on_its_own_puma_of_another_convention() -> None:
    # Its zeros differ (standard table, joint 1 half a turn on, tool rolled) and its base is on the
    # floor; lengths are of the same reference.
    peer = rtb.models.DH.Puma560()
    for q in random_joints():
        ours = ARM.fk(q)
        theirs = peer.fkine([q[0] + math.pi, q[1] + math.pi, q[2], q[3], q[4], q[5]]).A
        theirs[2, 3] -= 26.45 * 0.0254
        assert np.abs(ours[:3, 3] - theirs[:3, 3]).max() < 1e-12


def test_lengths_and_joint_ranges_are_those_that_roboticstoolbox_quotes() -> None:
    peer = rtb.models.DH.Puma560()
    assert (peer.links[1].a, peer.links[2].a, peer.links[2].d, peer.links[3].d) == (A2, A3, D3, D4)
    shift = np.array([0.0, math.pi, 0.0, 0.0, 0.0, 0.0])
    assert np.abs(ARM.lower - (peer.qlim[0] - shift)).max() < ROUNDING
    assert np.abs(ARM.upper - (peer.qlim[1] - shift)).max() < ROUNDING


def test_the_eight_branches_are_different_and_in_the_documented_order() -> None:
    q = np.array([0.4, -0.6, -0.9, 0.5, 0.7, 0.3])
    solutions = ARM.ik_all(ARM.fk(q))
    assert len({tuple(np.round(row, 6)) for row in solutions}) == 8
    u = [
        A2 * math.cos(b) + A3 * math.cos(b + c) - D4 * math.sin(b + c) for _, b, c, *_ in solutions
    ]
    assert (np.array(u[:4]) > 0.0).all()
    assert (np.array(u[4:]) < 0.0).all()
    assert (np.sin(solutions[::2, 4]) >= 0.0).all()
    assert (np.sin(solutions[1::2, 4]) <= 0.0).all()


def test_a_straight_wrist_has_valid_branches_and_keeps_the_seed_of_joint_4() -> None:
    rng = np.random.default_rng(3)
    for q in random_joints(300):
        q[4] = 0.0
        # Room for the seed, and for joint 6 to take over what joint 4 keeps.
        q[:] = 0.8 * q
        # Far from the other singularities, whose rounding would bend the wrist by 1e-8.
        q[1:3] = ARM.home[1:3]
        pose = ARM.fk(q)
        assert np.abs(ARM.fk(ARM.ik_all(pose)) - pose).max() < 1e-9
        seed = q + rng.uniform(-0.1, 0.1, 6)
        result = ARM.ik(pose, seed)
        assert result.status is IkStatus.NEAR_SINGULAR
        assert result.q[3] == pytest.approx(seed[3], abs=1e-12)
        assert result.residual.max() < 1e-9


def test_the_cylinder_around_axis_1_and_a_folded_arm_cannot_be_reached() -> None:
    inside = transform(np.eye(3), np.array([0.1, 0.0, 0.3]))
    assert len(ARM.ik_all(inside)) == 0
    assert ARM.ik(inside).status is IkStatus.UNREACHABLE
    at_shoulder = transform(np.eye(3), np.array([0.0, D3, 0.0]))
    assert len(ARM.ik_all(at_shoulder)) == 0
    assert ARM.ik(at_shoulder).status is IkStatus.UNREACHABLE


def test_a_pose_that_only_limits_forbid_is_limited_and_its_residual_says_by_how_much() -> None:
    q = ARM.home.copy()
    q[0] = 175.0 * DEGREE
    result = ARM.ik(ARM.fk(q), np.array([2.7, -0.8, -0.8, 0.0, 0.8, 0.0]))
    if result.status is IkStatus.LIMITED:
        assert result.residual.max() > 1e-3
    else:
        assert result.residual.max() < 1e-9
    assert (result.q <= ARM.upper).all()


def turned_tool(pose: Array, angles: Array, tilt: float) -> Array:
    """Poses with the tool swung about its y axis by angles [rad] and tilted about x."""
    swung = [pose[:3, :3] @ rotation("y", a) @ rotation("x", tilt) for a in angles]
    return np.array([transform(turn, pose[:3, 3]) for turn in swung])


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, -0.1])
def test_the_wrist_passes_through_and_beside_its_singularity_without_a_halt(tilt: float) -> None:
    straight = ARM.home.copy()
    straight[4] = 0.0
    path = turned_tool(ARM.fk(straight), np.linspace(0.4, -0.4, 2000), tilt)
    seed = ARM.ik(path[0], ARM.home).q
    result = followed(ARM, path, seed)
    assert result.residual[-1].max() < 1e-9
    assert not (result.status == IkStatus.UNREACHABLE).any()
    assert result.residual[:, 1].max() < 0.05
    late = result.residual[:, 1] > 1e-9
    assert late.sum() < 400
    # Lagging costs little position: the wrist axes pass through the tip.
    assert result.residual[:, 0].max() < 0.01


def test_a_slow_path_through_the_straight_wrist_has_no_error_at_all() -> None:
    straight = ARM.home.copy()
    straight[4] = 0.0
    path = turned_tool(ARM.fk(straight), np.linspace(0.2, -0.2, 2001), 0.0)
    seed = ARM.ik(path[0], ARM.home).q
    result = ARM.follow(path, seed, DT)
    assert result.residual.max() < 1e-9
    assert np.abs(np.diff(result.q, axis=0)).max() < 1e-3


def line(
    pose: Array, start: Sequence[float] | Array, end: Sequence[float] | Array, count: int
) -> Array:
    out = np.repeat(pose[None], count, axis=0)
    out[:, :3, 3] = np.linspace(start, end, count)
    return out


@pytest.mark.parametrize("beyond", [1.001, 1.05, 1.4])
def test_reaching_out_beyond_the_stretched_arm_and_back_keeps_the_elbow(beyond: float) -> None:
    q = np.array([0.1, -0.5, -1.3, 0.2, 0.7, 0.1])
    pose = ARM.fk(q)
    reach = math.hypot(A2 + math.hypot(A3, D4), D3)
    far = pose[:3, 3] * beyond * reach / np.linalg.norm(pose[:3, 3])
    out = line(pose, pose[:3, 3], far, 3000)
    path = np.concatenate((out, out[::-1], out[:1].repeat(500, axis=0)))
    result = followed(ARM, path, q)
    assert (result.status == IkStatus.UNREACHABLE).any()
    assert result.residual[-1].max() < 1e-9


@pytest.mark.parametrize("offset", [0.0, 0.05, D3 - 1e-3, D3, D3 + 1e-6, D3 + 1e-3, 0.2, 0.3])
def test_a_path_over_axis_1_keeps_its_speeds_and_goes_on_behind(offset: float) -> None:
    pose = transform(rotation("y", math.pi), np.zeros(3))
    path = line(pose, (0.4, offset, 0.5), (-0.4, offset, 0.5), 3000)
    path = np.concatenate((path, path[-1:].repeat(3000, axis=0)))
    seed = ARM.ik(path[0]).q
    result = followed(ARM, path, seed)
    if offset > D3:
        # No branch flips, and no limit is in the way on this side.
        assert result.residual[-1, 0] < 1e-9
