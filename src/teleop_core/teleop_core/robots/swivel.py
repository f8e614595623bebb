"""Arms of seven turning joints with a spherical shoulder and wrist: closed form over the swivel.

The distance of the wrist centre from the shoulder's fixes joint 4. The arm can then swivel about
the line between them: the shoulder's rotation is A(psi) = P cos psi + Q sin psi + N. A joint of
shoulder or wrist is at a given angle where an equation linear in cos psi and sin psi says so, and
so the limits of all joints cut the circle of psi into arcs, exactly: an arc is legal as a whole or
not at all, however narrow it is. Of the legal psi the nearest to the seed's posture is taken that
keeps a margin to the ends of its arc; psi = 0 is the seed's. In a path the arm makes the least move
that follows, and the swivel goes back to its margin where a joint is near a limit.

Source:
    Shimizu, Kakuya, Yoon, Kitagaki and Kosuge 2008, IEEE T-RO 24(5), sections on joint limits;
    here for axes at any angles, with the equations of joints instead of their inverse functions.
"""

import math

import numpy as np

from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array
from teleop_core.robots.branches import BESIDE, cost_of, is_allowed, turn
from teleop_core.robots.closed_form import (
    angle_of,
    box_around,
    branch_cost,
    choose,
    constants_at,
    kept,
    set_angle,
    settled,
    wanted_motion,
)
from teleop_core.robots.damped import ZERO
from teleop_core.robots.dh_kernels import descend
from teleop_core.robots.kinematics import is_askable
from teleop_core.robots.spherical_wrist import wrist_angles
from teleop_core.robots.subproblems import one_angle
from teleop_core.robots.swivel_arcs import ARCS, MARGIN, blend, cut_circle, swivel_of

_F1, _F2, _F3, _F4, _F5 = (39, 51, 63, 75, 87)
_SPEED = 0.3  # share of a joint's largest step by which psi goes back to its margin in a path
_ROUNDS = 8  # of the search for the least move
_BESIDE = 0.3  # [rad] from the seed up to which that is the answer


@inner
def _turned_about_z(K: Array, at: int, q: float, M: Array, out: Array) -> None:
    """Write M Rz(q) F for the rotation F at a place among the constants."""
    c, s = math.cos(q), math.sin(q)
    for i in range(3):
        x, y, z = c * M[i, 0] + s * M[i, 1], c * M[i, 1] - s * M[i, 0], M[i, 2]
        for j in range(3):
            out[i, j] = x * K[at + j] + y * K[at + 4 + j] + z * K[at + 8 + j]


@inner
def _elbow(G: Array, K: Array, seed: float) -> tuple[float, float, float]:
    """Base and spread of joint 4 [rad], and 1.0 if the arm reaches so far."""
    k0 = K[_F3] * K[_F3 + 3] + K[_F3 + 4] * K[_F3 + 7] + K[_F3 + 8] * K[_F3 + 11]
    k1 = K[_F3 + 1] * K[_F3 + 3] + K[_F3 + 5] * K[_F3 + 7] + K[_F3 + 9] * K[_F3 + 11]
    k2 = K[_F3 + 2] * K[_F3 + 3] + K[_F3 + 6] * K[_F3 + 7] + K[_F3 + 10] * K[_F3 + 11]
    x, y, z, square = K[_F4 + 3], K[_F4 + 7], K[_F4 + 11], 0.0
    for i in range(3):
        a, b = K[_F3 + 3 + 4 * i], K[_F4 + 3 + 4 * i]
        square += G[i, 3] * G[i, 3] - a * a - b * b
    return one_angle(k0 * x + k1 * y, k1 * x - k0 * y, 0.5 * square - k2 * z, seed)


@inner
def _least_turn(v: Array, p: Array, A: Array, out: Array) -> None:
    """Write the least rotation that turns the direction of A v into that of p, times A."""
    a, size, other = np.empty(3), 0.0, 0.0
    for i in range(3):
        a[i] = A[i, 0] * v[0] + A[i, 1] * v[1] + A[i, 2] * v[2]
        size += a[i] * a[i]
        other += p[i] * p[i]
    over = 1.0 / max(math.sqrt(size * other), 1e-300)
    x, y, z = a[1] * p[2] - a[2] * p[1], a[2] * p[0] - a[0] * p[2], a[0] * p[1] - a[1] * p[0]
    x, y, z = over * x, over * y, over * z
    cosine = over * (a[0] * p[0] + a[1] * p[1] + a[2] * p[2])
    share = 1.0 / max(1.0 + cosine, 1e-12)
    for j in range(3):
        u, v0, w = A[0, j], A[1, j], A[2, j]
        along = share * (x * u + y * v0 + z * w)
        out[0, j] = cosine * u + y * w - z * v0 + along * x
        out[1, j] = cosine * v0 + z * u - x * w + along * y
        out[2, j] = cosine * w + x * v0 - y * u + along * z


