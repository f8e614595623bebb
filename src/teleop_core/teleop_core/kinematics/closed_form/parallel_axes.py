"""Arms of six turning joints whose axes 2, 3 and 4 are parallel: closed form, up to eight branches.

The three parallel joints move everything after them in a plane. The height of axis 6 over that plane, and its slope to
the plane, determine joints 1 and 5 by two equations, linear in their sines and cosines. If axes 5 and 6 meet, only one
of these equations contains joint 5; otherwise an equation of degree four remains. Then joint 6 follows, and finally
joints 2, 3 and 4 as a planar arm of two links with a hand. An arm whose axes 3, 4 and 5 are parallel belongs to this
class when it is described from tip to base.

Source:
    Elias and Wen 2022, section on three parallel axes; Hawkins 2013 for the arms of Universal
    Robots. The two equations with their null vectors are derived.
"""

import math

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room
from teleop_core.kinematics import is_askable
from teleop_core.kinematics.branches import BESIDE, OUTSIDE
from teleop_core.kinematics.closed_form import candidates, subproblems

_F1, _F2, _F3, _F4, _F5 = (37, 49, 61, 73, 85)
RULE = 97
"""Index in the constants of the rule that solves the arm's two equations; B and a length follow the rule."""
_LEVEL, _COST = 3, 4
# Row of a pair: joint 1, joint 5, whether the pair reaches the pose, 1.0 if both joints are known, and the least cost
# of its branches.
_LATER = 1e9  # added to the cost of pairs that always come after the others
_ALIGNED = 1e-10  # below this sine, axis 6 counts as parallel to axes 2, 3 and 4, and joint 6 is free


@inner
def _equations(G: Array, K: Array, A: Array, B: Array, h: Array) -> None:
    """Write the equations in joints 1 and 5: slope and height of axis 6 over the plane."""
    m0, m1, m2, over = K[_F1 + 2], K[_F1 + 6], K[_F1 + 10], K[RULE + 8]
    for i in range(2):
        weight = 1.0 if i == 0 else over
        x, y = weight * G[0, 2 + i], weight * G[1, 2 + i]
        A[i, 0], A[i, 1] = m0 * x + m1 * y, m0 * y - m1 * x
        h[i] = K[RULE + 9 + i] - m2 * weight * G[2, 2 + i]
        for j in range(2):
            B[i, j] = K[RULE + 4 + 2 * i + j]


@inner
def _hand(K: Array, fifth: float, sixth: float, M: Array) -> None:
    """Write the transform (3, 4) of the hand that joints 5 and 6 give: F4 Rz(q5) F5 Rz(q6)."""
    c5, s5, c6, s6 = math.cos(fifth), math.sin(fifth), math.cos(sixth), math.sin(sixth)
    for i in range(3):
        f0, f1 = K[_F4 + 4 * i], K[_F4 + 4 * i + 1]
        u, v, w = c5 * f0 + s5 * f1, c5 * f1 - s5 * f0, K[_F4 + 4 * i + 2]
        for j in range(4):
            M[i, j] = u * K[_F5 + j] + v * K[_F5 + 4 + j] + w * K[_F5 + 8 + j]
        M[i, 3] += K[_F4 + 4 * i + 3]
        x, y = M[i, 0], M[i, 1]
        M[i, 0], M[i, 1] = c6 * x + s6 * y, c6 * y - s6 * x


@inner
def _sixth(H: Array, K: Array, fifth: float, seed: float) -> float:
    """Joint 6 from the plane's normal in the hand; the seed if axis 6 is parallel to the normal."""
    c, s = math.cos(fifth), math.sin(fifth)
    u = c * K[_F4 + 8] + s * K[_F4 + 9]
    v, w = c * K[_F4 + 9] - s * K[_F4 + 8], K[_F4 + 10]
    x = u * K[_F5] + v * K[_F5 + 4] + w * K[_F5 + 8]
    y = u * K[_F5 + 1] + v * K[_F5 + 5] + w * K[_F5 + 9]
    if H[2, 0] * H[2, 0] + H[2, 1] * H[2, 1] <= _ALIGNED * _ALIGNED:
        return seed
    return subproblems.turn_between(H[2, 0], H[2, 1], x, y, seed)


