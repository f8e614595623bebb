"""Closed forms of chains: the steps that all of them share, from the wanted pose to the status.

A closed form describes the arm as G = Rz(q1) F1 Rz(q2) F2 ... Rz(qn), with constant transforms between the joints and
every joint about its own z axis. An arm that decomposes from the tip is described from tip to base. The constants of
the closed form follow those of the chain in the geometry row (:mod:`teleop_core.kinematics.dh_kernels`): 1 or -1 for
the order, n signs, n groups, then transforms of twelve numbers each: before and after G, and those between the joints.
Then come the additional numbers of the class of arms. The last number is 1 for an arm that fits its class only
approximately (:mod:`teleop_core.kinematics.closed_form.decomposition`).

Branches are candidates: joint vectors in the arm's own order, followed by one number. This number is 1.0 if the branch
reaches the pose, and 0.0 if the branch only comes nearest. It is :data:`UNKNOWN` if the branch cannot be the answer and
was not computed. The best branch is clipped to limits and steps. If it then misses the pose, damped least squares on
the whole chain reduce the remaining error.
"""

import math

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room
from teleop_core.kinematics import IkStatus, damped, dh_kernels, pose_residual
from teleop_core.kinematics.branches import OUTSIDE, SLACK, cost_of, is_allowed, slowed, turn, turned, wrapped

_ROUNDS = 60  # largest number of rounds of a search from a branch outside the limits
_PATH_ROUNDS = 12  # largest number of rounds of such a search in a path
_FEW_ROUNDS = 8  # largest number of rounds of the search next to the seed
_GROUPS = 3
# Lever [m] that converts an angular lag of the tip to a distance. It is the length of a tool, not the reach: with a
# reach of 4 m as the lever, a lag of 5 mm would count little more than a lag of 1 mrad.
_LEVER = 0.1
UNKNOWN = -1.0
"""Last entry of a candidate that was not computed."""
BESIDE_SEED = 0.3
"""Largest move [rad] up to which the posture next to the seed is the answer."""
INEXACT = 1e4  # added to the cost of a branch that does not reach the pose, so that it comes last
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@inner
def constants_at(n: int) -> int:
    """Index of a closed form's constants in a geometry row of n joints."""
    return n + 7 + 12 * (n + 1)


@inner
def _placed(K: Array, at: int, T: Array, out: Array) -> None:
    """Write the constant transform at index ``at`` times T, (4, 4)."""
    for i in range(3):
        for j in range(4):
            k = at + 4 * i
            value = K[k] * T[0, j] + K[k + 1] * T[1, j] + K[k + 2] * T[2, j]
            out[i, j] = value + (K[k + 3] if j == 3 else 0.0)


@inner
def wanted_motion(T: Array, K: Array, n: int, work: Array, G: Array) -> None:
    """Write G (4, 4), the part of ``T_base_tip`` that the joints must produce; ``work`` (4, 4) is scratch memory."""
    at = 2 * n + 1
    if K[0] > 0.0:
        _placed(K, at, T, work)
    else:
        for i in range(3):
            G[i, 3] = 0.0
            for j in range(3):
                G[i, j] = T[j, i]
                G[i, 3] -= T[j, i] * T[j, 3]
        _placed(K, at, G, work)
    at += 12
    for i in range(3):
        x, y, z = work[i, 0], work[i, 1], work[i, 2]
        for j in range(4):
            value = x * K[at + j] + y * K[at + 4 + j] + z * K[at + 8 + j]
            G[i, j] = value + (work[i, 3] if j == 3 else 0.0)


@inner
def undo_turn(c: float, s: float, M: Array, columns: int) -> None:
    """Replace M by Rz(q)ᵀ M; ``c`` and ``s`` are cosine and sine of q."""
    for j in range(columns):
        x, y = M[0, j], M[1, j]
        M[0, j], M[1, j] = c * x + s * y, c * y - s * x


@inner
def undo_between(K: Array, at: int, M: Array, out: Array, columns: int) -> None:
    """Write F⁻¹ M, where F is the constant transform at index ``at``."""
    for j in range(columns):
        x, y, z = M[0, j], M[1, j], M[2, j]
        if j == 3:
            x, y, z = x - K[at + 3], y - K[at + 7], z - K[at + 11]
        for i in range(3):
            out[i, j] = K[at + i] * x + K[at + 4 + i] * y + K[at + 8 + i] * z


@inner
def joint_of(K: Array, n: int, i: int) -> int:
    """Number of the arm's joint that is joint i of the closed form."""
    return i if K[0] > 0.0 else n - 1 - i


@inner
def angle_of(K: Array, n: int, i: int, q: Array) -> float:
    """Angle [rad] of joint i of the closed form at a joint vector of the arm."""
    return K[1 + i] * q[joint_of(K, n, i)]


@inner
def set_angle(K: Array, n: int, i: int, angle: float, q: Array) -> None:
    """Write the angle of joint i of the closed form into a joint vector of the arm."""
    q[joint_of(K, n, i)] = K[1 + i] * angle


