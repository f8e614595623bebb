"""Dexterity: singular values and manipulability of a posture, and samples of the workspace."""

import math
from pathlib import Path

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import FkStatus
from teleop_core.robots.robot import Robot

COLUMNS = ("x_m", "y_m", "z_m", "manipulability")


def controlled_jacobian(robot: Robot, q: object, length: float = 1.0) -> Array:
    """Jacobian rows of the directions that the robot controls.

    Args:
        robot: The arm.
        q: Joint vector (n,) [rad, m].
        length: Distance [m] that counts as much as one radian; linear rows are divided by it.

    Returns:
        (k, n), where k is the number of directions in the task mask.

    Raises:
        ShapeError: The shape of ``q`` is not (n,).
        ParameterError: ``q`` contains NaN or infinity, or the length is not above 0.
        ClosureError: The loops do not close with these joints.
    """
    _check_length(length)
    return _controlled(robot, robot.jacobian(q), length)


def _check_length(length: float) -> None:
    if not (math.isfinite(length) and length > 0.0):
        raise ParameterError("length", length, "finite and above 0 m")


def _controlled(robot: Robot, jacobian: Array, length: float) -> Array:
    jacobian[:3] /= length
    return jacobian[np.array(robot.task_mask)]


def _kernel_jacobian(robot: Robot, q: Array) -> Array:
    """Jacobian (6, n) of a posture; the loops may be open."""
    jacobian = np.empty((6, robot.n))
    robot.kernels.jacobian(q, robot.geometry_row, jacobian)
    return jacobian


def singular_values(robot: Robot, q: object, length: float = 1.0) -> Array:
    """Speeds of the tip per unit of joint speed along the axes of the manipulability ellipsoid.

    Args:
        robot: The arm.
        q: Joint vector (n,) [rad, m].
        length: Distance [m] that counts as much as one radian.

    Returns:
        Singular values (min(k, n),) in descending order; the last is 0 at a singularity.

    Raises:
        ShapeError: The shape of ``q`` is not (n,).
        ParameterError: ``q`` contains NaN or infinity, or the length is not above 0.
        ClosureError: The loops do not close with these joints.
    """
    jacobian = controlled_jacobian(robot, q, length)
    return np.asarray(np.linalg.svd(jacobian, compute_uv=False), dtype=np.float64)


def manipulability(robot: Robot, q: object, length: float = 1.0) -> float:
    """Volume of the manipulability ellipsoid up to a constant factor: the product of singular values.

    The manipulability is 0 at a singularity. For arms with at least as many joints as controlled directions it equals
    sqrt(det(J Jᵀ)). Arguments and errors are those of :func:`singular_values`.

    Source:
        Yoshikawa 1985, eq. 6.
    """
    return float(np.prod(singular_values(robot, q, length)))


MOST_SAMPLES = 1_000_000
"""Largest number of samples of a workspace; each takes some hundred bytes of memory."""


def sample_workspace(robot: Robot, count: int, rng: np.random.Generator, length: float = 1.0) -> tuple[Array, Array]:
    """Tip positions and manipulability of joint vectors drawn evenly inside the limits.

    Samples that are uniform in the joints are not uniform in space: the density of points shows how many postures reach
    a position. Joint vectors at which the loops do not close in the assembly of home are left out. If the loops close
    at no joint vector, all joint vectors are used, with their poses of least error. This happens for a hand, because
    random joints never grasp an object.

    Args:
        robot: The arm.
        count: Number of samples, from 1 to :data:`MOST_SAMPLES`.
        rng: Source of the draws.
        length: Distance [m] that counts as much as one radian in the manipulability.

    Returns:
        Points in the base (k, 3) [m], and manipulability (k,). For a robot without loops k equals ``count``.

    Raises:
        ParameterError: The count is out of bounds, or the length is not above 0.
    """
    if not 1 <= count <= MOST_SAMPLES:
        raise ParameterError("count", count, f"at least 1 and at most {MOST_SAMPLES}")
    _check_length(length)
    joints = rng.uniform(robot.lower, robot.upper, (count, robot.n))
    answer = robot.solve_fk_batch(joints, search=False)
    is_closed = answer.status < FkStatus.OTHER_MODE
    kept = is_closed if is_closed.any() else np.ones(count, dtype=bool)
    points = np.ascontiguousarray(answer.T[kept, :3, 3])
    jacobians = np.stack([_controlled(robot, _kernel_jacobian(robot, q), length) for q in joints[kept]])
    values = np.linalg.svd(jacobians, compute_uv=False).prod(axis=-1)
    return points, np.asarray(values, dtype=np.float64)


def write_workspace_csv(path: Path | str, points: Array, values: Array) -> None:
    """Write samples as CSV: the header :data:`COLUMNS`, then one row per sample, in full precision.

    Args:
        path: New or existing file; it is replaced.
        points: (N, 3) [m].
        values: Manipulability (N,).

    Raises:
        OSError: The file cannot be written.
    """
    rows = np.column_stack((points, values))
    lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in rows.tolist())]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
