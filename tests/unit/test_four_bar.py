"""Planar loops: four-bar in both modes and the parallelogram."""

import math

import numpy as np
import pytest

from teleop_core.kernels.geometry import transform
from teleop_core.robots import IkStatus, load_robot
from teleop_machines.four_bar import Assembly, FourBar
from ways import stepped

# The spec prints six decimals of a degree.
PRINTED = 1e-6
LOOP = FourBar(4.0, 1.0, 3.5, 2.5)


def test_published_fixture_closes_with_the_angles_of_the_specification() -> None:
    closure = LOOP.close(0.0)
    assert np.allclose(np.degrees(closure.phi1), [101.536959, -101.536959], atol=PRINTED)
    assert np.allclose(np.degrees(closure.phi2), [44.415309, -44.415309], atol=PRINTED)
    assert np.allclose(np.degrees(closure.phi3), [-122.878350, 122.878350], atol=PRINTED)


def test_crank_rocker_assembles_all_around_and_too_long_a_ground_never_with_finite_angles() -> None:
    assert (LOOP.close(np.linspace(-7.0, 7.0, 500)).status == Assembly.CLOSED).all()
    assert LOOP.crank_ranges() == ((-math.pi, math.pi),)
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
    for name in ("four_bar", "parallelogram"):
        assert load_robot(name).task_mask == (True, True, False, False, False, False)
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