@inner
def _group_cost(q: Array, K: Array, seed: Array, limits: Array, group: int, do_limits_count: bool) -> float:
    """:func:`cost_of` the joints of one group."""
    worst = 0.0
    for i in range(seed.shape[0]):
        if int(K[1 + seed.shape[0] + i]) == group:
            worst = max(worst, cost_of(q, seed, limits, i, i + 1, do_limits_count))
    return worst


@inner
def angle_cost(K: Array, n: int, i: int, angle: float, seed: Array, limits: Array, do_limits_count: bool) -> float:
    """:func:`cost_of` joint i of the closed form at an angle, by whole turns next to the seed.

    Every branch with this angle costs at least this much.
    """
    j = joint_of(K, n, i)
    q = turned(K[1 + i] * angle, seed[j], limits[0, j], limits[1, j], math.isfinite(limits[2, 0]))
    cost = abs(q - seed[j])
    if do_limits_count and (q < limits[0, j] - SLACK or q > limits[1, j] + SLACK):
        cost += OUTSIDE
    return cost


@inner
def branch_cost(q: Array, seed: Array, limits: Array) -> float:
    """Cost of a branch with free steps: the largest move; branches outside the limits come last."""
    n = seed.shape[0]
    turn(q, seed, limits, 0, n)
    return cost_of(q, seed, limits, 0, n, True) + (0.0 if q[n] > 0.5 else INEXACT)


@inner
def _is_better(q: Array, best: Array, K: Array, seed: Array, limits: Array, do_limits_count: bool) -> bool:
    """Whether branch ``q`` is better than ``best`` in a path; the first group of joints whose costs differ decides."""
    for group in range(1, _GROUPS + 1):
        ours = _group_cost(q, K, seed, limits, group, do_limits_count and group > 1)
        theirs = _group_cost(best, K, seed, limits, group, do_limits_count and group > 1)
        if ours != theirs:
            return ours < theirs
    return False


@inner
def choose(
    found: Array, count: int, seed: Array, limits: Array, K: Array, is_beside: bool, q: Array
) -> tuple[int, int]:
    """Write the best of the candidates (count, n + 1), each shifted by whole turns to the seed.

    The best candidate is the one whose largest joint move is smallest; candidates outside the limits come last. In a
    path limits do not count, and groups of joints are compared in order. Joints that determine the branch come before
    joints that move far near a singularity. If two branches are neighbours, limits count after the first group.

    Returns:
        2 if the best candidate reaches the pose, 1 if only another candidate does, 0 if none does; and the index of
        the best.
    """
    n, is_path, best, least, is_exact = q.shape[0], math.isfinite(limits[2, 0]), -1, math.inf, False
    for k in range(count):
        trial = found[k]
        if trial[n] == UNKNOWN:
            continue
        is_exact = is_exact or trial[n] > 0.5
        if is_path:
            turn(trial, seed, limits, 0, n)
            if best < 0 or _is_better(trial, found[best], K, seed, limits, is_beside):
                best = k
            continue
        cost = branch_cost(trial, seed, limits)
        if cost < least:
            best, least = k, cost
    if best < 0:  # the numbers have overflowed
        damped.assign(q, seed)
        return 0, best
    for i in range(n):
        q[i] = found[best, i]
    return 2 if found[best, n] > 0.5 else (1 if is_exact else 0), best


@inner
def box_around(seed: Array, limits: Array, box: Array) -> None:
    """Write the lower and upper joint bounds (2, n) that limits and steps allow around a seed."""
    for i in range(seed.shape[0]):
        near = min(max(seed[i], limits[0, i]), limits[1, i])
        box[0, i] = max(limits[0, i], near - limits[2, i])
        box[1, i] = min(limits[1, i], near + limits[2, i])


@inner
def is_nearly(geometry: Array) -> bool:
    """Whether an arm fits its class only approximately."""
    return bool(geometry[geometry.shape[0] - 1] != 0.0)


@inner
def is_beside(T: Array, seed: Array, limits: Array, geometry: Array, q: Array) -> bool:
    """Whether an arm that fits its class approximately reaches the pose next to the seed; if so, write ``q``.

    Near a stretched elbow, or near a limit, the seed's branch may not exist for an arm that fits its class exactly.
    """
    if not is_nearly(geometry) or math.isfinite(limits[2, 0]):
        return False
    return _does_descend(T, seed, limits, geometry, q)


@kernel
def _does_descend(T: Array, seed: Array, limits: Array, geometry: Array, q: Array) -> bool:
    n, box = q.shape[0], np.empty((2, q.shape[0]))
    box_around(seed, limits, box)
    for i in range(n):
        q[i] = min(max(seed[i], box[0, i]), box[1, i])
    return dh_kernels.descend(T, box, geometry, _FEW_ROUNDS, q) <= damped.ZERO and move_of(q, seed) < BESIDE_SEED


@inner
def move_of(q: Array, seed: Array) -> float:
    """Largest move of a joint from the seed [rad]."""
    most = 0.0
    for i in range(seed.shape[0]):
        most = max(most, abs(q[i] - seed[i]))
    return most


