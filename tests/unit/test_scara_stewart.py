"""SCARA + Stewart hybrid: the published example, both elbows and headings, paths, way back."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from present import present
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import IkStatus, load_robot
from ways import followed, turned

# The source prints centimetres with four decimals; its inputs are rounded likewise, and near the
# stretched arm that becomes 2e-4 degrees.
PRINTED_M, PRINTED_DEG = 1e-6, 2e-4
# Leg errors of rounding, over the square of the tilt by which similar hexagons see a turn.
SOLVED = 1e-9
PAIRS = {"sigma_b": math.radians(15.0), "sigma_m": math.radians(15.0)}
ROBOTS: Sequence[dict[str, Any]] = [{}, {"heading": "carried"}, PAIRS, {**PAIRS, "heading": "carried"}]


def poses(rng: np.random.Generator, count: int, tilt: float = 40.0) -> Iterator[Array]:
    """Poses with the SCARA inside its ring, platform turned up to ``tilt`` about each axis."""
    for _ in range(count):
        R = turned(*rng.uniform(-tilt, tilt, 3))
        radius, angle = rng.uniform(0.1, 0.95), rng.uniform(-1.5, 1.5)
        s = np.array([radius * math.cos(angle), radius * math.sin(angle), rng.uniform(0.05, 0.45)])
        yield transform(R, s + [0.0, 0.0, 0.2] + 0.1 * R[:, 2])


EXAMPLE = transform(turned(30.0, 0.0, 0.0), np.array([0.933013, 0.20, 0.436603]))
EXAMPLE_LEGS = [0.223607, 0.267095, 0.267095, 0.223607, 0.191569, 0.191569]


def test_published_example_has_the_published_legs_joints_and_tip() -> None:
    q = load_robot("scara_stewart").ik_all(EXAMPLE)[0]
    assert np.allclose(q[3:], EXAMPLE_LEGS, atol=PRINTED_M)
    assert np.allclose(np.degrees(q[:2]), [0.0, 30.0], atol=PRINTED_DEG)
    assert math.isclose(q[2], 0.15, abs_tol=PRINTED_M)

    T = load_robot("scara_stewart").fk([0.0, math.radians(30.0), 0.15, *q[3:]])
    assert np.allclose(T[:3, 3], [0.933013, 0.20, 0.436603], atol=PRINTED_M)
    assert np.allclose(T[:3, :3], turned(30.0, 0.0, 0.0), atol=SOLVED)


@pytest.mark.parametrize("options", ROBOTS)
def test_inverse_takes_the_elbow_next_to_the_seed(options: Mapping[str, str | float]) -> None:
    robot, rng = load_robot("scara_stewart", **options), np.random.default_rng(2)
    found = 0
    for T in poses(rng, 200, tilt=20.0):
        for q in robot.ik_all(T):
            if (q < robot.lower).any() or (q > robot.upper).any():
                continue
            result = robot.ik(T, seed=np.clip(q + 0.02, robot.lower, robot.upper))
            assert result.status in {IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR}
            assert np.allclose(result.q, q, atol=SOLVED)
            found += 1
    assert found > 250


def test_a_general_scara_with_unequal_links_and_a_raised_base() -> None:
    robot = load_robot("scara_stewart", l1=0.6, l2=0.35, h1=0.1)
    rng = np.random.default_rng(3)
    for theta2 in (0.5, 2.5, -0.5, -2.5):  # where l1 + l2 cos(theta2) is of both signs, l1 < l2 too
        legs = robot.ik_all(next(poses(rng, 1)) @ np.eye(4))
        q = np.array([0.4, theta2, 0.2, *(legs[0, 3:] if len(legs) else robot.home[3:])])
        T = robot.fk(q)
        assert np.abs(robot.ik_all(T) - q).max(axis=1).min() < 1e-7
    swapped = load_robot("scara_stewart", l1=0.35, l2=0.6)
    q = np.array([0.4, 2.5, 0.2, *robot.home[3:]])
    assert np.abs(swapped.ik_all(swapped.fk(q)) - q).max(axis=1).min() < SOLVED


def test_out_of_the_ring_is_unreachable_and_finite() -> None:
    robot = load_robot("scara_stewart")
    R = turned(20.0, 0.0, 0.0)
    T = transform(R, np.array([1.3, 0.0, 0.4]) + 0.1 * R[:, 2])
    result = robot.ik(T)
    assert result.status == IkStatus.UNREACHABLE
    assert np.isfinite(result.q).all()
    assert math.isclose(result.residual[0], 0.3, abs_tol=1e-6)
    assert result.residual[1] < SOLVED  # the legs still turn the tool as wanted
    assert robot.ik_all(T).shape == (0, 9)
    uneven = load_robot("scara_stewart", l1=0.6, l2=0.3)
    inside = transform(R, np.array([0.1, 0.0, 0.4]) + 0.1 * R[:, 2])
    assert uneven.ik(inside).status == IkStatus.UNREACHABLE


def test_a_platform_tilted_too_far_is_limited_to_the_nearest_tilt() -> None:
    robot = load_robot("scara_stewart")
    for alpha, missing in ((100.0, 25.0), (170.0, 95.0)):
        R = turned(alpha, 0.0, 0.0)
        T = transform(R, np.array([0.6, 0.0, 0.45]) + 0.1 * R[:, 2])
        result = robot.ik(T)
        assert result.status == IkStatus.LIMITED
        angle = Rotation.from_matrix(robot.fk(result.q)[:3, :3].T @ R).magnitude()
        assert math.isclose(math.degrees(angle), missing, abs_tol=1e-6)


def test_similar_hexagons_hide_the_turn_of_a_level_platform_and_say_so() -> None:
    robot = load_robot("scara_stewart")
    left, right = (transform(rotation("z", angle), np.array([0.6, 0.0, 0.5])) for angle in (0.3, -0.3))
    results = robot.ik(left), robot.ik(right)
    assert np.allclose(results[0].q, results[1].q, atol=1e-15)
    assert results[0].status == results[1].status == IkStatus.NEAR_SINGULAR
    # Legs in pairs tell the two apart.
    paired = load_robot("scara_stewart", **PAIRS)
    for T in (left, right):
        result = paired.ik(T)
        assert result.status == IkStatus.FOLLOWED
        assert np.allclose(paired.fk(result.q), T, atol=SOLVED)


def test_the_turn_of_the_published_layout_is_known_as_the_square_of_the_tilt() -> None:
    robot = load_robot("scara_stewart")
    error = 1e-7  # of one leg [m]
    for alpha in (1.0, 5.0, 30.0):
        R = turned(alpha, 0.0, 0.0)
        q = robot.ik_all(transform(R, np.array([0.6, 0.0, 0.45])))[0]
        q[4] += error
        T = robot.fk(q)
        lost = Rotation.from_matrix(T[:3, :3].T @ R).magnitude()
        assert lost < 100.0 * error / math.radians(alpha) ** 2
        assert np.isfinite(robot.jacobian(q)).all()


def test_in_pairs_the_platform_shifts_with_a_leg_and_in_line_its_centre_is_held() -> None:
    q = load_robot("scara_stewart").home.copy()
    q[3:] += 1e-3
    held = load_robot("scara_stewart").solve_fk(q).T
    s = held[:3, 3] - 0.1 * held[:3, 2]
    assert math.isclose(s[2], 0.25 + 0.2, abs_tol=1e-12)
    paired = load_robot("scara_stewart", **PAIRS)
    q = paired.home.copy()
    q[3:] += 1e-3
    T = paired.fk(q)
    assert T[2, 3] - 0.1 * T[2, 2] > 0.45 + 5e-4


@pytest.mark.parametrize("heading", ["fixed", "carried"])
@pytest.mark.parametrize("beside", [0.0, 1e-6, -1e-6, 0.02, -0.02])
def test_a_path_over_the_axis_of_joint_one_goes_on_at_the_other_side(heading: str, beside: float) -> None:
    robot = load_robot("scara_stewart", heading=heading)
    R = turned(30.0, 0.0, 0.0)
    x = np.concatenate((np.linspace(0.4, -0.4, 4000), np.full(4000, -0.4)))
    path = np.array([transform(R, np.array([value, beside, 0.4]) + 0.1 * R[:, 2]) for value in x])
    start = robot.ik(path[0], seed=robot.home).q
    result = followed(robot, path, start)
    # Passing slowly on one side turns joint 1 into its end stop; there it waits.
    is_stopped = math.isclose(abs(result.q[-1, 0]), robot.upper[0])
    assert is_stopped == (beside == -0.02)
    assert is_stopped or result.residual[-1, 0] < SOLVED


@pytest.mark.parametrize("heading", ["fixed", "carried"])
@pytest.mark.parametrize("reach", [0.9999, 1.0, 1.05])
def test_a_path_to_the_stretched_arm_and_back_keeps_its_elbow(heading: str, reach: float) -> None:
    robot = load_robot("scara_stewart", heading=heading)
    R = turned(0.0, 25.0, 0.0)
    x = 0.8 + (reach - 0.8) * np.sin(np.linspace(0.0, math.pi, 6000))
    way = np.array([math.cos(0.1), math.sin(0.1), 0.0])
    up = np.array([0.0, 0.0, 0.4])
    path = np.array([transform(R, value * way + up + 0.1 * R[:, 2]) for value in x])
    for elbow in range(2):
        start = robot.ik_all(path[0])[elbow]
        result = followed(robot, path, start)
        assert result.residual[-1].max() < SOLVED
        assert np.allclose(result.q[-1], start, atol=1e-6)
    assert (result.status == IkStatus.UNREACHABLE).any() == (reach > 1.0)


@pytest.mark.parametrize("options", ROBOTS)
def test_a_path_through_the_level_platform_goes_on(options: Mapping[str, str | float]) -> None:
    robot = load_robot("scara_stewart", **options)
    angles = np.linspace(30.0, -30.0, 3000)
    path = np.array(
        [
            transform(R, np.array([0.7, 0.0, 0.4]) + 0.1 * R[:, 2])
            for R in (turned(angle, 0.1 * angle, 5.0) for angle in angles)
        ]
    )
    start = robot.ik(path[0], seed=robot.home).q
    result = followed(robot, path, start)
    assert result.residual.max() < SOLVED
    # The joints draw one smooth curve: neighbouring steps differ by little.
    assert np.abs(np.diff(result.q, n=2, axis=0)).max() < 1e-5


def test_legs_that_are_held_back_slow_down_together() -> None:
    robot = load_robot("scara_stewart")
    start = robot.home
    T = robot.fk(start)
    T[:3, :3] = T[:3, :3] @ turned(-20.0, 10.0, 0.0)
    result = robot.follow(T[None], seed=start, dt=1e-3)
    wanted = robot.ik(T, seed=start).q - start
    moved = result.q[0] - start
    assert result.status[0] == IkStatus.LIMITED
    assert math.isclose(np.abs(moved[3:]).max(), present(robot.drives).speed_limit[3] * 1e-3)
    assert np.allclose(moved[3:] / wanted[3:], moved[3] / wanted[3])
