"""MMA as a robot: Jacobian, rank, reach, torques for the hand, refusals."""

import math

import numpy as np
import pytest

from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.robots.robot import Robot
from teleop_machines.mma import holding_torques
from teleop_machines.mma_balance import ShoulderSpring

MM = 1e-3


@pytest.fixture(scope="module")
def mma() -> Robot:
    return load_robot("mma")


def random_readings(count: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).uniform(-math.pi, math.pi, (count, 7))


def test_jacobian_at_home_is_the_published_one(mma: Robot) -> None:
    serial = [
        [71.27, 344.31, 156.85, 156.85, 51.16, 63.79, 0.0],
        [3.63, 0.0, 0.0, 0.0, -157.13, 0.0, -63.79],
        [0.0, -3.63, -3.63, 157.13, 0.0, 157.13, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        [0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    ]
    wanted = np.array(serial)
    wanted[:3] *= MM
    wanted[:, 2], wanted[:, 3] = wanted[:, 3].copy(), wanted[:, 2] - wanted[:, 3]
    assert np.abs(mma.jacobian(mma.home) - wanted).max() < 1e-9


def test_rank_falls_to_five_at_the_wrist_whatever_the_arm_does_but_not_at_the_stretched_elbow(mma: Robot) -> None:
    for q in random_readings(20):
        q[4], q[5] = 0.5 * math.pi, -0.5 * math.pi
        assert np.linalg.svd(mma.jacobian(q), compute_uv=False)[-1] < 1e-12
    q = np.array([0.3, -1.2, 0.5, 0.0, 0.6, 0.7, 0.1])
    assert np.linalg.svd(mma.jacobian(q), compute_uv=False)[-1] > 1e-3


def test_no_reading_takes_the_tool_out_of_the_published_reach(mma: Robot) -> None:
    assert np.allclose(mma.upper - mma.lower, 2.0 * math.pi, rtol=0, atol=1e-15)  # one turn about home
    poses = mma.fk(random_readings(20000))
    distance = np.linalg.norm(poses[:, :3, 3] - [0.0, 0.0, mma.geometry["d1"]], axis=1)
    assert distance.max() < 624.13 * MM


def test_tool_force_is_held_by_the_transposed_jacobian_and_the_shoulder_residual(mma: Robot) -> None:
    q, wrench = mma.home + 0.1, np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    idle = holding_torques(mma, q, np.zeros(6))
    assert np.count_nonzero(idle) == 1
    torques = holding_torques(mma, q, wrench) - idle
    speeds = np.random.default_rng(3).normal(size=7)
    # Virtual work: what the joints put in comes out at the tip.
    assert math.isclose(torques @ speeds, wrench @ (mma.jacobian(q) @ speeds), rel_tol=1e-12)


def test_shoulder_torque_lifts_against_gravity(mma: Robot) -> None:
    level = mma.home.copy()
    level[1] = 0.0
    # Residual of the published spring in the worst pose, 1.011 N·m, towards smaller θ2.
    assert math.isclose(holding_torques(mma, level, np.zeros(6))[1], -1.011, abs_tol=1e-3)


def test_the_spring_of_the_shoulder_never_pulls() -> None:
    openings = np.linspace(0.0, math.pi, 50)
    torques = ShoulderSpring().torque(openings)
    assert (torques >= 0.0).all()
    # Beyond 135° the anchors are further apart than the spring is long.
    assert (torques[openings > math.radians(135.0) + 1e-3] == 0.0).all()
