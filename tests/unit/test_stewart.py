"""Stewart platform: legs, direct kinematics, Jacobian and rank of any layout."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from teleop_core.base.errors import ClosureError, ParameterError, ShapeError, UnknownNameError
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import FkStatus, IkStatus, list_robots, load_robot
from teleop_machines.stewart import PAIRED, DirectStatus, Layout
from ways import stepped

SIXTHS = np.radians([0.0, 60.0, 120.0, 180.0, 240.0, 300.0])
# Lengths of the hybrid's source in centimetres, as the specification prints them.
HEXAGONS = Layout.circular(20.0, SIXTHS, 10.0, SIXTHS)
PAIRED_CM = Layout(100.0 * PAIRED.base, 100.0 * PAIRED.platform)
# Direct kinematics ends at rounding of the lengths; the pose loses a factor of the condition.
SOLVED = 1e-9


def turn(alpha: float, beta: float, gamma: float) -> Array:
    """Moving axes x, y, z, degrees: the product of the hybrid's source."""
    a, b, c = np.radians([alpha, beta, gamma])
    return rotation("x", a) @ rotation("y", b) @ rotation("z", c)


EXAMPLE = transform(turn(30.0, 0.0, 0.0), np.array([0.0, 0.0, 20.0]))


def poses(
    rng: np.random.Generator, count: int, height: float = 0.2, tilt: float = 25.0
) -> Iterator[Array]:
    for _ in range(count):
        shift = rng.uniform(-0.15, 0.15, 3) * height
        yield transform(turn(*rng.uniform(-tilt, tilt, 3)), shift + np.array([0.0, 0.0, height]))


def test_legs_are_the_distances_of_the_joints() -> None:
    rng = np.random.default_rng(1)
    layout = Layout(rng.normal(size=(6, 3)), rng.normal(size=(6, 3)))
    for T in poses(rng, 20, height=2.0):
        ends = layout.platform @ T[:3, :3].T + T[:3, 3]
        assert np.allclose(layout.legs(T), np.linalg.norm(ends - layout.base, axis=1), atol=1e-14)


def test_published_hexagons_give_the_published_legs() -> None:
    # Printed to four decimals.
    printed = [22.3607, 26.7095, 26.7095, 22.3607, 19.1569, 19.1569]
    assert np.allclose(HEXAGONS.legs(EXAMPLE), printed, atol=5e-5)


def test_published_hexagons_have_rank_five_in_every_pose() -> None:
    assert HEXAGONS.is_architecturally_singular
    rng = np.random.default_rng(3)
    assert all(HEXAGONS.rank(T) == 5 for T in poses(rng, 300, height=20.0, tilt=60.0))
    values = np.linalg.svd(HEXAGONS.leg_jacobian(EXAMPLE), compute_uv=False)
    assert np.allclose(values, [15.35, 13.18, 2.06, 1.07, 0.268, 0.0], atol=5e-3)


def test_joints_in_pairs_have_full_rank_with_the_value_of_the_specification() -> None:
    assert not PAIRED.is_architecturally_singular
    assert PAIRED_CM.rank(EXAMPLE) == 6
    values = np.linalg.svd(PAIRED_CM.leg_jacobian(EXAMPLE), compute_uv=False)
    assert math.isclose(values[-1], 0.505, abs_tol=5e-4)


def test_published_hexagons_move_with_all_legs_locked() -> None:
    # The specification prints the far end of the motion to three and two decimals.
    far = transform(turn(26.29, 14.99, 58.80), np.array([0.788, -2.899, 13.824]))
    assert np.allclose(HEXAGONS.legs(far), HEXAGONS.legs(EXAMPLE), atol=5e-3)


def test_direct_kinematics_is_refused_on_the_published_hexagons() -> None:
    result = HEXAGONS.direct(HEXAGONS.legs(EXAMPLE), EXAMPLE)
    assert result.status == DirectStatus.ARCHITECTURALLY_SINGULAR
    assert np.array_equal(result.T, EXAMPLE)
    scaled = Layout(1.7 * HEXAGONS.platform, HEXAGONS.platform)
    assert scaled.direct(np.full(6, 20.0), EXAMPLE).status == DirectStatus.ARCHITECTURALLY_SINGULAR


def test_direct_kinematics_returns_the_pose_of_the_legs_from_a_near_seed() -> None:
    rng = np.random.default_rng(4)
    for T in poses(rng, 100, tilt=40.0):
        seed = transform(
            rotation("x", 0.1) @ rotation("z", -0.1) @ T[:3, :3], T[:3, 3] + [0.01, -0.01, 0.02]
        )
        result = PAIRED.direct(PAIRED.legs(T), seed)
        assert result.status == DirectStatus.SOLVED
        assert np.allclose(result.T, T, atol=SOLVED)


