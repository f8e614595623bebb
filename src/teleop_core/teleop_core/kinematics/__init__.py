"""Kinematics of a robot as compiled functions, their results, and batches of them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Generic, NamedTuple, TypeAlias, TypeGuard, TypeVar

import numpy as np
from numpy.typing import NDArray

from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array, is_rigid, rotation_angle_between

_FLOAT64 = np.dtype(np.float64)  # arrays with this very dtype object are used as they are; others are copied
_ROW, _TABLE = "float64[::1]", "float64[:, ::1]"
# Kernel signatures, shared by all robots, so that one compiled graph can run any robot; the arguments: see Kernels.
FK = f"void({_ROW}, {_ROW}, {_TABLE})"
ASSEMBLE = f"int64({_ROW}, {_ROW}, {_ROW}, {_TABLE}, {_ROW})"
IK = f"int64({_TABLE}, {_ROW}, {_TABLE}, {_ROW}, {_ROW}, {_ROW})"
WriteKernel: TypeAlias = Callable[[Array, Array, Array], None]
IkKernel: TypeAlias = Callable[[Array, Array, Array, Array, Array, Array], int]
IkAllKernel: TypeAlias = Callable[[Array, Array, Array], int]
AssembleKernel: TypeAlias = Callable[[Array, Array, Array, Array, Array], int]
AssembliesKernel: TypeAlias = Callable[[Array, Array, Array], int]

# Directions of the tip in base axes, in the order of every task mask.
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
# A pose counts as reached within this distance [m] and angle [rad].
REACHED = 1e-9
# Largest disagreement of redundant joint readings by encoder errors and backlash [m].
AGREED = 1e-4
# Largest number of joint vectors of one pose: 64 for the three-fingered hand, with four branches of each finger.
MAX_BRANCHES = 64
# Largest number of poses of one joint vector: a platform on six legs has 40 (Dietmaier 1998).
MAX_ASSEMBLIES = 64
# Numbers of starts of a search. For leg sets that have an assembly, at least a quarter of the starts find one.
SEARCH = 64  # to find an assembly if the loops do not close in the assembly of the seed
SEARCH_ALL = 384  # to find all assemblies


class IkStatus(IntEnum):
    """How well inverse kinematics reached the wanted pose."""

    FOLLOWED = 0  # the joint vector reaches the pose
    LIMITED = 1  # a joint or speed limit prevents the tip from reaching the pose
    NEAR_SINGULAR = 2  # the pose is reached, but small moves need large joint moves here
    UNREACHABLE = 3  # no joint vector reaches the position; the nearest joint vector is returned


_FOLLOWED = int(IkStatus.FOLLOWED)


class FkStatus(IntEnum):
    """Whether forward kinematics found a pose with which the loops of a robot close."""

    CLOSED = 0  # the loops close in the seed's assembly, so they also close along the straight path from the seed
    NEAR_SINGULAR = 1  # as CLOSED, but near a singularity, where the joints hardly determine the tip's pose
    OTHER_MODE = 2  # the loops close only in another assembly; of those found, the nearest to the seed is returned
    NOT_CLOSED = 3  # no assembly was found; the pose of least error next to the seed is returned
    UNDETERMINED = 4  # with this geometry, joints never determine a pose; the seed is returned


_OTHER_MODE = int(FkStatus.OTHER_MODE)

Status = TypeVar("Status")
Number = TypeVar("Number")
Sign = TypeVar("Sign")


class FkResult(NamedTuple, Generic[Status, Number, Sign]):
    """Result of forward kinematics for one joint vector; for N of them each entry has a leading axis."""

    T: Array
    """``T_base_tip`` (4, 4) or (N, 4, 4), always finite; ``status`` contains whether the loops are closed."""
    status: Status
    """:class:`FkStatus` of one q; for N an integer array (N,) of its values."""
    residual: Number
    """Largest error of loop closure [m], a float or (N,); exactly 0 for a robot without loops."""
    mode: Sign
    """Side of the singular poses: 1 the side of home, -1 the other side, 0 without loops; an array (N,) for N.

    Every path between two poses of different sign passes a singular pose. Assemblies of the same sign are distinguished
    by their index in :meth:`~teleop_core.robots.robot.Robot.fk_all`.
    """


FkOne: TypeAlias = FkResult[FkStatus, float, int]
FkBatch: TypeAlias = FkResult[NDArray[np.int64], Array, NDArray[np.int64]]


class IkResult(NamedTuple, Generic[Status]):
    """Result of inverse kinematics for one pose; for N poses each entry has a leading axis."""

    q: Array
    """Joint vector (n,) or (N, n) [rad, m], always finite and inside the limits."""
    status: Status
    """:class:`IkStatus` of one pose; for N an integer array (N,) of its values."""
    residual: Array
    """Distance [m] and angle [rad], (2,) or (N, 2), between the pose of ``q`` and the wanted pose.

    For robots with loops, the pose of ``q`` is the one next to home, as in a tick: ``Kernels.fk``.
    """


IkOne: TypeAlias = IkResult[IkStatus]
IkBatch: TypeAlias = IkResult[NDArray[np.int64]]


@dataclass(frozen=True, kw_only=True)
class Kernels:
    """Functions of one robot, which take its ``geometry`` row; they are kernels or, slower, plain Python.

    ``fk(q, geometry, T)`` and ``jacobian(q, geometry, J)`` write their last argument.
    ``ik(T, seed, limits, geometry, q, residual)`` writes ``q`` and ``residual`` and returns an :class:`IkStatus`; the
    rows of ``limits`` (3, n) are lower limit, upper limit, and largest step from the seed. With infinite steps it finds
    the branch inside the limits that is nearest to the seed. With finite steps, in a path, it never changes the branch.
    For a T that is not rigid or a seed that is not finite, it writes nothing and returns -1 (:func:`is_askable`).
    ``ik_all(T, geometry, solutions)`` fills rows of ``solutions`` (:data:`MAX_BRANCHES`, n), ignores limits, and
    returns the number of solutions.

    Robots with loops have two more kernels. ``assemble(q, geometry, ask, T, out)`` writes the pose T, and ``out`` (2,):
    residual and mode of :class:`FkResult`; it returns an :class:`FkStatus`. ``ask[0]`` is the number of starts of a
    search if the assembly next to the seed does not close; 0 means no search. ``ask[1]`` is 1 if T contains the seed,
    and 0 if home is the seed. With home as the seed, T is the pose of ``fk``, unless the loops do not close there and
    the search finds another pose. ``assemblies(q, geometry, found)`` fills ``found`` (:data:`MAX_ASSEMBLIES`, 4, 4)
    with all poses that it finds, and returns their number. ``fk`` itself never searches, so that it takes microseconds
    in a tick. It never fails: if the loops do not close in the assembly of home, it writes the pose of least error.

    Shapes: ``q`` and ``seed`` (n,), ``T`` (4, 4), ``J`` (6, n), ``residual`` (2,), all float64 in C order and
    writable, because numba would compile a second version for read-only arrays.
    """

    fk: WriteKernel
    jacobian: WriteKernel
    ik: IkKernel
    ik_all: IkAllKernel
    assemble: AssembleKernel | None = None
    assemblies: AssembliesKernel | None = None


@inner
def is_askable(T: Array, seed: Array) -> bool:
    """Whether T is a rigid transform and the seed is finite; every ik kernel checks this first."""
    for i in range(seed.shape[0]):
        if not math.isfinite(seed[i]):
            return False
    return bool(is_rigid(T))


@inner
def pose_residual(reached: Array, wanted: Array, residual: Array) -> bool:
    """Write distance [m] and angle [rad] between two transforms; return whether both are negligible."""
    square = 0.0
    for i in range(3):
        square += (reached[i, 3] - wanted[i, 3]) ** 2
    residual[0] = math.sqrt(square)
    residual[1] = rotation_angle_between(reached, wanted)
    return residual[0] <= REACHED and residual[1] <= REACHED


def is_ready(value: object, shape: tuple[int, ...]) -> TypeGuard[Array]:
    """Whether a kernel can take the value without conversion; kernels themselves check that it is finite."""
    return type(value) is np.ndarray and value.shape == shape and value.dtype is _FLOAT64 and value.flags.carray


@kernel
def fk_batch(fk: WriteKernel, q: Array, geometry: Array, transforms: Array) -> None:
    """Write transforms (N, 4, 4) of joint vectors (N, n)."""
    for i in range(q.shape[0]):
        fk(q[i], geometry, transforms[i])


@kernel
def assemble_batch(
    assemble: AssembleKernel,
    q: Array,
    geometry: Array,
    ask: Array,
    is_path: bool,
    transforms: Array,
    numbers: Array,
    statuses: NDArray[np.int64],
) -> None:
    """Write transforms (N, 4, 4), residuals and modes (N, 2), statuses (N,) of joints (N, n).

    The seed of each pose is the content of ``transforms`` at its index, or home; ``ask[1]`` selects one of these. In a
    path, the seed of every later pose is the last earlier pose in the assembly of the path.
    """
    seed = np.empty((4, 4))
    for i in range(q.shape[0]):
        if is_path:
            if i == 0 or statuses[i - 1] < _OTHER_MODE:
                seed[:] = transforms[max(i - 1, 0)]
            transforms[i] = seed
        statuses[i] = assemble(q[i], geometry, ask, transforms[i], numbers[i])


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
    """Solve poses (N, 4, 4), each from its seed (N, n) or all from one seed (1, n); or as a path from one seed."""
    for i in range(transforms.shape[0]):
        seed = seeds[i] if seeds.shape[0] > 1 else seeds[0]
        if is_path and i > 0:
            seed = q[i - 1]
        statuses[i] = ik(transforms[i], seed, limits, geometry, q[i], residuals[i])
        if statuses[i] < 0:
            return


@kernel
def ik_fans(
    ik: IkKernel,
    transforms: Array,
    seeds: Array,
    limits: Array,
    geometry: Array,
    q: Array,
    is_followed: NDArray[np.bool_],
) -> None:
    """Solve fans of poses (N, k, 4, 4) from seeds (N, k, n), and tell of each fan whether all its poses are followed.

    A fan ends at its first pose that is not: the search for a pose out of reach takes the longest. Joints of the
    rest of such a fan are left as they are.
    """
    residual = np.empty(2)
    for i in range(transforms.shape[0]):
        is_followed[i] = True
        for k in range(transforms.shape[1]):
            status = ik(transforms[i, k], seeds[i, k], limits, geometry, q[i, k], residual)
            if status < 0:
                return
            if status != _FOLLOWED:
                is_followed[i] = False
                break