@inner
def _plane(H: Array, M: Array, K: Array, seed: float, angles: Array) -> float:
    """Write joints 2, 3 and 4, which move M to H, into ``angles`` (2, 3), for both elbow branches.

    Returns:
        1.0 if the planar arm reaches the position, else 0.0.
    """
    # Motion in the plane, D = H M⁻¹: its rotation, and the position of axis 4.
    c = H[0, 0] * M[0, 0] + H[0, 1] * M[0, 1] + H[0, 2] * M[0, 2]
    s = H[1, 0] * M[0, 0] + H[1, 1] * M[0, 1] + H[1, 2] * M[0, 2]
    c += H[1, 0] * M[1, 0] + H[1, 1] * M[1, 1] + H[1, 2] * M[1, 2]
    s -= H[0, 0] * M[1, 0] + H[0, 1] * M[1, 1] + H[0, 2] * M[1, 2]
    whole = math.atan2(s, c)
    c, s = math.cos(whole), math.sin(whole)
    x, y = H[0, 3] - c * M[0, 3] + s * M[1, 3], H[1, 3] - s * M[0, 3] - c * M[1, 3]
    a0, a1, b0, b1 = K[_F2 + 3], K[_F2 + 7], K[_F3 + 3], K[_F3 + 7]
    rest = 0.5 * (x * x + y * y - a0 * a0 - a1 * a1 - b0 * b0 - b1 * b1)
    base, spread, is_exact = subproblems.one_angle(a0 * b0 + a1 * b1, a1 * b0 - a0 * b1, rest, 0.0)
    for k in range(2):
        q3 = base + spread if k == 0 else base - spread
        c, s = math.cos(q3), math.sin(q3)
        q2 = subproblems.turn_between(a0 + c * b0 - s * b1, a1 + s * b0 + c * b1, x, y, seed)
        angles[k, 0], angles[k, 1], angles[k, 2] = q2, q3, whole - q2 - q3
    return is_exact


@inner
def _behind_first(G: Array, K: Array, first: float, M: Array, N: Array) -> None:
    """Write the motion that remains for the joints after joint 1 into N (3, 4); ``M`` is scratch memory."""
    for i in range(3):
        for j in range(4):
            M[i, j] = G[i, j]
    candidates.undo_turn(math.cos(first), math.sin(first), M, 4)
    candidates.undo_between(K, _F1, M, N, 4)


@inner
def _elbows(G: Array, K: Array, pair: Array, seed: Array, q: Array) -> None:
    """Write the two branches of a pair of joints 1 and 5 into q (2, 7)."""
    M, N, angles = room(3, 4), room(3, 4), room(2, 3)
    _behind_first(G, K, pair[0], M, N)
    sixth = _sixth(N, K, pair[1], candidates.angle_of(K, 6, 5, seed))
    _hand(K, pair[1], sixth, M)
    is_near = _plane(N, M, K, candidates.angle_of(K, 6, 1, seed), angles)
    for j in range(2):
        q[j, 6] = pair[2] * is_near
        candidates.set_angle(K, 6, 0, pair[0], q[j])
        candidates.set_angle(K, 6, 4, pair[1], q[j])
        candidates.set_angle(K, 6, 5, sixth, q[j])
        for i in range(3):
            candidates.set_angle(K, 6, 1 + i, angles[j, i], q[j])


@inner
def _least_sine(G: Array, K: Array, pairs: Array, count: int) -> float:
    """Least sine between axis 6 and the parallel axes."""
    M, N, least = room(3, 4), room(3, 4), math.inf
    for k in range(count):
        if k == 0 or pairs[k, 0] != pairs[k - 1, 0]:
            _behind_first(G, K, pairs[k, 0], M, N)
            least = min(least, math.hypot(N[2, 0], N[2, 1]))
    return least


@inner
def _cost(pair: Array, K: Array, seed: Array, limits: Array, first: float, least: float) -> float:
    """Lower bound of the cost of all branches of a pair, from the angles of joints 1 and 5 that are known.

    In a path joint 1 is compared first. Joint 5 is compared only for pairs in which joint 1 makes its least move
    ``first``; all other pairs come later.
    """
    is_path, is_closed = math.isfinite(limits[2, 0]), pair[_LEVEL] > 0.5
    one = candidates.angle_cost(K, 6, 0, pair[0], seed, limits, not is_path)
    if is_path and one > first:
        return _LATER + one
    five = 0.0
    if is_closed:
        do_count = not is_path or least < BESIDE
        five = candidates.angle_cost(K, 6, 4, pair[1], seed, limits, do_count)
    if is_path:
        return five
    return max(one, five) + (candidates.INEXACT if pair[2] < 0.5 else 0.0)


