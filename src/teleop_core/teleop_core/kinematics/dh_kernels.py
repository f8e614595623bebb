"""Kinematics of a Denavit-Hartenberg chain: kernels over constant transforms between its joints.

Every convention can be written as T = F0 J1(q1) F1 J2(q2) F2 ..., where Ji is a rotation about or a slide along the
local z axis and Fi is constant. The geometry row contains, for n joints: n kinds (1 for a rotation, 2 for a slide,
negative if against the axis); the reach [m]; six weights of the controlled directions (1 or 0); and n + 1 transforms of
twelve numbers, row by row.

In a chain of m motions some motions may follow others (:mod:`teleop_core.robots.dynamics.followers`). The row then
contains other numbers in place of the transforms: m + 1; the joints that the motions follow, the factors and the
offsets of the motions; and the row of the m motions. The number m + 1 marks such a chain, because the first number of a
transform is an entry of a rotation and cannot have this value.
"""

import math

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room
from teleop_core.kinematics import REACHED, IkStatus, is_askable, pose_residual
from teleop_core.kinematics.damped import ZERO, damped_move, free_joints, pose_error

_ROUNDS = 60  # largest number of rounds of one search
_PATH_ROUNDS = 12  # largest number of rounds of one search in a path
_DAMPING = 1e-2  # initial damping, divided by the squared error
_HOPELESS = 1e10  # a search stops when its damping, divided by the squared error, exceeds this value
_STARTS = 24  # number of other starts if the search from the seed fails
_MOST_STARTS = 120  # number of other starts if none of the first ones succeeds
_CLOSE = 1e-8  # a squared error below this value may be in a flat valley, where the descent needs more rounds
_LONG_ROUNDS = 1000  # largest number of these additional rounds
_ALL_STARTS = 200  # number of searches for all branches
_SAME = 1e-6  # joint vectors with a smaller distance count as equal [rad, m]
_NEAR = 0.02  # with a smaller pivot, small moves of the tip need large joint moves
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@inner
def append_fixed(geometry: Array, n: int, index: int, T: Array) -> None:
    """Replace T by T times the constant transform of number ``index``."""
    at = n + 7 + 12 * index
    for i in range(3):
        a, b, c = T[i, 0], T[i, 1], T[i, 2]
        for j in range(4):
            T[i, j] = (
                a * geometry[at + j]
                + b * geometry[at + 4 + j]
                + c * geometry[at + 8 + j]
                + (T[i, 3] if j == 3 else 0.0)
            )


@inner
def move_joint(kind: float, q: float, T: Array) -> None:
    """Replace T by T times the turn or slide of one joint."""
    if abs(kind) > 1.5:
        for i in range(3):
            T[i, 3] += 0.5 * kind * q * T[i, 2]
        return
    c, s = math.cos(q), kind * math.sin(q)
    for i in range(3):
        x, y = T[i, 0], T[i, 1]
        T[i, 0], T[i, 1] = c * x + s * y, c * y - s * x


@inner
def spread(q: Array, followers: Array, motions: Array) -> None:
    """Write the motions (m,) of joints (n,); ``followers`` begins with joints, factors, offsets."""
    m = motions.shape[0]
    for i in range(m):
        motions[i] = followers[m + i] * q[int(followers[i])] + followers[2 * m + i]


@inner
def _motions(n: int, geometry: Array) -> int:
    """Number of motions of a chain with followers; 0 or less for a chain without followers."""
    return int(geometry[n + 7]) - 1


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip``, (4, 4), of joints (n,)."""
    if _motions(q.shape[0], geometry) > 0:
        _fk_with_followers(q, geometry, T)
    else:
        _chain_fk(q, geometry, T)


@kernel
def _fk_with_followers(q: Array, geometry: Array, T: Array) -> None:
    at, m = q.shape[0] + 8, _motions(q.shape[0], geometry)
    motions = np.empty(m)
    spread(q, geometry[at:], motions)
    _chain_fk(motions, geometry[at + 3 * m :], T)


@inner
def _chain_fk(q: Array, geometry: Array, T: Array) -> None:
    n = q.shape[0]
    for i in range(4):
        for j in range(4):
            T[i, j] = 1.0 if i == j else 0.0
    append_fixed(geometry, n, 0, T)
    for i in range(n):
        move_joint(geometry[i], q[i], T)
        append_fixed(geometry, n, i + 1, T)


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the geometric Jacobian (6, n): rows linear, then angular, in base axes."""
    if _motions(q.shape[0], geometry) > 0:
        _jacobian_with_followers(q, geometry, J)
    else:
        _chain_jacobian(q, geometry, room(4, 4), J)


