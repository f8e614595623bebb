"""3-RPS: leg chains, inverse, and direct kinematics with all assembly modes."""

import math

import numpy as np
import pytest

from teleop_core.base.errors import ClosureError
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import FkStatus, IkStatus, load_robot
from teleop_machines.rps3 import Assembly, assembly_modes, joint_points, leg_coordinates
from ways import stepped

B, A = 1.0, 0.5
# Six printed decimals.
PRINTED = 6e-7
# Loop equations are solved to rounding; poses lose the condition of the assembly.
SOLVED = 1e-9


def tilted(rng: np.random.Generator, most: float = 0.6) -> Array:
    """Height and tilt without torsion: what the robot controls."""
    angle, heading = rng.uniform(0.0, most), rng.uniform(-math.pi, math.pi)
    R = rotation("z", heading) @ rotation("y", angle) @ rotation("z", -heading)
    return transform(R, np.array([0.0, 0.0, rng.uniform(0.9, 1.3)]))


def test_ball_joints_are_those_of_the_specification_and_give_the_legs_back() -> None:
    lengths, angles = [1.2, 1.0, 0.9], np.radians([60.0, 70.0, 80.0])
    S = joint_points(lengths, angles, b=B)
    printed = [[0.4, 0.0, 1.039230], [-0.328990, 0.569827, 0.939693], [-0.421858, -0.730680, 0.886327]]
    assert np.allclose(S, printed, atol=PRINTED)
    back = leg_coordinates(S, b=B)
    assert np.allclose(back[0], lengths, atol=1e-14)
    assert np.allclose(back[1], angles, atol=1e-14)


def test_equal_legs_lift_the_platform_level_as_the_specification_says() -> None:
    modes = assembly_modes([1.2, 1.2, 1.2], b=B, a=A)
    level = np.abs(np.degrees(modes.angles) - 65.375682).max(axis=1)
    k = int(level.argmin())
    assert level[k] < PRINTED
    assert np.allclose(modes.transforms[k][:3, 3], [0.0, 0.0, 1.090871], atol=PRINTED)
    assert np.allclose(modes.transforms[k][:3, :3], np.eye(3), atol=SOLVED)
    assert np.allclose(load_robot("rps3").fk([1.2] * 3), modes.transforms[k], atol=SOLVED)


def test_legs_that_cannot_meet_are_a_status_with_a_finite_pose_and_no_pose_of_fk() -> None:
    modes = assembly_modes([0.1, 0.1, 5.0], b=B, a=A)
    assert modes.status == Assembly.CANNOT_ASSEMBLE
    assert modes.angles.shape == (0, 3)
    answer = load_robot("rps3").solve_fk([0.1, 0.1, 5.0])
    assert answer.status == FkStatus.NOT_CLOSED
    assert np.isfinite(answer.T).all()
    with pytest.raises(ClosureError):
        load_robot("rps3").fk([0.1, 0.1, 5.0])


def test_the_robot_reaches_height_and_tilt_and_leaves_the_rest_as_residual() -> None:
    robot, rng = load_robot("rps3"), np.random.default_rng(5)
    assert robot.task_mask == (False, False, True, True, True, False)
    for _ in range(200):
        T = tilted(rng)
        wanted = T @ transform(rotation("z", rng.uniform(-1.0, 1.0)), np.zeros(3))
        wanted[:2, 3] = rng.uniform(-0.1, 0.1, 2)
        result = robot.ik(wanted)
        reached = robot.fk(result.q)
        assert result.status == IkStatus.FOLLOWED
        assert np.allclose(reached[2, [2, 3]], wanted[2, [2, 3]], atol=SOLVED)
        assert np.allclose(reached[:3, :3], T[:3, :3], atol=1e-8)
        # The parasitic shift of the centre, from the zero-torsion rotation.
        shift = 0.5 * A * (T[0, 0] - T[1, 1]), -A * T[1, 0]
        assert np.allclose(reached[:2, 3], shift, atol=SOLVED)
        gap = np.linalg.norm(reached[:3, 3] - wanted[:3, 3])
        assert math.isclose(result.residual[0], gap, abs_tol=1e-12)


def test_along_a_path_that_tilts_over_and_back_the_legs_keep_their_step() -> None:
    robot, up = load_robot("rps3"), np.array([0.0, 0.0, 1.09])
    angles = 1.9 * np.sin(np.linspace(0.0, 2.0 * math.pi, 1000))
    path = [transform(rotation("x", angle), up) for angle in angles]
    found, statuses = stepped(robot, path, robot.home, 0.01)
    assert statuses[-1] == IkStatus.FOLLOWED
    assert np.allclose(found[-1], np.hypot(1.09, B - A), atol=1e-9)