@kernel
def _best_of_rest(T: Array, seed: Array, limits: Array, geometry: Array, found: Array, count: int, q: Array) -> None:
    """Replace ``q`` by the joints within limits that come nearest to the pose.

    The search starts from the branch itself, from the seed and from all other branches; the smallest error is taken.
    """
    n, box, trial, least = q.shape[0], np.empty((2, q.shape[0])), np.empty(q.shape[0]), math.inf
    box_around(seed, limits, box)
    for k in range(-2, count):
        if k >= 0 and found[k, n] == UNKNOWN:
            continue
        for i in range(n):
            start = found[k, i] if k >= 0 else (seed[i] if k == -1 else q[i])
            trial[i] = min(max(start, box[0, i]), box[1, i])
        error = dh_kernels.descend_long(T, box, geometry, trial)
        if error < least:
            least = error
            damped.assign(q, trial)
        if error <= damped.ZERO:
            break


@kernel
def _best_of_step(T: Array, seed: Array, limits: Array, geometry: Array, does_reach: bool, q: Array) -> None:
    """Replace ``q`` by the joints within limits and step that come nearest to the pose.

    The search starts from the branch. If the branch reaches the pose, joints that cannot reach it in one step move at
    full speed. The other joints either reduce the remaining error, or move proportionally slower on the straight path.
    Of these two results the one with the smaller lag is taken.
    """
    n, box, trial = q.shape[0], np.empty((2, q.shape[0])), np.empty(q.shape[0])
    box_around(seed, limits, box)
    for i in range(n):
        does_reach = does_reach and limits[0, i] <= q[i] <= limits[1, i]
    for i in range(n):
        trial[i] = min(max(q[i], box[0, i]), box[1, i])
        if does_reach and trial[i] != q[i]:
            box[0, i] = box[1, i] = trial[i]
    if dh_kernels.descend(T, box, geometry, _PATH_ROUNDS, trial) > damped.ZERO and does_reach:
        slowed(q, seed, limits, q)
        if _lag(q, T, geometry) < _lag(trial, T, geometry):
            return
    damped.assign(q, trial)


@inner
def _lag(q: Array, T: Array, geometry: Array) -> float:
    """Squared error of a pose; a distance counts as a rotation on the lever :data:`_LEVER`."""
    reached, error = room(4, 4), room(6)
    dh_kernels.fk(q, geometry, reached)
    return damped.pose_error(reached, T, _LEVER, error)


@kernel
def settled(
    T: Array,
    seed: Array,
    limits: Array,
    geometry: Array,
    reach: int,
    found: Array,
    count: int,
    q: Array,
    residual: Array,
) -> int:
    """Clip a branch to limits and steps, write the residual (2,) and return the status.

    If the branch then misses the pose, damped least squares bring it as near as limits and steps allow. ``reach`` is
    the first result of :func:`choose`.
    """
    reached, J = room(4, 4), room(6, 7)
    if is_allowed(q, seed, limits):
        is_flat = dh_kernels.pose_of_chain(q, geometry, J, reached)
        if pose_residual(reached, T, residual):
            return _NEAR_SINGULAR if is_flat else _FOLLOWED
    if math.isfinite(limits[2, 0]):
        _best_of_step(T, seed, limits, geometry, reach == 2, q)
    else:
        _best_of_rest(T, seed, limits, geometry, found, count, q)
    return told(T, geometry, reach, q, residual)


@kernel
def told(T: Array, geometry: Array, reach: int, q: Array, residual: Array) -> int:
    """Write the residual (2,) of joints within limits and steps, and return their status."""
    reached, J = room(4, 4), room(6, 7)
    is_flat = dh_kernels.pose_of_chain(q, geometry, J, reached)
    if not pose_residual(reached, T, residual):
        return _LIMITED if reach > 0 else _UNREACHABLE
    return _NEAR_SINGULAR if is_flat else _FOLLOWED


@inner
def forget(seed: Array, limits: Array) -> None:
    """Write seed and limits for :func:`kept`: zero seed, infinite limits, zero steps, so that no branch is turned."""
    for i in range(seed.shape[0]):
        seed[i] = limits[2, i] = 0.0
        limits[0, i], limits[1, i] = -math.inf, math.inf


@kernel
def kept(T: Array, found: Array, count: int, geometry: Array, solutions: Array) -> int:
    """Write the candidates (count, n + 1) that reach the pose into ``solutions``; return their number.

    Angles are within ±pi. A class is recognised with a tolerance; a search removes the error that results.
    """
    n, number = solutions.shape[1], 0
    box, reached, residual = np.empty((2, n)), np.empty((4, 4)), np.empty(2)
    for k in range(count):
        if found[k, n] < 0.5:
            continue
        q = solutions[number]
        for i in range(n):
            q[i] = wrapped(found[k, i])
            box[0, i], box[1, i] = q[i] - 1.0, q[i] + 1.0
        dh_kernels.fk(q, geometry, reached)
        if not pose_residual(reached, T, residual):
            dh_kernels.descend(T, box, geometry, _ROUNDS, q)
            for i in range(n):
                q[i] = wrapped(q[i])
        number += 1
    return number