@kernel
def _jacobian_with_followers(q: Array, geometry: Array, J: Array) -> None:
    at, m = q.shape[0] + 8, _motions(q.shape[0], geometry)
    motions, whole = np.empty(m), np.empty((6, m))
    spread(q, geometry[at:], motions)
    _chain_jacobian(motions, geometry[at + 3 * m :], room(4, 4), whole)
    for r in range(6):
        for j in range(q.shape[0]):
            J[r, j] = 0.0
        for i in range(m):
            J[r, int(geometry[at + i])] += geometry[at + m + i] * whole[r, i]


@inner
def _chain_jacobian(q: Array, geometry: Array, T: Array, J: Array) -> None:
    n = q.shape[0]
    for i in range(4):
        for j in range(4):
            T[i, j] = 1.0 if i == j else 0.0
    append_fixed(geometry, n, 0, T)
    for j in range(n):
        # Until the tip is known, the angular rows contain the axis, and the linear rows contain a point on the axis.
        sign = 1.0 if geometry[j] > 0.0 else -1.0
        for i in range(3):
            J[i, j], J[3 + i, j] = T[i, 3], sign * T[i, 2]
        move_joint(geometry[j], q[j], T)
        append_fixed(geometry, n, j + 1, T)
    for j in range(n):
        x, y, z = T[0, 3] - J[0, j], T[1, 3] - J[1, j], T[2, 3] - J[2, j]
        a, b, c = J[3, j], J[4, j], J[5, j]
        if abs(geometry[j]) > 1.5:
            J[0, j], J[1, j], J[2, j] = a, b, c
            J[3, j] = J[4, j] = J[5, j] = 0.0
        else:
            J[0, j], J[1, j], J[2, j] = b * z - c * y, c * x - a * z, a * y - b * x


@inner
def _masked_error(reached: Array, T: Array, geometry: Array, n: int, error: Array) -> float:
    """Write the weighted error (6,) in the controlled directions; return its squared norm."""
    pose_error(reached, T, geometry[n], error)
    square = 0.0
    for r in range(6):
        error[r] *= geometry[n + 1 + r]
        square += error[r] * error[r]
    return square