@inner
def _known_cost(q: Array, K: Array, seed: Array, limits: Array, least: float) -> float:
    """Cost of a branch (7,), in a path of its joints 5 and 6; branches with a higher cost need not be computed."""
    is_path, cost = math.isfinite(limits[2, 0]), 0.0
    if q[6] < 0.5:
        return math.inf
    for i in range(4 if is_path else 0, 6):
        angle, do_count = candidates.angle_of(K, 6, i, q), not is_path or least < BESIDE
        cost = max(cost, candidates.angle_cost(K, 6, i, angle, seed, limits, do_count))
    return cost


@kernel
def _branches(T: Array, geometry: Array, seed: Array, limits: Array, do_all: bool, found: Array) -> tuple[int, float]:
    """Write branches into ``found`` (8, 7), and whether each reaches the pose.

    Unless all branches are wanted, pairs of joints 1 and 5 with the least moves come first, and pairs that cannot be
    the best are left out.

    Returns:
        Number of branches, and in a path the least sine between axis 6 and the parallel axes.
    """
    K, is_path = geometry[candidates.constants_at(6) :], math.isfinite(limits[2, 0])
    G, M, A, B, h, seeds = room(4, 4), room(4, 4), room(2, 2), room(2, 2), room(2), room(2)
    pairs, rule = room(4, 5), K[RULE:]
    do_any = do_all or candidates.is_nearly(geometry)
    candidates.wanted_motion(T, K, 6, M, G)
    _equations(G, K, A, B, h)
    seeds[0], seeds[1] = candidates.angle_of(K, 6, 0, seed), candidates.angle_of(K, 6, 4, seed)
    count, first, best = subproblems.open_pairs(A, B, h, rule, seeds, pairs), math.inf, math.inf
    least = _least_sine(G, K, pairs, count) if is_path else math.inf
    for k in range(count):
        found[2 * k, 6] = found[2 * k + 1, 6] = candidates.UNKNOWN
        first = min(first, candidates.angle_cost(K, 6, 0, pairs[k, 0], seed, limits, False))
    for k in range(count):
        pairs[k, _COST] = 0.0 if do_all else _cost(pairs[k], K, seed, limits, first, least)
    while True:
        k = 0
        for other in range(1, count):
            k = other if pairs[other, _COST] < pairs[k, _COST] else k
        cost = pairs[k, _COST]
        if not cost < math.inf or (cost > best and (is_path or best < OUTSIDE)):
            return 2 * count, least
        if pairs[k, _LEVEL] < 0.5:
            subproblems.close_pair(A, B, h, rule, seeds, k, pairs)
            for other in range(k, k + 2):
                cost = _cost(pairs[other], K, seed, limits, first, least)
                pairs[other, _COST] = 0.0 if do_all else cost
            continue
        pairs[k, _COST], q = math.inf, found[2 * k : 2 * k + 2]
        _elbows(G, K, pairs[k], seed, q)
        for j in range(0 if do_any else 2):
            best = min(best, _known_cost(q[j], K, seed, limits, least))


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (6,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`."""
    if not is_askable(T, seed):
        return -1
    found = room(8, 7)
    if candidates.is_beside(T, seed, limits, geometry, q):
        return int(candidates.settled(T, seed, limits, geometry, 2, found, 0, q, residual))
    count, least = _branches(T, geometry, seed, limits, False, found)
    K = geometry[candidates.constants_at(6) :]
    reach, _ = candidates.choose(found, count, seed, limits, K, least < BESIDE, q)
    return int(candidates.settled(T, seed, limits, geometry, reach, found, count, q, residual))


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the branches (k, 6), at most eight, ignoring limits; return the number of branches that reach T.

    At a singularity a free joint is set to zero, and branches may be equal.
    """
    found, limits, seed = room(8, 7), room(3, 6), room(6)
    candidates.forget(seed, limits)
    count = _branches(T, geometry, seed, limits, True, found)[0]
    return int(candidates.kept(T, found, count, geometry, solutions))
