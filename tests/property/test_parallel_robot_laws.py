"""Laws that every parallel and hybrid robot keeps, whatever it is asked."""

import numpy as np
import pytest

from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import IkStatus, load_robot_set

ROBOTS = [
    ("four_bar", ""),
    ("four_bar", "l0=4, l1=3, l2=3, l3=2, mode=-1"),
    ("parallelogram", ""),
    ("stewart", ""),
    ("rps3", ""),
    ("scara_stewart", ""),
    ("scara_stewart", "heading=carried"),
    ("scara_stewart", "sigma_b=0.26, sigma_m=0.26"),
    ("three_finger_hand", ""),
]
# Clipping to seed ± step rounds once.
ROUNDING = 1e-12


def settings(geometry: str) -> list[str]:
    return [text for text in geometry.split(", ") if text]


def any_pose(rng: np.random.Generator) -> Array:
    R = np.eye(3)
    for axis in "xyz":
        R = R @ rotation(axis, rng.uniform(-3.2, 3.2))
    return transform(R, rng.uniform(-1.5, 1.5, 3))


@pytest.mark.parametrize(("name", "geometry"), ROBOTS)
@pytest.mark.parametrize("step", [np.inf, 1e-3])
def test_any_pose_gives_finite_joints_inside_the_limits_and_the_step(name: str, geometry: str, step: float) -> None:
    robot, rng = load_robot_set(name, settings(geometry)), np.random.default_rng(1)
    limits = robot.limits()
    limits[2] = step
    for _ in range(300):
        seed = rng.uniform(robot.lower, robot.upper)
        q, residual = np.empty(robot.n), np.empty(2)
        status = robot.kernels.ik(any_pose(rng), seed, limits, robot.geometry_row, q, residual)
        assert status in set(IkStatus)
        assert np.isfinite(q).all()
        assert np.isfinite(residual).all()
        assert (q >= robot.lower).all()
        assert (q <= robot.upper).all()
        assert np.abs(q - seed).max() <= step + ROUNDING


@pytest.mark.parametrize(("name", "geometry"), ROBOTS)
def test_residual_is_what_forward_kinematics_leaves(name: str, geometry: str) -> None:
    robot, rng = load_robot_set(name, settings(geometry)), np.random.default_rng(2)
    for _ in range(100):
        T = any_pose(rng)
        result = robot.ik(T, seed=rng.uniform(robot.lower, robot.upper))
        reached = robot.solve_fk(result.q, search=False).T
        gap = np.linalg.norm(reached[:3, 3] - T[:3, 3])
        # Legs that hide the turn of a level platform put the tip of the tool elsewhere.
        assert abs(gap - result.residual[0]) < 1e-6