@inner
def _weighted_jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the Jacobian (6, n) with linear rows divided by the reach and uncontrolled rows zero."""
    jacobian(q, geometry, J)
    _weigh(q.shape[0], geometry, J)


@inner
def _weigh(n: int, geometry: Array, J: Array) -> None:
    """Divide the linear rows of a Jacobian (6, n) by the reach, and set uncontrolled rows to zero."""
    for r in range(6):
        weight = geometry[n + 1 + r] / (geometry[n] if r < 3 else 1.0)
        for j in range(n):
            J[r, j] *= weight


@inner
def descend(T: Array, box: Array, geometry: Array, rounds: int, q: Array) -> float:
    """Reduce the error from ``q`` (n,), inside a box (2, n), until it is zero or minimal.

    Returns:
        Remaining squared weighted error.
    """
    n = q.shape[0]
    J, reached, error, left = np.empty((6, n)), room(4, 4), room(6), room(6)
    is_free, trial = np.empty(n), np.empty(n)
    fk(q, geometry, reached)
    square, damping, is_new = _masked_error(reached, T, geometry, n, error), _DAMPING, True
    for _ in range(rounds):
        if square <= ZERO or damping > _HOPELESS:
            break
        if is_new:
            _weighted_jacobian(q, geometry, J)
            if free_joints(J, error, q, box, is_free) <= 1e-9 * math.sqrt(square):
                break
        damped_move(J, error, damping * square, is_free, box, q, trial)
        fk(trial, geometry, reached)
        after = _masked_error(reached, T, geometry, n, left)
        is_new = after < square
        damping = max(0.2 * damping, 1e-6) if is_new else 10.0 * damping
        if is_new:
            square = after
            for r in range(6):
                error[r] = left[r]
            for i in range(n):
                q[i] = trial[i]
    return square


@kernel
def descend_long(T: Array, box: Array, geometry: Array, q: Array) -> float:
    """Call :func:`descend`, and again with more rounds if the result is close to the pose.

    This happens near singular postures, where the error has a flat and curved valley.
    """
    square = descend(T, box, geometry, _ROUNDS, q)
    if ZERO < square < _CLOSE:
        square = descend(T, box, geometry, _LONG_ROUNDS, q)
    return square


@kernel
def _start(number: int, box: Array, q: Array) -> None:
    """Write joint vector ``number`` (n,) of a sequence that fills a box (2, n) evenly.

    Source:
        Roberts 2018, the R sequence, built from the powers of the root of x^(n+1) = x + 1.
    """
    n, root = q.shape[0], 2.0
    for _ in range(40):
        root = (1.0 + root) ** (1.0 / (n + 1.0))
    for i in range(n):
        share = (0.5 + number * root ** -(i + 1.0)) % 1.0
        q[i] = box[0, i] + share * (box[1, i] - box[0, i])


@inner
def _distance(a: Array, b: Array) -> float:
    worst = 0.0
    for i in range(a.shape[0]):
        worst = max(worst, abs(a[i] - b[i]))
    return worst


@inner
def _search(T: Array, seed: Array, box: Array, geometry: Array, q: Array) -> None:
    """Search from starts in the whole box; replace ``q`` by the solution nearest to the seed.

    If the first starts find no solution, as often near singular postures and limits, more starts are tried.
    """
    trial, nearest = np.empty(q.shape[0]), math.inf
    for number in range(_MOST_STARTS):
        if number >= _STARTS and nearest < math.inf:
            break
        _start(number, box, trial)
        if descend_long(T, box, geometry, trial) > ZERO:
            continue
        distance = _distance(trial, seed)
        if distance < nearest:
            nearest = distance
            for i in range(q.shape[0]):
                q[i] = trial[i]


@inner
def is_hardly_moving(q: Array, geometry: Array) -> bool:
    """Whether small moves of the tip need large joint moves at ``q`` (n,)."""
    J = np.empty((6, q.shape[0]))
    _weighted_jacobian(q, geometry, J)
    return _is_flat(q.shape[0], geometry, J)


@inner
def pose_of_chain(q: Array, geometry: Array, J: Array, T: Array) -> bool:
    """Write the pose (4, 4) of a chain without followers, and return :func:`is_hardly_moving`.

    It needs one pass along the chain instead of two. ``J`` (6, n) is scratch memory.
    """
    _chain_jacobian(q, geometry, T, J)
    _weigh(q.shape[0], geometry, J)
    return _is_flat(q.shape[0], geometry, J)


@inner
def _is_flat(n: int, geometry: Array, J: Array) -> bool:
    """Whether some controlled direction of a weighted Jacobian (6, n) needs large joint moves.

    The pivots are the squares of the diagonal of the Cholesky factor of J Jᵀ.
    """
    A = room(6, 6)
    for r in range(6):
        for s in range(r, 6):
            value = 0.0
            for i in range(n):
                value += J[r, i] * J[s, i]
            A[r, s] = value
        A[r, r] += 1.0 - geometry[n + 1 + r]
    for k in range(6):
        if A[k, k] < _NEAR * _NEAR:
            return True
        over = 1.0 / A[k, k]
        for i in range(k + 1, 6):
            share = over * A[k, i]
            for j in range(i, 6):
                A[i, j] -= share * A[k, j]
    return False


@inner
def _status(q: Array, T: Array, box: Array, geometry: Array, residual: Array) -> int:
    """Write the residual (2,) and return the status of ``q`` for the wanted pose T."""
    n, reached, error = q.shape[0], np.empty((4, 4)), np.empty(6)
    fk(q, geometry, reached)
    pose_residual(reached, T, residual)
    _masked_error(reached, T, geometry, n, error)
    linear = math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2) * geometry[n]
    angular = math.sqrt(error[3] ** 2 + error[4] ** 2 + error[5] ** 2)
    if linear > REACHED or angular > REACHED:
        for i in range(n):
            if q[i] <= box[0, i] or q[i] >= box[1, i]:
                return _LIMITED
        return _UNREACHABLE
    return _NEAR_SINGULAR if is_hardly_moving(q, geometry) else _FOLLOWED


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (n,) next to ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`.

    With free steps it runs damped least squares from the seed inside the limits and, if that fails, from a fixed set of
    starts. In a path it makes one search inside the step around the seed, so that the branch does not change. A numeric
    search cannot prove that no solution exists. If it finds no solution, the status is LIMITED if a joint is on its
    bound, else UNREACHABLE. Likewise the branch is usually, but not provably, the nearest to the seed.
    """
    if not is_askable(T, seed):
        return -1
    n, is_path = q.shape[0], math.isfinite(limits[2, 0])
    box = np.empty((2, n))
    for i in range(n):
        near = min(max(seed[i], limits[0, i]), limits[1, i])
        box[0, i] = max(limits[0, i], near - limits[2, i])
        box[1, i] = min(limits[1, i], near + limits[2, i])
        q[i] = near
    if is_path:
        descend(T, box, geometry, _PATH_ROUNDS, q)
    elif descend_long(T, box, geometry, q) > ZERO:
        _search(T, seed, box, geometry, q)
    return int(_status(q, T, box, geometry, residual))


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the joint vectors (k, n) that many searches find, ignoring limits; return k.

    Rotations are searched over a full circle, slides over the reach. Solutions that no search finds are missing.
    """
    n, count = solutions.shape[1], 0
    box, trial = np.empty((2, n)), np.empty(n)
    for i in range(n):
        box[1, i] = math.pi if abs(geometry[i]) < 1.5 else geometry[n]
        box[0, i] = -box[1, i]
    for number in range(_ALL_STARTS):
        _start(number, box, trial)
        is_new = descend(T, box, geometry, _ROUNDS, trial) <= ZERO
        for k in range(count):
            is_new = is_new and _distance(trial, solutions[k]) > _SAME
        if is_new and count < solutions.shape[0]:
            for i in range(n):
                solutions[count, i] = trial[i]
            count += 1
    return count
