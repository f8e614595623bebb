"""Closed forms of chains: what all of them share, from the wanted pose to the status.

A closed form sees the arm as G = Rz(q1) F1 Rz(q2) F2 ... Rz(qn), with constant transforms between the joints and every
joint about its own z axis; for arms that decompose from the tip it is the arm from tip to base. Its constants stand
behind the chain's in the geometry row (:mod:`teleop_core.kinematics.dh_kernels`): 1 or -1 for the order, n signs, n
groups, then transforms of twelve numbers each: before and after G, and those between the joints. Behind them stands
what a class of arms has beside, and last 1 for an arm that is of its class only nearly
(:mod:`teleop_core.kinematics.closed_form.decomposition`).

Branches are candidates: joint vectors in the arm's own order, with 1.0 behind those that reach the
pose, 0.0 behind those that come nearest, and :data:`UNKNOWN` behind those that cannot be the answer
and were not computed. The best one is brought into limits and steps; where it then misses the pose,
damped least squares on the whole chain make the best of the rest.
"""

import math

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room
from teleop_core.kinematics import IkStatus, damped, dh_kernels, pose_residual
from teleop_core.kinematics.branches import OUTSIDE, SLACK, cost_of, is_allowed, slowed, turn, turned, wrapped

_ROUNDS, _PATH_ROUNDS = 60, 12  # of the search that makes the best of a branch out of limits
_FEW_ROUNDS = 8  # of the search beside the seed
_GROUPS = 3
# Arm [m] at which a turn of the tip that lags moves what the tip holds: of a tool, whatever the
# reach. Weighed by a reach of 4 m, 5 mm would count no more than 1 mrad.
_LEVER = 0.1
UNKNOWN = -1.0
"""Last entry of a candidate that was not computed."""
BESIDE_SEED = 0.3
"""Largest move [rad] below which the posture beside the seed is the answer."""
INEXACT = 1e4  # added to the cost of a branch that does not reach: after all others
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@inner
def constants_at(n: int) -> int:
    """Place of a closed form's constants in a geometry row of n joints."""
    return n + 7 + 12 * (n + 1)


@inner
def _placed(K: Array, at: int, T: Array, out: Array) -> None:
    """Write the constant transform at a place times T, (4, 4)."""
    for i in range(3):
        for j in range(4):
            k = at + 4 * i
            value = K[k] * T[0, j] + K[k + 1] * T[1, j] + K[k + 2] * T[2, j]
            out[i, j] = value + (K[k + 3] if j == 3 else 0.0)


@inner
def wanted_motion(T: Array, K: Array, n: int, work: Array, G: Array) -> None:
    """Write G (4, 4), what the joints are to make of ``T_base_tip``; ``work`` is memory (4, 4)."""
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
    """Replace M by Rz(q)ᵀ M, of the angle whose cosine and sine these are."""
    for j in range(columns):
        x, y = M[0, j], M[1, j]
        M[0, j], M[1, j] = c * x + s * y, c * y - s * x


@inner
def undo_between(K: Array, at: int, M: Array, out: Array, columns: int) -> None:
    """Write F⁻¹ M of the constant transform F at a place."""
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

    No branch with this angle costs less.
    """
    j = joint_of(K, n, i)
    q = turned(K[1 + i] * angle, seed[j], limits[0, j], limits[1, j], math.isfinite(limits[2, 0]))
    cost = abs(q - seed[j])
    if do_limits_count and (q < limits[0, j] - SLACK or q > limits[1, j] + SLACK):
        cost += OUTSIDE
    return cost


@inner
def branch_cost(q: Array, seed: Array, limits: Array) -> float:
    """Cost of a branch with free steps: largest move, inside limits before outside."""
    n = seed.shape[0]
    turn(q, seed, limits, 0, n)
    return cost_of(q, seed, limits, 0, n, True) + (0.0 if q[n] > 0.5 else INEXACT)


@inner
def _is_better(q: Array, best: Array, K: Array, seed: Array, limits: Array, do_limits_count: bool) -> bool:
    """Whether a branch goes before another in a path: group by group, the first that differs."""
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
    """Write the best of the candidates (count, n + 1), each by whole turns next to the seed.

    The best has the smallest largest move of a joint, inside limits before outside. In a path limits do not count, and
    joints that choose the branch come before those that swing beside a singularity, group by group; where two branches
    lie beside each other limits count after the first group.

    Returns:
        2 if it reaches the pose, 1 if only another candidate does, 0 if none does; and its place.
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
    if best < 0:  # numbers that overflow
        damped.assign(q, seed)
        return 0, best
    for i in range(n):
        q[i] = found[best, i]
    return 2 if found[best, n] > 0.5 else (1 if is_exact else 0), best


@inner
def box_around(seed: Array, limits: Array, box: Array) -> None:
    """Write what limits and steps allow around a seed: lower and upper joints (2, n)."""
    for i in range(seed.shape[0]):
        near = min(max(seed[i], limits[0, i]), limits[1, i])
        box[0, i] = max(limits[0, i], near - limits[2, i])
        box[1, i] = min(limits[1, i], near + limits[2, i])


@inner
def is_nearly(geometry: Array) -> bool:
    """Whether an arm is of its class only nearly."""
    return bool(geometry[geometry.shape[0] - 1] != 0.0)


@inner
def is_beside(T: Array, seed: Array, limits: Array, geometry: Array, q: Array) -> bool:
    """Whether an arm that is nearly of its class reaches the pose beside the seed; then by ``q``.

    Beside a stretched elbow, or a limit, the branch of the seed may be none of the class.
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

    A search from the branch itself, from the seed and from all other branches, of which the least error counts.
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

    A search from the branch. Where that reaches the pose, joints that a step does not bring there go at full speed. The
    others make the best of that, or go slower with them on the straight way, whichever lags less.
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
    """Squared error of a pose, of which a place counts as a turn at :data:`_LEVER`."""
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
    """Bring a branch into limits and steps, write its residual (2,) and say how well it does.

    What limits and steps leave off the pose, damped least squares bring as near as they allow.
    ``reach`` is what :func:`choose` returned.
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
    """Write the residual (2,) of joints within limits and steps, and say how well they do."""
    reached, J = room(4, 4), room(6, 7)
    is_flat = dh_kernels.pose_of_chain(q, geometry, J, reached)
    if not pose_residual(reached, T, residual):
        return _LIMITED if reach > 0 else _UNREACHABLE
    return _NEAR_SINGULAR if is_flat else _FOLLOWED


@inner
def forget(seed: Array, limits: Array) -> None:
    """Write what :func:`kept` asks with: zero, and no limits and no branch that is turned to it."""
    for i in range(seed.shape[0]):
        seed[i] = limits[2, i] = 0.0
        limits[0, i], limits[1, i] = -math.inf, math.inf


@kernel
def kept(T: Array, found: Array, count: int, geometry: Array, solutions: Array) -> int:
    """Write the candidates (count, n + 1) that reach the pose into ``solutions``; how many do.

    Angles are within ±pi. A class is recognised with a tolerance; a search takes away what it leaves.
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
