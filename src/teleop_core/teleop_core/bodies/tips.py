"""Tips of robots with loops: where they are, whether or not the loops close."""

import numpy as np

from teleop_core.geometry import Array, pose_from_transform
from teleop_core.kernels import kernel
from teleop_core.robots.kinematics import FkStatus
from teleop_core.robots.robot import Robot


@kernel
def poses_from_transforms(transforms: Array, poses: Array) -> None:
    """Write poses (N, 7) of transforms (N, 4, 4)."""
    for i in range(transforms.shape[0]):
        pose_from_transform(transforms[i], poses[i])


def tips(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Tips of joint vectors (N, n): transforms (N, 4, 4) and poses (N, 7).

    Next to home's assembly; where that does not close, in the nearest that a search finds; where
    none closes, those of least error. Joints that are not finite give NaN.
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
