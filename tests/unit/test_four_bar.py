"""Planar loops: four-bar in all closure forms, both modes, and the parallelogram."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest
import roboticstoolbox as rtb

from teleop_core.base.errors import ParameterError, UnknownNameError
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import IkStatus, list_robots, load_robot
from teleop_machines.four_bar import Assembly, FourBar
from teleop_machines.four_bar_loop import Closure
from ways import stepped

# Cosines and sines of a few terms of length below 10: rounding stays far under this.
CLOSED = 1e-12
# The spec prints six decimals of a degree.
PRINTED = 1e-6
LOOP = FourBar(4.0, 1.0, 3.5, 2.5)


# The four published forms of the closure, by where each breaks the loop: gaps [m] and [rad].


def gap_3r(loop: FourBar, theta1: float, phi1: Array, phi2: Array, phi3: Array) -> Array:
    """Form A, at the right pivot; the angles add up to a multiple of 2 pi (source: 4 pi)."""
    second, third = theta1 + phi2, theta1 + phi2 + phi3
    x = loop.l1 * np.cos(theta1) + loop.l2 * np.cos(second) + loop.l3 * np.cos(third) - loop.l0
    y = loop.l1 * np.sin(theta1) + loop.l2 * np.sin(second) + loop.l3 * np.sin(third)
    return np.stack((x, y, np.angle(-np.exp(1j * (third - phi1)))))


def gap_2r_1r(loop: FourBar, theta1: float, phi1: Array, phi2: Array) -> Array:
    """Form B, between coupler and rocker."""
    x = loop.l1 * np.cos(theta1) + loop.l2 * np.cos(theta1 + phi2)
    y = loop.l1 * np.sin(theta1) + loop.l2 * np.sin(theta1 + phi2)
    return np.stack((x - loop.l0 - loop.l3 * np.cos(phi1), y - loop.l3 * np.sin(phi1)))


def gap_2r_2r(
    loop: FourBar, theta1: float, phi1: Array, phi2: Array, right: Array, a: float
) -> Array:
    """Form C, in the coupler at ``a`` from the crank: theta1 + phi2 = phi1 + right + pi."""
    b, left = loop.l2 - a, theta1 + phi2
    x = loop.l1 * np.cos(theta1) + a * np.cos(left) - loop.l0 - loop.l3 * np.cos(phi1)
    y = loop.l1 * np.sin(theta1) + a * np.sin(left) - loop.l3 * np.sin(phi1)
    x, y = x - b * np.cos(phi1 + right), y - b * np.sin(phi1 + right)
    return np.stack((x, y, np.angle(-np.exp(1j * (left - phi1 - right)))))


def gap_freudenstein(loop: FourBar, theta1: Any, phi1: Array) -> Array:
    """Form D, coupler as a distance: squared distance of its ends less l2² [m²]."""
    x = loop.l1 * np.cos(theta1) - loop.l0 - loop.l3 * np.cos(phi1)
    y = loop.l1 * np.sin(theta1) - loop.l3 * np.sin(phi1)
    return x * x + y * y - loop.l2**2


def closed_loops(rng: np.random.Generator, count: int) -> Iterator[tuple[FourBar, float, Closure]]:
    """Random lengths and crank angles that close, with their closure."""
    for lengths in rng.uniform(0.3, 4.0, (count, 4)):
        loop = FourBar(*lengths)
        theta1 = rng.uniform(-math.pi, math.pi)
        closure = loop.close(theta1)
        if closure.status == Assembly.CLOSED:
            yield loop, theta1, closure


def test_published_fixture_closes_with_the_angles_of_the_specification() -> None:
    closure = LOOP.close(0.0)
    assert np.allclose(np.degrees(closure.phi1), [101.536959, -101.536959], atol=PRINTED)
    assert np.allclose(np.degrees(closure.phi2), [44.415309, -44.415309], atol=PRINTED)
    assert np.allclose(np.degrees(closure.phi3), [-122.878350, 122.878350], atol=PRINTED)


def test_all_four_forms_of_the_closure_agree_for_random_loops_in_both_modes() -> None:
    rng = np.random.default_rng(1)
    count, worst = 0, 0.0
    for loop, theta1, (_, phi1, phi2, phi3) in closed_loops(rng, 3000):
        a = rng.uniform(0.0, loop.l2)
        right = theta1 + phi2 - phi1 - math.pi
        gaps = (
            gap_3r(loop, theta1, phi1, phi2, phi3),
            gap_2r_1r(loop, theta1, phi1, phi2),
            gap_2r_2r(loop, theta1, phi1, phi2, right, a),
            gap_freudenstein(loop, theta1, phi1),
        )
        worst = max(worst, *(float(np.abs(gap).max()) for gap in gaps))
        count += 1
    assert count > 1000
    assert worst < CLOSED


def test_forms_as_printed_would_leave_gaps() -> None:
    theta1 = 0.7
    _, phi1, phi2, _ = LOOP.close(theta1)
    half_turn_short = theta1 + phi2 - phi1 - math.pi / 2.0  # the slide's pi/2
    assert np.abs(gap_2r_2r(LOOP, theta1, phi1, phi2, half_turn_short, 1.0)).max() > 1.0
    x = LOOP.l1 * math.cos(theta1) - LOOP.l3 * np.cos(phi1)
    y = LOOP.l1 * math.sin(theta1) - LOOP.l3 * np.sin(phi1)
    without_ground = x**2 + y**2 - LOOP.l2**2
    assert np.abs(without_ground).max() > 1.0


def test_angles_around_the_loop_add_up_to_a_multiple_of_one_turn() -> None:
    _, phi1, phi2, phi3 = LOOP.close(0.0)
    positive = np.mod(phi2, 2 * math.pi), np.mod(phi3, 2 * math.pi)
    total = np.degrees(positive[0] + positive[1] + math.pi - phi1)
    assert np.allclose(np.sort(total), [360.0, 720.0], atol=PRINTED)


def test_crank_rocker_assembles_all_around() -> None:
    assert (LOOP.close(np.linspace(-7.0, 7.0, 500)).status == Assembly.CLOSED).all()
    assert LOOP.crank_ranges() == ((-math.pi, math.pi),)


def test_too_long_ground_never_assembles_and_says_so_with_finite_angles() -> None:
    loop = FourBar(6.0, 1.0, 2.0, 2.0)
    closure = loop.close(np.linspace(-4.0, 4.0, 100))
    assert (closure.status == Assembly.CANNOT_ASSEMBLE).all()
    assert all(np.isfinite(angles).all() for angles in closure[1:])
    assert loop.crank_ranges() == ()


def test_double_rocker_assembles_only_up_to_a_right_angle() -> None:
    loop = FourBar(4.0, 3.0, 3.0, 2.0)
    angles = np.radians([-179.0, -90.01, -90.0, -45.0, 0.0, 89.99, 90.0, 90.01, 150.0])
    expected = np.abs(np.degrees(angles)) > 90.0 + 1e-9
    assert (loop.close(angles).status == expected).all()
    assert np.allclose(loop.crank_ranges(), [(-math.pi / 2, math.pi / 2)])


def test_a_rocker_that_cannot_pass_the_ground_line_has_two_mirrored_ranges() -> None:
    loop = FourBar(3.0, 2.0, 3.0, 1.5)
    (lower, upper), mirrored = loop.crank_ranges()
    assert mirrored == (-upper, -lower)
    assert loop.close(0.5 * (lower + upper)).status == Assembly.CLOSED
    assert loop.close(0.0).status == loop.close(math.pi).status == Assembly.CANNOT_ASSEMBLE


def test_both_chains_of_the_denavit_hartenberg_tables_meet() -> None:
    # Lecture 6: 2R chain from the left pivot, 1R chain from the right one, broken at joint 3.
    left = rtb.DHRobot([rtb.RevoluteMDH(), rtb.RevoluteMDH(a=LOOP.l1)])
    right = rtb.DHRobot([rtb.RevoluteMDH()])
    for theta1 in np.linspace(-3.0, 3.0, 7):
        _, phi1, phi2, _ = LOOP.close(theta1)
        for mode in range(2):
            ends = (
                left.fkine([theta1, phi2[mode]]).A @ [LOOP.l2, 0.0, 0.0, 1.0],
                right.fkine([phi1[mode]]).A @ [LOOP.l3, 0.0, 0.0, 1.0] + [LOOP.l0, 0.0, 0.0, 0.0],
            )
            assert np.allclose(*ends, atol=CLOSED)


def test_matrix_loop_closes_with_the_tool_block_as_the_pose_of_r_in_the_tool() -> None:
    def link(angle: float, length: float) -> Array:
        return transform(rotation("z", angle), np.zeros(3)) @ along(length)

    def along(length: float) -> Array:
        return transform(np.eye(3), np.array([length, 0.0, 0.0]))

    for theta1 in np.linspace(-3.0, 3.0, 7):
        _, phi1, phi2, phi3 = LOOP.close(theta1)
        for mode in range(2):
            chain = link(theta1, LOOP.l1) @ link(phi2[mode], LOOP.l2) @ link(phi3[mode], LOOP.l3)
            T_tool_r = transform(rotation("z", math.pi - phi1[mode]), np.zeros(3))
            assert np.allclose(chain @ T_tool_r, along(LOOP.l0), atol=CLOSED)
            inverted = chain @ np.linalg.inv(T_tool_r)  # as the slide labels it
            assert np.abs(inverted - along(LOOP.l0)).max() > 0.3


@pytest.mark.parametrize("geometry", [{}, {"mode": -1.0}, {"l0": 4, "l1": 3, "l2": 3, "l3": 2}])
def test_inverse_finds_the_crank_of_every_reachable_point(geometry: dict[str, float]) -> None:
    robot = load_robot("four_bar", **geometry)
    rng = np.random.default_rng(2)
    for theta1 in rng.uniform(max(robot.lower[0], -3.1), min(robot.upper[0], 3.1), 200):
        T = robot.fk([theta1])
        result = robot.ik(T, seed=[theta1 + rng.uniform(-0.05, 0.05)])
        assert result.status in {IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR}
        assert result.residual.max() < 1e-8 or result.residual[0] < 1e-9
        found = robot.ik_all(T)
        assert np.abs(np.angle(np.exp(1j * (found - theta1)))).min() < 1e-6
        assert all(np.allclose(robot.fk(q)[:2, 3], T[:2, 3], atol=1e-9) for q in found)


def test_a_point_off_the_curve_gets_the_nearest_one_and_is_unreachable() -> None:
    robot = load_robot("four_bar")
    curve = robot.fk(np.linspace(-math.pi, math.pi, 2000)[:, None])[:, :2, 3]
    rng = np.random.default_rng(3)
    for point in rng.uniform([-0.3, -0.3], [0.6, 0.6], (30, 2)):
        T = transform(np.eye(3), np.array([*point, 0.0]))
        result = robot.ik(T)
        assert result.status == IkStatus.UNREACHABLE
        # 2000 samples of a curve of under 1 m: the sampled distance is at most this much larger.
        assert result.residual[0] <= np.linalg.norm(curve - point, axis=1).min() + 1e-9
        assert robot.ik_all(T).shape == (0, 1)


def test_along_a_path_the_crank_turns_on_without_a_jump() -> None:
    robot = load_robot("four_bar")
    cranks = np.linspace(0.0, 2.0 * math.pi, 2000)
    found, _ = stepped(robot, robot.fk(cranks[:, None]), np.array([0.0]), 0.01)
    assert np.abs(found[:, 0] - cranks).max() < 1e-6


def test_parallelogram_passes_its_change_points_without_turning_the_coupler() -> None:
    robot = load_robot("parallelogram")
    loop = FourBar(*(robot.geometry[s] for s in ("l0", "l1", "l0", "l1")))
    cranks = np.linspace(-1.0, 7.0, 4001)
    result = robot.follow(robot.fk(cranks[:, None]), seed=cranks[:1])
    assert np.abs(result.q[:, 0] - cranks).max() < 1e-9
    assert (result.status == IkStatus.FOLLOWED).all()
    assert np.abs(gap_freudenstein(loop, cranks, cranks)).max() < CLOSED
    # The general closure has the parallelogram as one of its two modes, changing sides at 0, pi.
    modes = loop.close(cranks).phi1
    assert np.abs(np.exp(1j * modes) - np.exp(1j * cranks)[:, None]).min(axis=1).max() < 1e-6


def test_parallelogram_keeps_its_crank_at_the_centre_and_reports_points_off_the_circle() -> None:
    robot = load_robot("parallelogram")
    centre = transform(np.eye(3), np.array([robot.geometry["a"], 0.0, 0.0]))
    result = robot.ik(centre, seed=[0.3])
    assert result.q[0] == 0.3
    assert result.status == IkStatus.UNREACHABLE
    assert math.isclose(result.residual[0], robot.geometry["l1"])


def test_robots_are_listed_and_name_what_they_control() -> None:
    for name in ("four_bar", "parallelogram"):
        assert name in list_robots()
        assert load_robot(name).task_mask == (True, True, False, False, False, False)


@pytest.mark.parametrize(
    ("geometry", "name"),
    [
        ({"l0": 6.0, "l1": 1.0, "l2": 2.0, "l3": 2.0}, "l0, l1, l2, l3"),
        ({"l1": 0.0}, "l1"),
        ({"l2": math.nan}, "l2"),
        ({"l2": "long"}, "l2"),
        ({"mode": 0.5}, "mode"),
    ],
)
def test_impossible_loops_are_refused_with_their_values(
    geometry: Mapping[str, str | float], name: str
) -> None:
    with pytest.raises(ParameterError) as refusal:
        load_robot("four_bar", **geometry)
    assert refusal.value.name == name


def test_unknown_symbols_and_bad_parallelograms_are_refused() -> None:
    with pytest.raises(UnknownNameError):
        load_robot("four_bar", l4=1.0)
    with pytest.raises(ParameterError):
        load_robot("parallelogram", l1=-1.0)
    with pytest.raises(ParameterError):
        load_robot("four_bar").ik(np.full((4, 4), math.nan))
