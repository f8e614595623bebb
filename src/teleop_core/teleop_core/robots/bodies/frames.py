"""Frames: products of poses (7,) in plain NumPy, and tips of robots whose loops may be open."""

import math

import numpy as np

from teleop_core.kernels import geometry, kernel, portable
from teleop_core.kinematics import FkStatus
from teleop_core.robots.robot import Robot


@kernel
def poses_from_transforms(transforms: geometry.Array, poses: geometry.Array) -> None:
    """Write poses (N, 7) of transforms (N, 4, 4)."""
    for i in range(transforms.shape[0]):
        geometry.pose_from_transform(transforms[i], poses[i])


def tips(robot: Robot, q: geometry.Array) -> tuple[geometry.Array, geometry.Array]:
    """Tips of joint vectors (N, n): transforms (N, 4, 4) and poses (N, 7).

    The tip is computed in the assembly of home. If the loops do not close there, the tip of the nearest assembly that a
    search finds is taken. If the loops close in no assembly, the pose of least error is taken. Joints that are not
    finite give NaN.
    """
    is_finite = np.isfinite(q).all(axis=1)
    transforms, poses = np.full((len(q), 4, 4), np.nan), np.empty((len(q), 7))
    answer = robot.solve_fk_batch(q[is_finite], search=False)
    found = answer.T
    is_open = answer.status >= int(FkStatus.NOT_CLOSED)
    if is_open.any() and robot.kernels.assemblies is not None:
        found[is_open] = robot.solve_fk_batch(q[is_finite][is_open]).T
    transforms[is_finite] = found
    poses_from_transforms(transforms, poses)
    return transforms, poses


def product(a: geometry.Array, b: geometry.Array) -> geometry.Array:
    """Pose (7,) of ``b``, given in the frame of ``a``."""
    out = np.empty(7)
    out[:3] = a[:3] + portable.product(geometry.rotations_from_quaternions(a[3:]), b[:3])
    geometry.multiply_quaternions(a[3:].copy(), b[3:].copy(), out[3:])
    return out


def inverse(pose: geometry.Array) -> geometry.Array:
    """Pose (7,) of the base in the frame of ``pose``."""
    out = np.empty(7)
    out[3:] = pose[3:] * (1.0, -1.0, -1.0, -1.0)
    out[:3] = -portable.product(geometry.rotations_from_quaternions(out[3:]), pose[:3])
    return out


def moved(pose: geometry.Array, kind: int, value: float) -> geometry.Array:
    """Pose (7,), rotated about its z axis (kind 1, [rad]) or shifted along that axis (kind 2, [m])."""
    half = 0.5 * value
    step = np.array([0.0, 0.0, 0.0, math.cos(half), 0.0, 0.0, math.sin(half)])
    if kind == 2:
        step = np.array([0.0, 0.0, value, 1.0, 0.0, 0.0, 0.0])
    return product(pose, step)


def seen_from(pose: geometry.Array, point: geometry.Array) -> geometry.Array:
    """Point (3,), given in the base, in the frame of a pose (7,)."""
    return portable.product(geometry.rotations_from_quaternions(pose[3:]).T, point - pose[:3])


def pose_of(transform: geometry.Array) -> geometry.Array:
    """Pose (7,) of a transform (4, 4)."""
    out = np.empty(7)
    geometry.pose_from_transform(np.ascontiguousarray(transform), out)
    return out


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0, axis: str = "z", angle: float = 0.0) -> geometry.Array:
    """Pose (7,) at a point [m], rotated by an angle [rad] about a coordinate axis."""
    out = np.array([x, y, z, math.cos(0.5 * angle), 0.0, 0.0, 0.0])
    out[4 + "xyz".index(axis)] = math.sin(0.5 * angle)
    return out
