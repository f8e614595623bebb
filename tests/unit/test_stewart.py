"""Stewart platform: legs, direct kinematics, Jacobian and rank of any layout."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from teleop_core.base.errors import ClosureError, ParameterError, ShapeError
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import FkStatus, IkStatus, load_robot
from teleop_machines.stewart import PAIRED, DirectStatus, Layout
from ways import stepped, turned

SIXTHS = np.radians([0.0, 60.0, 120.0, 180.0, 240.0, 300.0])
# Lengths of the hybrid's source in centimetres, as the specification prints them.
HEXAGONS = Layout.circular(20.0, SIXTHS, 10.0, SIXTHS)
# Direct kinematics ends at rounding of the lengths; the pose loses a factor of the condition.
SOLVED = 1e-9


EXAMPLE = transform(turned(30.0, 0.0, 0.0), np.array([0.0, 0.0, 20.0]))


def poses(rng: np.random.Generator, count: int, height: float = 0.2, tilt: float = 25.0) -> Iterator[Array]:
    for _ in range(count):
        shift = rng.uniform(-0.15, 0.15, 3) * height
        yield transform(turned(*rng.uniform(-tilt, tilt, 3)), shift + np.array([0.0, 0.0, height]))


def test_direct_kinematics_is_refused_on_the_published_hexagons() -> None:
    result = HEXAGONS.direct(HEXAGONS.legs(EXAMPLE), EXAMPLE)
    assert result.status == DirectStatus.ARCHITECTURALLY_SINGULAR
    assert np.array_equal(result.T, EXAMPLE)
    scaled = Layout(1.7 * HEXAGONS.platform, HEXAGONS.platform)
    assert scaled.direct(np.full(6, 20.0), EXAMPLE).status == DirectStatus.ARCHITECTURALLY_SINGULAR


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
    with pytest.raises(ShapeError):
        Layout(np.zeros((5, 3)), np.zeros((6, 3)))
    with pytest.raises(ParameterError) as refusal:
        Layout(PAIRED.base, np.zeros((6, 3)))
    assert refusal.value.name == "platform"
    with pytest.raises(ParameterError):
        PAIRED.direct(np.full(6, -1.0), np.eye(4))
    touching = Layout(PAIRED.platform, PAIRED.platform)
    with pytest.raises(ParameterError):
        load_robot("stewart", **touching.symbols(), z0=0.0)
