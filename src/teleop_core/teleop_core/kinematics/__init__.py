"""Kinematics of a robot as compiled functions, what they answer, and batches of them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Generic, NamedTuple, TypeAlias, TypeGuard, TypeVar

import numpy as np
from numba import types
from numpy.typing import NDArray

from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array, is_rigid, rotation_angle_between

_FLOAT64 = np.dtype(np.float64)  # one object; another of its kind is copied
_ROW, _TABLE = types.float64[::1], types.float64[:, ::1]
# Signatures that let one compiled graph run any robot: see Kernels for the arguments.
FK = types.void(_ROW, _ROW, _TABLE)
ASSEMBLE = types.int64(_ROW, _ROW, _ROW, _TABLE, _ROW)
IK = types.int64(_TABLE, _ROW, _TABLE, _ROW, _ROW, _ROW)
WriteKernel: TypeAlias = Callable[[Array, Array, Array], None]
IkKernel: TypeAlias = Callable[[Array, Array, Array, Array, Array, Array], int]
IkAllKernel: TypeAlias = Callable[[Array, Array, Array], int]
AssembleKernel: TypeAlias = Callable[[Array, Array, Array, Array, Array], int]
AssembliesKernel: TypeAlias = Callable[[Array, Array, Array], int]

# Directions of the tip in base axes, in the order of every task mask.
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
# A pose counts as reached within this distance [m] and angle [rad].
REACHED = 1e-9
# Joints that say more than the pose may contradict each other by so much [m]: encoders, play.
AGREED = 1e-4
# Most joint vectors that one pose can have: the three-fingered hand, four for each finger.
MAX_BRANCHES = 64
# Most poses that one joint vector can have: a platform on six legs has 40 (Dietmaier 1998).
MAX_ASSEMBLIES = 64
# Starts of the search for an assembly where the one next to the seed does not close, and of the search for all of them.
# Of the leg sets that have an assembly, a quarter of the starts and more end in one.
SEARCH, SEARCH_ALL = 64, 384


class IkStatus(IntEnum):
    """How well inverse kinematics could do what was asked."""

    FOLLOWED = 0  # the joint vector reaches the pose
    LIMITED = 1  # a joint or speed limit keeps the tip off the pose
    NEAR_SINGULAR = 2  # the pose is reached, but small moves need large joint moves here
    UNREACHABLE = 3  # no joint vector reaches the position; the nearest one is returned


class FkStatus(IntEnum):
    """Whether forward kinematics found a pose with which the loops of a robot close."""

    CLOSED = 0  # the loops close, in the seed's assembly: they do on the straight way from there
    NEAR_SINGULAR = 1  # they do, but the joints hardly fix the tip here, and assemblies meet
    OTHER_MODE = 2  # they close, but in another assembly: the nearest to the seed that was found
    NOT_CLOSED = 3  # no assembly was found; the pose of least error next to the seed is returned
    UNDETERMINED = 4  # joints of this layout never fix a pose; the seed is returned


_OTHER_MODE = int(FkStatus.OTHER_MODE)

Status = TypeVar("Status")
Number = TypeVar("Number")
Sign = TypeVar("Sign")


class FkResult(NamedTuple, Generic[Status, Number, Sign]):
    """Answer of forward kinematics: for one q, or for N with a leading axis in each entry."""

    T: Array
    """``T_base_tip`` (4, 4) or (N, 4, 4), always finite; closed loops only where status says so."""
    status: Status
    """:class:`FkStatus` of one q; for N an integer array (N,) of its values."""
    residual: Number
    """Largest error of loop closure [m], a float or (N,); exactly 0 for a robot without loops."""
    mode: Sign
    """Side of the singular poses: 1 as at home, -1 the other, 0 without loops; for N (N,).

    Between two poses of different sign every path meets a singular pose. Assemblies of one sign
    are told apart by their place in :meth:`~teleop_core.robots.robot.Robot.fk_all`.
    """


FkOne: TypeAlias = FkResult[FkStatus, float, int]
FkBatch: TypeAlias = FkResult[NDArray[np.int64], Array, NDArray[np.int64]]


class IkResult(NamedTuple, Generic[Status]):
    """Answer of inverse kinematics: for one pose, or for N with a leading axis in each entry."""

    q: Array
    """Joint vector (n,) or (N, n) [rad, m], always finite and inside the limits."""
    status: Status
    """:class:`IkStatus` of one pose; for N an integer array (N,) of its values."""
    residual: Array
    """Distance [m] and angle [rad], (2,) or (N, 2), between the pose of ``q`` and the wanted.

    Of robots with loops it is the pose next to home, as in a tick: ``Kernels.fk``.
    """


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

    Robots with loops have two more. ``assemble(q, geometry, ask, T, out)`` writes the pose T, and ``out`` (2,):
    residual and mode of :class:`FkResult`; it returns an :class:`FkStatus`. ``ask`` (2,) is how many starts a search
    may take where the assembly next to the seed does not close, 0 for none, and 1 if T holds the seed, 0 if home is
    meant: then T is what ``fk`` writes, unless that does not close and the search finds another. ``assemblies(q,
    geometry, found)`` fills ``found`` (:data:`MAX_ASSEMBLIES`, 4, 4) with all poses it finds and returns how many.
    ``fk`` itself never searches, so that it takes microseconds in a tick, and never fails: where nothing closes next to
    home it writes the pose of least error.

    Shapes: ``q`` and ``seed`` (n,), ``T`` (4, 4), ``J`` (6, n), ``residual`` (2,), all float64 in
    C order and writable: for read-only arrays numba would compile a second time.
    """

    fk: WriteKernel
    jacobian: WriteKernel
    ik: IkKernel
    ik_all: IkAllKernel
    assemble: AssembleKernel | None = None
    assemblies: AssembliesKernel | None = None


@inner
def is_askable(T: Array, seed: Array) -> bool:
    """Whether T is a rigid transform and the seed finite; every ik kernel checks that first."""
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

    Each from the seed that stands in its place, or from home, as ``ask`` says; in a path all but
    the first from the last before it in the assembly of the path.
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
    """Solve (N, 4, 4): from seeds (N, n), from one seed (1, n), or as a path from that seed."""
    for i in range(transforms.shape[0]):
        seed = seeds[i] if seeds.shape[0] > 1 else seeds[0]
        if is_path and i > 0:
            seed = q[i - 1]
        statuses[i] = ik(transforms[i], seed, limits, geometry, q[i], residuals[i])
        if statuses[i] < 0:
            return
