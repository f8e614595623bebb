"""Robot: the one interface of every arm, on top of that arm's compiled kernels."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, cast, overload

import numpy as np

from teleop_core import kinematics
from teleop_core.base import ParameterError, ShapeError, UnknownNameError
from teleop_core.kernels import Array, checked_array, direct, is_rigid, pointer, product, raise_pending
from teleop_core.kinematics import (
    ASSEMBLE,
    FK,
    IK,
    MAX_BRANCHES,
    AssembleKernel,
    FkBatch,
    FkOne,
    IkBatch,
    IkKernel,
    IkOne,
    IkResult,
    IkStatus,
    Kernels,
    WriteKernel,
    is_ready,
)
from teleop_core.robots import description, forward_kinematics, freedom
from teleop_core.robots.drives import Drives, Dynamics, independent_axes, read_only
from teleop_core.robots.hardware import Hardware

if TYPE_CHECKING:
    from teleop_core.robots.body import Bodies
    from teleop_core.robots.visual import Surrounding, Visual


class _Start:
    """Start posture of a robot: the given posture, or the result of ``start_posture``, computed at first use."""

    @overload
    def __get__(self, robot: None, owner: type) -> None: ...
    @overload
    def __get__(self, robot: "Robot", owner: type) -> Array: ...
    def __get__(self, robot: "Robot | None", owner: type) -> Array | None:
        if robot is None:
            return None  # default of the field ``start``
        if robot.__dict__["start"] is None:
            posture = read_only("start", freedom.start_of(robot), (robot.n,))
            robot.__dict__["start"] = posture
        return cast("Array", robot.__dict__["start"])

    def __set__(self, robot: "Robot", value: Array | None) -> None:
        robot.__dict__["start"] = value


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Robot:
    """An arm: joint names, limits, home and kinematics, in metres and radians.

    All arrays of a robot are read-only copies; two robots share no writable memory.

    Args:
        name: Name in :func:`teleop_core.robots.load_robot`.
        joint_names: Names in the order of every joint vector.
        lower: Smallest joint positions (n,) [rad, m].
        upper: Largest joint positions (n,) [rad, m].
        home: Joint vector (n,) of the published or natural zero, inside the limits.
        world_base: Pose (4, 4) of the base in the world of a scene; None for an arm without a scene.
        home_is_assumed: Whether home may be no working posture. An example is the zero of a URDF, at which many arms
            are stretched out. No session starts at an assumed home.
        start: Joint vector (n,) at which a session starts, inside the limits. None means a posture with room in all
            directions (:func:`teleop_core.robots.freedom.start_posture`); it is computed at its first use.
        geometry: Symbols and their values [m, rad]. Without a ``row``, the kernels get these values in this order.
        kernels: Compiled functions.
        row: Numbers for the kernels (k,); None for the values of the geometry.
        drives: Drive table; None for robots that are not used as slaves.
        dynamics: Rigid-body model; None for independent axes.
        hardware: Differences between the real arm and its model; None if unknown.
        task_mask: Directions that the robot controls: x, y, z, then rotations about x, y, z.
        solution: Text about the method of inverse kinematics; empty if unknown.
        visuals: Shapes of the links, if the robot's file contains shapes. Mesh files are read only when they are drawn.
        notes: Notes on content of the robot's file that the author may have meant differently.
        describe: Function that returns the bodies of a robot whose joints are not a chain
            (:func:`teleop_core.robots.bodies.bodies_of`). None for a chain, or if the bodies are unknown.

    Raises:
        ShapeError: Limits, home, start or drives are not vectors (n,).
        ParameterError: A lower limit is not below the upper limit, or home or start is outside the limits.
    """

    name: str
    joint_names: tuple[str, ...]
    lower: Array
    upper: Array
    home: Array
    geometry: Mapping[str, float]
    kernels: Kernels
    row: Array | None = None
    drives: Drives | None = None
    dynamics: Dynamics | None = None
    hardware: Hardware | None = None
    task_mask: tuple[bool, ...] = (True,) * 6
    solution: str = ""
    visuals: "tuple[Visual, ...]" = ()
    notes: tuple[str, ...] = ()
    describe: "Callable[[Robot], Bodies] | None" = None
    home_is_assumed: bool = False
    world_base: Array | None = None
    start: _Start = _Start()
    # Writable copies for the kernels, which are compiled only for writable arrays.
    _row: Array = field(init=False)
    _free: Array = field(init=False)
    _home: Array = field(init=False)

    def __post_init__(self) -> None:
        shape = (len(self.joint_names),)
        for name in ("lower", "upper", "home"):
            object.__setattr__(self, name, read_only(name, getattr(self, name), shape))
        if not (self.lower < self.upper).all():
            raise ParameterError("lower", self.lower.tolist(), f"below {self.upper.tolist()}")
        if not ((self.lower <= self.home) & (self.home <= self.upper)).all():
            raise ParameterError("home", self.home.tolist(), "inside the limits")
        self._check_start(shape)
        if self.drives is not None:
            if self.drives.inertia.shape != shape:
                raise ShapeError("drives", shape, self.drives.inertia.shape)
            model = self.dynamics or independent_axes(self.drives.inertia)
            object.__setattr__(self, "dynamics", model)
        if self.hardware is not None and self.hardware.coulomb.shape != shape:
            raise ShapeError("hardware", shape, self.hardware.coulomb.shape)
        geometry = MappingProxyType(dict(self.geometry))
        object.__setattr__(self, "geometry", geometry)
        numbers = list(geometry.values()) if self.row is None else self.row
        object.__setattr__(self, "_row", np.array(numbers, dtype=np.float64))
        if self.row is not None:
            object.__setattr__(self, "row", read_only("row", self.row))
        object.__setattr__(self, "_free", self.limits())
        object.__setattr__(self, "_home", self.home.copy())

    def _check_start(self, shape: tuple[int, ...]) -> None:
        given = self.__dict__["start"]
        if given is None:
            return
        object.__setattr__(self, "start", read_only("start", given, shape))
        if not ((self.lower <= self.start) & (self.start <= self.upper)).all():
            raise ParameterError("start", self.start.tolist(), "inside the limits")

    def __repr__(self) -> str:
        return description.short(self)

    def _repr_html_(self) -> str:
        return description.html(self)

    def surroundings(self) -> "tuple[Surrounding, ...]":
        """Shapes of the scene in which the arm stands, its own included; none by default."""
        return ()

    @cached_property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def drives_are_assumed(self) -> bool:
        """Whether some entry of the drive table is assumed; ``drives.assumed`` lists these entries."""
        return self.drives is not None and bool(self.drives.assumed)

    @property
    def geometry_row(self) -> Array:
        """Numbers that the kernels take. Each call returns a new array, which the caller may change."""
        return self._row.copy()

    @cached_property
    def fk_pointer(self) -> WriteKernel:
        """Forward kinematics as an argument for other kernels."""
        return cast("WriteKernel", pointer(self.kernels.fk, FK))

    @cached_property
    def assemble_pointer(self) -> AssembleKernel | None:
        """Forward kinematics with status, as an argument for other kernels; None if the robot has no such kernel."""
        if self.kernels.assemble is None:
            return None
        return cast("AssembleKernel", pointer(self.kernels.assemble, ASSEMBLE))

    @cached_property
    def _fk(self) -> WriteKernel:
        return direct(self.kernels.fk, FK)

    @cached_property
    def _jacobian(self) -> WriteKernel:
        return direct(self.kernels.jacobian, FK)

    @cached_property
    def _ik(self) -> IkKernel:
        return direct(self.kernels.ik, IK)

    @cached_property
    def ik_pointer(self) -> IkKernel:
        """Inverse kinematics as an argument for other kernels."""
        return cast("IkKernel", pointer(self.kernels.ik, IK))

    @property
    def speed_limit(self) -> Array:
        """Largest joint speeds (n,) of the drives [rad/s or m/s]; infinite without drives."""
        return np.full(self.n, np.inf) if self.drives is None else self.drives.speed_limit

    def limits(self, dt: float = math.inf) -> Array:
        """Limits (3, n) for the ik kernel; rows: lower limit, upper limit, largest step within ``dt`` [s].

        Without drives, or without ``dt``, steps are infinite. Each call returns a new array, which the caller may
        change.
        """
        return np.stack((self.lower, self.upper, self.speed_limit * dt))

    def fk(self, q: object) -> Array:
        """Pose of the tip in the base; all loops close.

        A robot with loops may have several poses for a joint vector. The result is the pose in the assembly of home if
        the loops close there, else the nearest pose to home that a search finds. Redundant joints, such as those of a
        hand that grasps an object, may contradict each other by up to 0.1 mm.

        Args:
            q: Joint vector (n,) or batch (N, n) [rad, m]; limits are not applied.

        Returns:
            ``T_base_tip``, (4, 4) or (N, 4, 4), position in metres.

        Raises:
            ShapeError: ``q`` is neither (n,) nor (N, n).
            ParameterError: ``q`` contains NaN or infinity.
            ClosureError: No assembly has these joints; :meth:`solve_fk` returns a result even then.
        """
        joints = checked_array("q", q, (self.n,))
        if self.kernels.assemble is not None:
            return forward_kinematics.closed_poses(self, joints)
        if joints.ndim == 1:
            transform = np.empty((4, 4))
            self._fk(joints, self._row, transform)
            return transform
        transforms = np.empty((len(joints), 4, 4))
        kinematics.fk_batch(self.fk_pointer, joints, self._row, transforms)
        raise_pending()
        return transforms

    def solve_fk(self, q: object, seed: object = None, *, search: bool = True) -> FkOne:
        """Pose of the tip in the base, and whether the loops close there.

        Args:
            q: Joint vector (n,) [rad, m]; limits are not applied. A batch (N, n) gives the result of
                :meth:`solve_fk_batch`, whose declared types fit batches.
            seed: ``T_base_tip`` (4, 4); the result stays in its assembly. None for the assembly of home.
            search: Whether to search for another assembly if the loops do not close in the assembly of the seed. A tick
                of a session never searches.

        Returns:
            :class:`FkResult`. If no assembly has these joints, no error is raised: the result is the pose of least
            error, with its status and residual.

        Raises:
            ShapeError: ``q`` or the seed has a wrong shape.
            ParameterError: ``q`` contains NaN or infinity, or the seed is not a rigid transform.
        """
        joints = checked_array("q", q, (self.n,))
        if joints.ndim != 1:
            return cast("FkOne", self.solve_fk_batch(joints, seed, search=search))
        return forward_kinematics.solved_one(self, joints, seed, search=search)

    def solve_fk_batch(self, q: object, seed: object = None, *, search: bool = True) -> FkBatch:
        """Poses of joint vectors (N, n), solved independently; one seed (4, 4), or one for each joint vector (N, 4, 4).

        Arguments and errors are those of :meth:`solve_fk`.

        Returns:
            :class:`FkResult` with a leading axis; its ``status`` is an array of values of :class:`FkStatus`.
        """
        joints = checked_array("q", q, (self.n,)).reshape(-1, self.n)
        return forward_kinematics.solved(self, joints, seed, search=search)

    def follow_fk(self, q: object, seed: object = None) -> FkBatch:
        """Poses along a path of joint vectors; the path stays in its assembly as long as the loops close there.

        Args:
            q: Joint vectors (N, n) [rad, m], each near the previous one.
            seed: ``T_base_tip`` (4, 4) before the first joint vector; None for the assembly of home.

        Returns:
            :class:`FkResult` with a leading axis. Where the path leaves the assembly, beyond a singular pose, the
            status is NOT_CLOSED, and no other assembly is searched. Later poses are solved from the last pose at which
            the loops closed.

        Raises:
            ShapeError: ``q`` or the seed has a wrong shape.
            ParameterError: ``q`` contains NaN or infinity, or the seed is not a rigid transform.
        """
        joints = checked_array("q", q, (self.n,)).reshape(-1, self.n)
        return forward_kinematics.solved(self, joints, seed, search=False, is_path=True)

    def fk_all(self, q: object) -> Array:
        """All poses that a joint vector can have: first the pose of :meth:`fk`, then the others by distance from it.

        Args:
            q: Joint vector (n,) [rad, m]; limits are not applied.

        Returns:
            ``T_base_tip`` (k, 4, 4); k = 0 if the loops close in no assembly, k = 1 for a robot without loops.

        Raises:
            ShapeError: The shape of ``q`` is not (n,).
            ParameterError: ``q`` contains NaN or infinity.
        """
        joints = checked_array("q", q, (self.n,))
        if joints.ndim != 1:
            raise ShapeError("q", (self.n,), joints.shape)
        return forward_kinematics.all_poses(self, joints)

    def jacobian(self, q: object) -> Array:
        """Geometric Jacobian of the tip in base axes.

        Args:
            q: Joint vector (n,) [rad, m].

        Returns:
            (6, n): linear velocity of the tip point [m/s], then angular velocity [rad/s], per unit joint speed.

        Raises:
            ShapeError: The shape of ``q`` is not (n,).
            ParameterError: ``q`` contains NaN or infinity.
            ClosureError: No assembly has these joints.
        """
        joints = checked_array("q", q, (self.n,))
        if joints.ndim != 1:
            raise ShapeError("q", (self.n,), joints.shape)
        if self.kernels.assemble is not None:
            forward_kinematics.closed_poses(self, joints)
        out = np.empty((6, self.n))
        self._jacobian(joints, self._row, out)
        return out

    def forward_dynamics(self, q: object, dq: object, effort: object, wrench: object = None) -> Array:
        """Joint accelerations (n,) [rad/s² or m/s²] under efforts of the drives and a wrench on the tip.

        Args:
            q: Joint vector (n,) [rad, m].
            dq: Joint speeds (n,) [rad/s or m/s].
            effort: Efforts of the drives, minus friction (n,) [N·m or N].
            wrench: External wrench at the origin of the tip in base axes (6,): force [N], then torque [N·m]; None for
                no wrench.

        Raises:
            ShapeError: An argument has a wrong shape.
            ParameterError: An argument contains NaN or infinity, or the robot has neither drives nor dynamics.
            ClosureError: No assembly has these joints.
        """
        if self.dynamics is None:
            raise ParameterError("dynamics", None, f"that of a robot with drives; {self.name} has none")
        given = {"q": q, "dq": dq, "effort": effort}
        place, speed, net = (read_only(n, row, (self.n,)).copy() for n, row in given.items())
        if wrench is not None:  # the transposed Jacobian maps it to efforts (Craig 2005, 5.10)
            net += product(self.jacobian(q).T, read_only("wrench", wrench, (6,)))
        out = np.empty(self.n)
        self.dynamics.acceleration(place, speed, net, self.dynamics.parameters.copy(), out)
        return out

    def ik(self, T: object, seed: object = None) -> IkOne:
        """Joint vector inside the limits that reaches a pose, on the branch next to the seed.

        Args:
            T: Wanted ``T_base_tip`` (4, 4). A batch (N, 4, 4) gives the result of :meth:`ik_batch`, whose declared
                types fit batches.
            seed: Joint vector (n,) [rad, m]; the result stays next to it. None for home.

        Returns:
            :class:`IkResult`. If the pose cannot be reached, no error is raised: the result is the nearest joint
            vector, with its status and residual.

        Raises:
            ShapeError: ``T`` or the seed has a wrong shape.
            ParameterError: An argument contains NaN or infinity, or ``T`` is not a rigid transform.
        """
        pose = T if is_ready(T, (4, 4)) else checked_array("T", T, (4, 4))
        if pose.ndim != 2:
            return cast("IkOne", self.ik_batch(pose, seed))
        if seed is None:
            start = self._home
        else:
            start = seed if is_ready(seed, (self.n,)) else checked_array("seed", seed, (self.n,))
        q, residual = np.empty(self.n), np.empty(2)
        status = self._ik(pose, start, self._free, self._row, q, residual)
        if status < 0:
            raise ParameterError("T or seed", (pose.tolist(), list(start)), _ASKABLE)
        # This does the same as IkResult(...), without a Python function call.
        return tuple.__new__(IkResult, (q, _STATUS[status], residual))

    def ik_batch(self, T: object, seed: object = None) -> IkBatch:
        """Joint vectors that reach many poses, solved independently.

        Args:
            T: Wanted poses (N, 4, 4).
            seed: Joint vector (n,), or one for each pose (N, n); the results stay next to it. None for home.

        Returns:
            :class:`IkResult` with a leading axis; its ``status`` is an array of values of :class:`IkStatus`.

        Raises:
            ShapeError: ``T`` or the seed has a wrong shape.
            ParameterError: An argument contains NaN or infinity, or a matrix of ``T`` is not a rigid transform.
        """
        poses = checked_array("T", T, (4, 4)).reshape(-1, 4, 4)
        seeds = self._home if seed is None else checked_array("seed", seed, (self.n,))
        if seeds.ndim == 2 and len(seeds) != len(poses):
            raise ShapeError("seed", (len(poses), self.n), seeds.shape)
        return self._solve(poses, np.atleast_2d(seeds), self._free, is_path=False)

    def follow(self, T: object, seed: object = None, dt: float = 0.001) -> IkBatch:
        """Joint path along poses, with joint speeds inside the drive limits and without a change of branch.

        Args:
            T: Wanted poses (N, 4, 4), one every ``dt``.
            seed: Joint vector (n,) before the first pose; None for home.
            dt: Time between poses [s].

        Returns:
            :class:`IkResult` with a leading axis. Where the speed limit makes the arm lag, the status is LIMITED and
            the residual is the remaining error.

        Raises:
            ShapeError: ``T`` or the seed has a wrong shape.
            ParameterError: An argument contains NaN or infinity, or a matrix of ``T`` is not a rigid transform.
        """
        poses = checked_array("T", T, (4, 4)).reshape(-1, 4, 4)
        start = self._home if seed is None else checked_array("seed", seed, (self.n,))
        return self._solve(poses, np.atleast_2d(start), self.limits(dt), is_path=True)

    def _solve(self, poses: Array, seeds: Array, limits: Array, *, is_path: bool) -> IkBatch:
        count = len(poses)
        q, residual = np.empty((count, self.n)), np.empty((count, 2))
        status = np.zeros(count, np.int64)
        kinematics.ik_batch(self.ik_pointer, poses, seeds, is_path, limits, self._row, q, residual, status)
        raise_pending()
        if count and status.min() < 0:
            bad = int(status.argmin())
            raise ParameterError(f"T[{bad}]", poses[bad].tolist(), _ASKABLE)
        return IkResult(q, status, residual)

    def ik_all(self, T: object) -> Array:
        """All joint vectors that reach a pose, one per branch, without regard to limits.

        Args:
            T: Wanted ``T_base_tip`` (4, 4).

        Returns:
            (k, n) [rad, m]; k = 0 if no branch reaches the pose.

        Raises:
            ShapeError: The shape of ``T`` is not (4, 4).
            ParameterError: ``T`` contains NaN or infinity, or is not a rigid transform.
        """
        pose = checked_array("T", T, (4, 4))
        if pose.ndim != 2 or not is_rigid(pose):
            raise ParameterError("T", pose.tolist(), _ASKABLE)
        solutions = np.empty((MAX_BRANCHES, self.n))
        return solutions[: self.kernels.ik_all(pose, self._row, solutions)].copy()


_ASKABLE = "a finite right-handed rigid transform with last row 0, 0, 0, 1, and a finite seed"
_STATUS = tuple(IkStatus)


def geometry_of(defaults: Mapping[str, float], given: Mapping[str, float | str]) -> dict[str, float]:
    """Published geometry, with the values of the given symbols replaced.

    Raises:
        UnknownNameError: The robot does not have such a symbol.
        ParameterError: A value is not a finite number.
    """
    for symbol, value in given.items():
        if symbol not in defaults:
            raise UnknownNameError("geometry", symbol, defaults)
        if not isinstance(value, int | float) or not math.isfinite(value):
            raise ParameterError(symbol, value, "a finite number [m or rad]")
    return {**defaults, **{symbol: float(value) for symbol, value in given.items()}}