@inner
def _families(G: Array, K: Array, fourth: float, A: Array, work: Array, S: Array, W: Array) -> None:
    """Write P, Q, N of the shoulder's rotation into S (9, 3), those of the wrist's into W.

    ``A`` is the shoulder's rotation at the seed, ``work`` memory (12, 3).
    """
    B, C, D, v, p = work[:3], work[3:6], work[6:9], work[9], work[10]
    c, s, size = math.cos(fourth), math.sin(fourth), 0.0
    x, y, z = c * K[_F4 + 3] - s * K[_F4 + 7], s * K[_F4 + 3] + c * K[_F4 + 7], K[_F4 + 11]
    for i in range(3):
        k = _F3 + 4 * i
        v[i] = K[k] * x + K[k + 1] * y + K[k + 2] * z + K[k + 3]
        p[i] = G[i, 3]
        size += p[i] * p[i]
        for j in range(3):
            B[i, j] = K[k + j]
    _least_turn(v, p, A, D)
    _turned_about_z(K, _F4, fourth, B, C)
    over = 1.0 / max(math.sqrt(size), 1e-300)
    x, y, z = over * p[0], over * p[1], over * p[2]
    for j in range(3):
        along = x * D[0, j] + y * D[1, j] + z * D[2, j]
        S[6, j], S[7, j], S[8, j] = along * x, along * y, along * z
        for i in range(3):
            S[i, j] = D[i, j] - S[6 + i, j]
        S[3, j] = y * D[2, j] - z * D[1, j]
        S[4, j] = z * D[0, j] - x * D[2, j]
        S[5, j] = x * D[1, j] - y * D[0, j]
    for f in range(0, 9, 3):  # (A C)ᵀ G of each part
        for i in range(3):
            for j in range(3):
                B[i, j] = S[f + i, 0] * C[0, j] + S[f + i, 1] * C[1, j] + S[f + i, 2] * C[2, j]
        for i in range(3):
            for j in range(3):
                W[f + i, j] = B[0, i] * G[0, j] + B[1, i] * G[1, j] + B[2, i] * G[2, j]


@inner
def _elbow_cost(fourth: float, K: Array, seed: Array, limits: Array, q: Array) -> float:
    """:func:`cost_of` joint 4 alone, which no branch of its elbow is under; ``q`` is memory."""
    set_angle(K, 7, 3, fourth, q)
    turn(q, seed, limits, 3, 4)
    return cost_of(q, seed, limits, 3, 4, True)


