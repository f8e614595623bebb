"""Forward kinematics of a robot with its status: the implementation of :meth:`Robot.solve_fk`."""

import numpy as np

from teleop_core import kinematics
from teleop_core.base import ClosureError, ParameterError, ShapeError
from teleop_core.kernels import Array, checked_array, is_rigid, raise_pending
from teleop_core.kinematics import MAX_ASSEMBLIES, SEARCH, FkBatch, FkOne, FkResult, FkStatus
from teleop_core.robots import arm

_NOT_CLOSED = int(FkStatus.NOT_CLOSED)
_STATUS = tuple(FkStatus)


def solved_one(robot: arm.Arm, q: Array, seed: object, *, search: bool = True) -> FkOne:
    """Pose of a joint vector (n,), by the rules of :meth:`Robot.solve_fk`.

    Raises:
        ShapeError: The seed has a wrong shape.
        ParameterError: The seed is not a rigid transform.
    """
    T, numbers = np.empty((4, 4)), np.zeros(2)
    if seed is not None:
        pose = _seeds(seed, 1)
        T[:] = pose if pose.ndim == 2 else pose[0]
    if robot.kernels.assemble is None:
        robot.kernels.fk(q, robot._row, T)
        return FkResult(T, FkStatus.CLOSED, 0.0, 0)
    status = robot.kernels.assemble(q, robot._row, _ask(seed is not None, search), T, numbers)
    return FkResult(T, _STATUS[status], float(numbers[0]), int(numbers[1]))


def solved(robot: arm.Arm, joints: Array, seed: object, *, search: bool = True, is_path: bool = False) -> FkBatch:
    """Poses of joint vectors (N, n), by the rules of :meth:`Robot.solve_fk`.

    Raises:
        ShapeError: The seed has a wrong shape.
        ParameterError: The seed is not a rigid transform.
    """
    count = len(joints)
    transforms, numbers = np.zeros((count, 4, 4)), np.zeros((count, 2))
    statuses = np.zeros(count, np.int64)
    if seed is not None:
        transforms[:] = _seeds(seed, count)
    elif is_path and count:
        transforms[0] = solved_one(robot, joints[0], None, search=search).T
    if robot.assemble_pointer is None:
        kinematics.fk_batch(robot.fk_pointer, joints, robot._row, transforms)
    else:
        kinematics.assemble_batch(
            robot.assemble_pointer,
            joints,
            robot._row,
            _ask(seed is not None or is_path, search),
            is_path,
            transforms,
            numbers,
            statuses,
        )
    raise_pending()
    return FkResult(transforms, statuses, numbers[:, 0], numbers[:, 1].astype(np.int64))


def closed_poses(robot: arm.Arm, joints: Array) -> Array:
    """Poses of joint vectors (n,) or (N, n) at which the loops close.

    Raises:
        ClosureError: The loops do not close for at least one joint vector.
    """
    if joints.ndim == 1:
        one = solved_one(robot, joints, None)
        if one.status >= FkStatus.NOT_CLOSED:
            raise _refusal("q", joints, one.status, one.residual)
        return one.T
    answer = solved(robot, joints, None)
    is_open = answer.status >= _NOT_CLOSED
    if is_open.any():
        k = int(is_open.argmax())
        status, residual = _STATUS[int(answer.status[k])], float(answer.residual[k])
        raise _refusal(f"q[{k}]", joints[k], status, residual)
    return answer.T


def all_poses(robot: arm.Arm, joints: Array) -> Array:
    """All poses (k, 4, 4) of a joint vector (n,), by the rules of :meth:`Robot.fk_all`."""
    first = robot.solve_fk(joints)
    if robot.kernels.assemblies is None:
        return first.T[None] if first.status < _NOT_CLOSED else np.empty((0, 4, 4))
    found = np.empty((MAX_ASSEMBLIES, 4, 4))
    count = robot.kernels.assemblies(joints, robot._row, found)
    if first.status >= _NOT_CLOSED:
        return found[:count].copy()
    away = distances(first.T, found[:count])
    return np.ascontiguousarray(found[:count][np.argsort(away, kind="stable")])


def distances(T: Array, others: Array) -> Array:
    """Largest difference of an element between a transform (4, 4) and each of ``others`` (k, 4, 4); shape (k,)."""
    return np.asarray(np.abs(others - T).max(axis=(1, 2)))


def _ask(is_seeded: bool, search: bool) -> Array:
    return np.array((float(SEARCH) if search else 0.0, float(is_seeded)))


def _seeds(seed: object, count: int) -> Array:
    poses = checked_array("seed", seed, (4, 4))
    if poses.ndim == 3 and len(poses) != count:
        raise ShapeError("seed", (count, 4, 4), poses.shape)
    for pose in poses.reshape(-1, 4, 4):
        if not is_rigid(pose):
            raise ParameterError("seed", pose.tolist(), "a rigid transform T_base_tip")
    return poses


def _refusal(name: str, q: Array, status: FkStatus, residual: float) -> ClosureError:
    requirement = (
        f"joints with which the loops close; a gap of at least {1000.0 * residual:.3g} mm remains "
        "(solve_fk returns the nearest pose with its status)"
    )
    if status == FkStatus.UNDETERMINED:
        requirement = "joints of a layout that fixes a pose; this one is architecturally singular"
    return ClosureError(name, q.tolist(), requirement, residual)
