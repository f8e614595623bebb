"""Ways: poses that an arm follows, and what holds on each of them."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from present import present
from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import IkResult
from teleop_core.robots.robot import Robot


def followed(arm: Robot, path: object, seed: Array, dt: float = 1e-3) -> IkResult[Any]:
    """Answers along a path; no joint is faster than its drive or leaves its limits."""
    result = arm.follow(path, seed, dt)
    steps = np.abs(np.diff(np.vstack((seed, result.q)), axis=0))
    assert (steps <= present(arm.drives).speed_limit * dt * (1.0 + 1e-9)).all()
    assert (result.q >= arm.lower).all()
    assert (result.q <= arm.upper).all()
    assert np.isfinite(result.residual).all()
    return result


def stepped(arm: Robot, path: Any, seed: Array, step: float) -> tuple[Array, list[int]]:
    """Joints (N, n) and statuses along a path, in which no joint goes farther than a step."""
    limits, q, found, statuses = arm.limits(), seed, [], []
    limits[2] = step
    for T in path:
        joints, residual = np.empty(arm.n), np.empty(2)
        statuses.append(arm.kernels.ik(T, q, limits, arm.geometry_row, joints, residual))
        assert np.isfinite(residual).all()
        assert np.abs(joints - q).max() <= step + 1e-15
        assert (joints >= arm.lower).all()
        assert (joints <= arm.upper).all()
        found.append(joints)
        q = joints
    return np.array(found), statuses


def turned(alpha: float, beta: float, gamma: float) -> Array:
    """Turns about moving axes x, y, z [degrees]: the product of the hybrid's source."""
    return Rotation.from_euler("XYZ", (alpha, beta, gamma), degrees=True).as_matrix()
