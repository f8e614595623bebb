"""Robot: the one interface of every arm, on top of that arm's compiled kernels."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import Any, NamedTuple, TypeGuard

import numpy as np
from numba import types
from numpy.typing import NDArray

from teleop_core.errors import ParameterError, ShapeError, UnknownNameError
from teleop_core.geometry import Array, checked_array, is_rigid, rotation_angle_between
from teleop_core.kernels import inner, kernel, pointer
from teleop_core.robots.drives import Drives, Dynamics

_ROW, _TABLE = types.float64[::1], types.float64[:, ::1]
# Signatures that let one compiled graph run any robot: see Kernels for the arguments.
FK = types.void(_ROW, _ROW, _TABLE)
IK = types.int64(_TABLE, _ROW, _TABLE, _ROW, _ROW, _ROW)


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


class IkResult(NamedTuple):
    """Answer of :meth:`Robot.ik`; for a batch each entry has one more leading axis."""

    q: Array
    """Joint vector (n,) [rad, m], always finite and inside the limits."""
    status: Any
    """:class:`IkStatus`; for a batch an integer array (N,) of its values."""
    residual: Array
    """Distance [m] and angle [rad] that remain between the pose of ``q`` and the wanted pose."""


@dataclass(frozen=True, kw_only=True)
class Kernels:
    """Compiled functions of one robot over its ``geometry`` row.

    ``fk(q, geometry, T)`` and ``jacobian(q, geometry, J)`` write their last argument.
    ``ik(T, seed, limits, geometry, q, residual)`` writes ``q`` and ``residual`` and returns an
    :class:`IkStatus`; the rows of ``limits`` (3, n) are lower, upper and the largest step away
    from the seed. With infinite steps the branch inside the limits that is nearest to the seed
    is wanted; with finite ones, in a path, the branch never changes. It returns -1, nothing
    written, for a T that is not rigid or a seed that is not finite (:func:`is_askable`).
    ``ik_all(T, geometry, solutions)`` fills rows of ``solutions`` and returns how many, without
    regard to limits.
    """

    fk: Any
    jacobian: Any
    ik: Any
    ik_all: Any


@inner
def is_askable(T: Array, seed: Array) -> bool:
    """Whether T is a rigid transform and the seed finite: the question every ik kernel checks."""
    for i in range(seed.shape[0]):
        if not math.isfinite(seed[i]):
            return False
    return bool(is_rigid(T))


@kernel
def fk_batch(fk: Any, q: Array, geometry: Array, transforms: Array) -> None:
    """Transforms (N, 4, 4) of joint vectors (N, n)."""
    for i in range(q.shape[0]):
        fk(q[i], geometry, transforms[i])


@kernel
def ik_batch(
    ik: Any,
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
            return  # fmt: skip


@inner
def pose_residual(reached: Array, wanted: Array, residual: Array) -> bool:
    """Write distance [m] and angle [rad] between two transforms; whether both are negligible."""
    square = 0.0
    for i in range(3):
        square += (reached[i, 3] - wanted[i, 3]) ** 2
    residual[0] = math.sqrt(square)
    residual[1] = rotation_angle_between(reached, wanted)
    return residual[0] <= REACHED and residual[1] <= REACHED


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """An arm: names, limits, home and the kinematics over them; metres and radians.

    Args:
        name: Name in :func:`teleop_core.robots.load_robot`.
        joint_names: Names in the order of every joint vector.
        lower: Smallest joint positions (n,) [rad, m].
        upper: Largest joint positions (n,) [rad, m].
        home: Joint vector (n,) at which the simulated slave starts.
        geometry: Symbols and their values [m, rad], in the order the kernels expect.
        kernels: Compiled functions.
        drives: Drive table, None for robots that are not used as slaves.
        dynamics: Rigid-body model, None for robots that are not used as slaves.
        task_mask: Directions that the robot controls: x, y, z, then rotations about x, y, z.
    """

    name: str
    joint_names: tuple[str, ...]
    lower: Array
    upper: Array
    home: Array
    geometry: Mapping[str, float]
    kernels: Kernels
    drives: Drives | None = None
    dynamics: Dynamics | None = None
    task_mask: tuple[bool, ...] = (True,) * 6
    geometry_row: Array = field(init=False, repr=False)
    # Writable copies for the kernels; the public arrays are read-only.
    _free: Array = field(init=False, repr=False)
    _home: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        row = np.array(list(self.geometry.values()), dtype=np.float64)
        object.__setattr__(self, "geometry_row", row)
        object.__setattr__(self, "_free", self.limits())
        object.__setattr__(self, "_home", self.home.copy())
        for array in (self.lower, self.upper, self.home):
            array.setflags(write=False)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @cached_property
    def fk_pointer(self) -> Any:
        """Forward kinematics as an argument for other kernels."""
        return pointer(self.kernels.fk, FK)

    @cached_property
    def ik_pointer(self) -> Any:
        """Inverse kinematics as an argument for other kernels."""
        return pointer(self.kernels.ik, IK)

    def limits(self, dt: float = math.inf) -> Array:
        """Rows lower, upper, largest step within ``dt`` [s]: (3, n), as the ik kernel takes it."""
        step = np.full(self.n, np.inf)
        if self.drives is not None and not math.isinf(dt):
            step = self.drives.speed_limit * dt
        return np.ascontiguousarray(np.stack((self.lower, self.upper, step)))

    def fk(self, q: object) -> Array:
        """Pose of the tip in the base.

        Args:
            q: Joint vector (n,) or batch (N, n) [rad, m]; limits are not applied.

        Returns:
            ``T_base_tip``, (4, 4) or (N, 4, 4), position in metres.

        Raises:
            ShapeError: Another shape.
            ParameterError: NaN or infinity.
        """
        joints = checked_array("q", q, (self.n,))
        if joints.ndim == 1:
            transform = np.empty((4, 4))
            self.kernels.fk(joints, self.geometry_row, transform)
            return transform
        transforms = np.empty((len(joints), 4, 4))
        fk_batch(self.fk_pointer, joints, self.geometry_row, transforms)
        return transforms

    def jacobian(self, q: object) -> Array:
        """Geometric Jacobian of the tip in base axes.

        Args:
            q: Joint vector (n,) [rad, m].

        Returns:
            (6, n): linear velocity of the tip point [m/s], then angular velocity [rad/s], per
            unit joint speed.

        Raises:
            ShapeError: Another shape.
            ParameterError: NaN or infinity.
        """
        joints = checked_array("q", q, (self.n,))
        if joints.ndim != 1:
            raise ShapeError("q", (self.n,), joints.shape)
        out = np.empty((6, self.n))
        self.kernels.jacobian(joints, self.geometry_row, out)
        return out

    def ik(self, T: object, seed: object = None) -> IkResult:
        """Joint vector inside the limits that reaches a pose, on the branch next to the seed.

        Args:
            T: Wanted ``T_base_tip`` (4, 4), or a batch (N, 4, 4).
            seed: Joint vector (n,) to stay next to, (N, n) one for each; home when None.

        Returns:
            :class:`IkResult`. A pose that cannot be reached is not an error: the nearest joint
            vector comes back with its status and residual.

        Raises:
            ShapeError: Another shape.
            ParameterError: NaN, infinity, or a matrix that is not a rigid transform.
        """
        poses = T if _is_ready(T, (4, 4)) else checked_array("T", T, (4, 4))
        if poses.ndim == 2:
            return self._ik_one(poses, seed)
        seeds = self._home if seed is None else checked_array("seed", seed, (self.n,))
        if seeds.ndim == 2 and len(seeds) != len(poses):
            raise ShapeError("seed", (len(poses), self.n), seeds.shape)
        return self._solve(poses, np.atleast_2d(seeds), self._free, is_path=False)

    def _ik_one(self, T: Array, seed: object) -> IkResult:
        if seed is None:
            seed = self._home
        elif not _is_ready(seed, (self.n,)):
            seed = checked_array("seed", seed, (self.n,))
        q, residual = np.empty(self.n), np.empty(2)
        status = self.kernels.ik(T, seed, self._free, self.geometry_row, q, residual)
        if status < 0:
            raise ParameterError("T or seed", (T.tolist(), list(seed)), _ASKABLE)
        return IkResult(q, _STATUS[status], residual)

    def follow(self, T: object, seed: object = None, dt: float = 0.001) -> IkResult:
        """Joint path along poses, with joint speeds inside the drive limits and no branch flip.

        Args:
            T: Wanted poses (N, 4, 4), ``dt`` apart.
            seed: Joint vector (n,) before the first pose; home when None.
            dt: Time between poses [s].

        Returns:
            :class:`IkResult` with a leading axis; where the speed limit holds the arm back the
            status is LIMITED and the residual says by how much.

        Raises:
            ShapeError: Another shape.
            ParameterError: NaN, infinity, or a matrix that is not a rigid transform.
        """
        poses = checked_array("T", T, (4, 4)).reshape(-1, 4, 4)
        start = self._home if seed is None else checked_array("seed", seed, (self.n,))
        return self._solve(poses, np.atleast_2d(start), self.limits(dt), is_path=True)

    def _solve(self, poses: Array, seeds: Array, limits: Array, *, is_path: bool) -> IkResult:
        count = len(poses)
        q, residual = np.empty((count, self.n)), np.empty((count, 2))
        status = np.zeros(count, np.int64)
        ik_batch(
            self.ik_pointer, poses, seeds, is_path, limits, self.geometry_row, q, residual, status
        )
        if count and status.min() < 0:
            bad = int(status.argmin())
            raise ParameterError(f"T[{bad}]", poses[bad].tolist(), _ASKABLE)
        return IkResult(q, status, residual)

    def ik_all(self, T: object) -> Array:
        """All joint vectors that reach a pose, one per branch, without regard to limits.

        Args:
            T: Wanted ``T_base_tip`` (4, 4).

        Returns:
            (k, n) [rad, m]; k = 0 when no branch reaches the pose.

        Raises:
            ShapeError: Another shape.
            ParameterError: NaN, infinity, or a matrix that is not a rigid transform.
        """
        pose = checked_array("T", T, (4, 4))
        if pose.ndim != 2 or not is_rigid(pose):
            raise ParameterError("T", pose.tolist(), _ASKABLE)
        solutions = np.empty((MAX_BRANCHES, self.n))
        return solutions[: self.kernels.ik_all(pose, self.geometry_row, solutions)].copy()


_ASKABLE = "a finite right-handed rigid transform with last row 0, 0, 0, 1, and a finite seed"
_STATUS = tuple(IkStatus)


def _is_ready(value: Any, shape: tuple[int, ...]) -> TypeGuard[Array]:
    """Whether a kernel can take the value as it is; the kernels check that it is finite."""
    return (
        type(value) is np.ndarray
        and value.shape == shape
        and value.dtype == np.float64
        and value.flags.carray
    )


def geometry_of(
    defaults: Mapping[str, float], given: Mapping[str, float | str]
) -> dict[str, float]:
    """Published geometry with the given symbols in its place.

    Raises:
        UnknownNameError: A symbol the robot does not have.
        ParameterError: A value that is not a finite number.
    """
    for symbol, value in given.items():
        if symbol not in defaults:
            raise UnknownNameError("geometry", symbol, defaults)
        if not isinstance(value, int | float) or not math.isfinite(value):
            raise ParameterError(symbol, value, "a finite number [m or rad]")
    return {**defaults, **{symbol: float(value) for symbol, value in given.items()}}