@inner
def _write(
    S: Array, W: Array, psi: float, K: Array, seed: Array, M: Array, angles: Array, q: Array, k: int
) -> float:
    """Write joints of shoulder and wrist of branch k at psi into q (8,); the least spread."""
    blend(S, psi, M)
    spread, is_exact = wrist_angles(M, K, _F1, angle_of(K, 7, 0, seed), angles)
    least = min(spread, math.pi - spread)
    for i in range(3):
        set_angle(K, 7, i, angles[k // 2, i], q)
    blend(W, psi, M)
    spread, is_wrist = wrist_angles(M, K, _F5, angle_of(K, 7, 4, seed), angles)
    for i in range(3):
        set_angle(K, 7, 4 + i, angles[k % 2, i], q)
    q[7] *= is_exact * is_wrist
    return min(least, spread, math.pi - spread)


@kernel
def _branches(
    T: Array, geometry: Array, seed: Array, limits: Array, is_free: bool, found: Array, work: Array
) -> tuple[int, float]:
    """Write branches into ``found`` (8, 8): at the seed's swivel, or, where free, at legal ones.

    Where free the elbow of the lesser move comes first, and ends it if a branch of it moves less
    than joint 4 of the other. ``work``, (60, 4), holds the families S and W of both elbows for
    those who go on from there.

    Returns:
        Number of branches, and the least spread of a shoulder or wrist [rad].
    """
    K = geometry[constants_at(7) :]
    G, N, M, angles, arcs = work[:4], work[4:8], work[8:12], work[12:14], np.empty(ARCS)
    wanted_motion(T, K, 7, N, G)
    for i in range(3):
        for j in range(3):
            N[i, j] = 1.0 if i == j else 0.0
    _turned_about_z(K, _F1, angle_of(K, 7, 0, seed), N, M)
    _turned_about_z(K, _F2, angle_of(K, 7, 1, seed), M, N)
    c, s = math.cos(angle_of(K, 7, 2, seed)), math.sin(angle_of(K, 7, 2, seed))
    for i in range(3):
        x, y = N[i, 0], N[i, 1]
        N[i, 0], N[i, 1] = c * x + s * y, c * y - s * x
    base, spread, does_reach = _elbow(G, K, angle_of(K, 7, 3, seed))
    least, memory, best, other = math.inf, np.empty((11, 3)), math.inf, 0.0
    if is_free:
        near = _elbow_cost(base + spread, K, seed, limits, found[0])
        other = _elbow_cost(base - spread, K, seed, limits, found[0])
        if other < near:
            spread, other = -spread, near
    for elbow in range(2):
        if best <= other:
            return 4, least
        S, W = work[16 + 20 * elbow : 25 + 20 * elbow], work[25 + 20 * elbow : 34 + 20 * elbow]
        fourth = base + spread if elbow == 0 else base - spread
        _families(G, K, fourth, N, memory, S, W)
        if is_free:
            cut_circle(S, W, K, limits, arcs)
        for k in range(4):
            q = found[4 * elbow + k]
            set_angle(K, 7, 3, fourth, q)
            q[7] = does_reach
            psi = swivel_of(k, S, W, K, seed, limits, arcs) if is_free else 0.0
            psi = psi if math.isfinite(psi) else 0.0
            least = min(least, _write(S, W, psi, K, seed, M, angles, q, k))
            best = min(best, branch_cost(q, seed, limits)) if is_free else best
    return 8, least


@inner
def _step_to_margin(
    seed: Array, limits: Array, K: Array, work: Array, found: Array, best: int, q: Array
) -> None:
    """Let the swivel of a branch in a path go back to the margin of its arc, slowly."""
    elbow, k, trial = best // 4, best % 4, found[8]
    S, W = work[16 + 20 * elbow : 25 + 20 * elbow], work[25 + 20 * elbow : 34 + 20 * elbow]
    M, angles, arcs, step = work[8:12], work[12:14], np.empty(ARCS), math.inf
    cut_circle(S, W, K, limits, arcs)
    psi = swivel_of(k, S, W, K, seed, limits, arcs)
    if not math.isfinite(psi) or psi == 0.0:
        return
    for i in range(7):
        step = min(step, _SPEED * limits[2, i])
        trial[i] = q[i]
    _write(S, W, min(max(psi, -step), step), K, seed, M, angles, trial, k)
    turn(trial, seed, limits, 0, 7)
    if is_allowed(trial[:7], seed, limits) or not is_allowed(q, seed, limits):
        for i in range(7):
            q[i] = trial[i]


@inner
def _least_move(T: Array, seed: Array, limits: Array, geometry: Array, q: Array) -> bool:
    """Write the pose's joints by the least move from the seed; whether a step allows them."""
    box = np.empty((2, 7))
    box_around(seed, limits, box)
    for i in range(7):
        q[i] = min(max(seed[i], box[0, i]), box[1, i])
    return descend(T, box, geometry, _ROUNDS, q) <= ZERO


@inner
def _is_beside(q: Array, seed: Array) -> bool:
    """Whether no joint has moved so far that another branch may be nearer."""
    most = 0.0
    for i in range(7):
        most = max(most, abs(q[i] - seed[i]))
    return most < _BESIDE


@inner
def _has_room(q: Array, limits: Array) -> bool:
    """Whether no joint is within the margin of its limits."""
    room = math.inf
    for i in range(7):
        room = min(room, q[i] - limits[0, i], limits[1, i] - q[i])
    return room > MARGIN


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (7,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`."""
    if not is_askable(T, seed):
        return -1
    found, work, K = np.empty((13, 8)), np.empty((60, 4)), geometry[constants_at(7) :]
    is_free, posture = not math.isfinite(limits[2, 0]), seed
    if _least_move(T, seed, limits, geometry, q):
        if _has_room(q, limits) and _is_beside(q, seed):
            return int(settled(T, seed, limits, geometry, 2, found, 0, q, residual))
        posture = seed if is_free else q.copy()
    count, least = _branches(T, geometry, posture, limits, is_free, found, work)
    reach, best = choose(found, count, posture, limits, K, least < BESIDE, q)
    if not is_free and reach == 2:
        _step_to_margin(seed, limits, K, work, found, best, q)
    return int(settled(T, seed, limits, geometry, reach, found, count, q, residual))


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write one joint vector (k, 7) of each branch, at most eight, at the swivel nearest to zero's.

    Limits do not count. There are endless many more, by turning the elbow about the line from
    shoulder to wrist.
    """
    found, work, seed = np.empty((8, 8)), np.empty((60, 4)), np.zeros(7)
    _branches(T, geometry, seed, np.empty((3, 7)), False, found, work)
    return int(kept(T, found, 8, geometry, solutions))