def test_direct_kinematics_finds_other_assemblies_from_other_seeds() -> None:
    T = transform(np.eye(3), np.array([0.0, 0.0, 0.2]))
    below = transform(np.eye(3), np.array([0.0, 0.0, -0.2]))
    result = PAIRED.direct(PAIRED.legs(T), below)
    assert result.status == DirectStatus.SOLVED
    assert np.allclose(result.T, below, atol=SOLVED)


def test_legs_that_do_not_meet_are_reported_with_a_finite_pose() -> None:
    seed = transform(np.eye(3), np.array([0.0, 0.0, 0.2]))
    result = PAIRED.direct([0.05, 1.0, 0.05, 1.0, 0.05, 1.0], seed)
    assert result.status == DirectStatus.CANNOT_ASSEMBLE
    assert np.isfinite(result.T).all()
    assert result.residual > 0.01


def test_a_pose_on_a_singularity_is_named() -> None:
    # Turned by a quarter about z, a symmetric platform is at Hunt's singularity.
    T = transform(rotation("z", math.pi / 2.0), np.array([0.0, 0.0, 0.2]))
    assert PAIRED.rank(T) < 6
    assert PAIRED.direct(PAIRED.legs(T), T).status == DirectStatus.NEAR_SINGULAR
    assert load_robot("stewart").ik(T).status in {IkStatus.NEAR_SINGULAR, IkStatus.UNREACHABLE}


def test_robot_legs_and_poses_are_inverse_to_each_other() -> None:
    robot, rng = load_robot("stewart"), np.random.default_rng(5)
    wanted = np.array(list(poses(rng, 200)))
    result: Any = robot.ik(wanted)
    assert (result.status == IkStatus.FOLLOWED).all()
    assert np.allclose(robot.fk(result.q), wanted, atol=SOLVED)
    assert np.allclose(robot.ik_all(wanted[0]), result.q[:1], atol=1e-15)


def test_strokes_stop_the_legs_and_the_rest_is_residual() -> None:
    robot = load_robot("stewart")
    T = transform(np.eye(3), np.array([0.0, 0.0, 0.5]))
    result = robot.ik(T)
    assert result.status == IkStatus.LIMITED
    assert (result.q <= robot.upper).all()
    assert result.residual[0] > 0.05


def test_along_a_path_through_the_singularity_the_legs_keep_their_step_and_go_on() -> None:
    robot, up = load_robot("stewart"), np.array([0.0, 0.0, 0.2])
    angles = np.linspace(0.0, math.radians(110.0), 400)
    path = [transform(rotation("z", angle), up) for angle in angles]
    found, _ = stepped(robot, path, robot.home, 5e-4)
    assert np.allclose(found[-1], robot.ik_all(path[-1])[0], atol=1e-12)


def test_any_layout_loads_as_a_robot_and_the_singular_one_refuses() -> None:
    rng = np.random.default_rng(7)
    crooked = Layout(PAIRED.base + rng.normal(0, 0.02, (6, 3)), PAIRED.platform)
    robot = load_robot("stewart", **crooked.symbols())
    T = next(poses(rng, 1))
    assert np.allclose(robot.fk(robot.ik(T).q), T, atol=SOLVED)
    hexagons = Layout(0.01 * HEXAGONS.base, 0.01 * HEXAGONS.platform)
    robot = load_robot("stewart", **hexagons.symbols())
    result = robot.ik(T)
    assert np.allclose(result.q, hexagons.legs(T))
    assert result.status == IkStatus.NEAR_SINGULAR
    assert robot.solve_fk(result.q).status == FkStatus.UNDETERMINED
    assert robot.fk_all(result.q).shape == (0, 4, 4)
    for question in (robot.fk, robot.jacobian):
        with pytest.raises(ClosureError, match="architecturally singular"):
            question(result.q)


def test_bad_layouts_and_questions_are_refused() -> None:
    assert "stewart" in list_robots()
    with pytest.raises(ShapeError):
        Layout(np.zeros((5, 3)), np.zeros((6, 3)))
    with pytest.raises(ParameterError):
        Layout(np.full((6, 3), math.nan), PAIRED.platform)
    with pytest.raises(ParameterError) as refusal:
        Layout(PAIRED.base, np.zeros((6, 3)))
    assert refusal.value.name == "platform"
    with pytest.raises(ParameterError):
        PAIRED.direct(np.full(6, -1.0), np.eye(4))
    with pytest.raises(ParameterError):
        PAIRED.legs(np.zeros((4, 4)))
    with pytest.raises(ShapeError):
        PAIRED.direct(np.zeros(5), np.eye(4))
    with pytest.raises(UnknownNameError):
        load_robot("stewart", size=1.0)
    touching = Layout(PAIRED.platform, PAIRED.platform)
    with pytest.raises(ParameterError):
        load_robot("stewart", **touching.symbols(), z0=0.0)
