"""Kinematics of a robot as compiled functions, what they answer, and batches of them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Generic, NamedTuple, TypeAlias, TypeGuard, TypeVar

import numpy as np
from numba import types
from numpy.typing import NDArray

from teleop_core.geometry import Array, is_rigid, rotation_angle_between
from teleop_core.kernels import inner, kernel

_ROW, _TABLE = types.float64[::1], types.float64[:, ::1]
# Signatures that let one compiled graph run any robot: see Kernels for the arguments.
FK = types.void(_ROW, _ROW, _TABLE)
IK = types.int64(_TABLE, _ROW, _TABLE, _ROW, _ROW, _ROW)
WriteKernel: TypeAlias = Callable[[Array, Array, Array], None]
IkKernel: TypeAlias = Callable[[Array, Array, Array, Array, Array, Array], int]
IkAllKernel: TypeAlias = Callable[[Array, Array, Array], int]

# Directions of the tip in base axes, in the order of every task mask.
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
# A pose counts as reached within this distance [m] and angle [rad].
REACHED = 1e-9
# Most joint vectors that one pose can have: the three-fingered hand, four for each finger.
MAX_BRANCHES = 64


class IkStatus(IntEnum):
    """How well inverse kinematics could do what was asked."""

    FOLLOWED = 0  # the joint vector reaches the pose
    LIMITED = 1  # a joint or speed limit keeps the tip off the pose
    NEAR_SINGULAR = 2  # the pose is reached, but small moves need large joint moves here
    UNREACHABLE = 3  # no joint vector reaches the position; the nearest one is returned


Status = TypeVar("Status")


class IkResult(NamedTuple, Generic[Status]):
    """Answer of inverse kinematics: for one pose, or for N with a leading axis in each entry."""

    q: Array
    """Joint vector (n,) or (N, n) [rad, m], always finite and inside the limits."""
    status: Status
    """:class:`IkStatus` of one pose; for N an integer array (N,) of its values."""
    residual: Array
    """Distance [m] and angle [rad], (2,) or (N, 2), between the pose of ``q`` and the wanted."""


IkOne: TypeAlias = IkResult[IkStatus]
IkBatch: TypeAlias = IkResult[NDArray[np.int64]]


@dataclass(frozen=True, kw_only=True)
class Kernels:
    """Functions of one robot over its ``geometry`` row: kernels, or plain Python, which is slower.

    ``fk(q, geometry, T)`` and ``jacobian(q, geometry, J)`` write their last argument.
    ``ik(T, seed, limits, geometry, q, residual)`` writes ``q`` and ``residual`` and returns an
    :class:`IkStatus`; the rows of ``limits`` (3, n) are lower, upper and the largest step away
    from the seed. With infinite steps the branch inside the limits that is nearest to the seed
    is wanted; with finite ones, in a path, the branch never changes. It returns -1, nothing
    written, for a T that is not rigid or a seed that is not finite (:func:`is_askable`).
    ``ik_all(T, geometry, solutions)`` fills rows of ``solutions`` (:data:`MAX_BRANCHES`, n) and
    returns how many, without regard to limits.

    Shapes: ``q`` and ``seed`` (n,), ``T`` (4, 4), ``J`` (6, n), ``residual`` (2,), all float64 in
    C order and writable: for read-only arrays numba would compile a second time.
    """

    fk: WriteKernel
    jacobian: WriteKernel
    ik: IkKernel
    ik_all: IkAllKernel


@inner
def is_askable(T: Array, seed: Array) -> bool:
    """Whether T is a rigid transform and the seed finite: the question every ik kernel checks."""
    for i in range(seed.shape[0]):
        if not math.isfinite(seed[i]):
            return False
    return bool(is_rigid(T))


@inner
def pose_residual(reached: Array, wanted: Array, residual: Array) -> bool:
    """Write distance [m] and angle [rad] between two transforms; whether both are negligible."""
    square = 0.0
    for i in range(3):
        square += (reached[i, 3] - wanted[i, 3]) ** 2
    residual[0] = math.sqrt(square)
    residual[1] = rotation_angle_between(reached, wanted)
    return residual[0] <= REACHED and residual[1] <= REACHED


def is_ready(value: object, shape: tuple[int, ...]) -> TypeGuard[Array]:
    """Whether a kernel can take the value as it is; the kernels check that it is finite."""
    return (
        type(value) is np.ndarray
        and value.shape == shape
        and value.dtype == np.float64
        and value.flags.carray
    )


@kernel
def fk_batch(fk: WriteKernel, q: Array, geometry: Array, transforms: Array) -> None:
    """Write transforms (N, 4, 4) of joint vectors (N, n)."""
    for i in range(q.shape[0]):
        fk(q[i], geometry, transforms[i])


@kernel
def ik_batch(
    ik: IkKernel,
    transforms: Array,
    seeds: Array,
    is_path: bool,
    limits: Array,
    geometry: Array,
    q: Array,
    residuals: Array,
    statuses: NDArray[np.int64],
) -> None:
    """Solve (N, 4, 4): from seeds (N, n), from one seed (1, n), or as a path from that seed."""
    for i in range(transforms.shape[0]):
        seed = seeds[i] if seeds.shape[0] > 1 else seeds[0]
        if is_path and i > 0:
            seed = q[i - 1]
        statuses[i] = ik(transforms[i], seed, limits, geometry, q[i], residuals[i])
        if statuses[i] < 0:
            return
