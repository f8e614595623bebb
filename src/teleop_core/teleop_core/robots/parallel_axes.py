"""Arms of six turning joints whose axes 2, 3 and 4 are parallel: closed form, up to eight branches.

The three parallel joints move everything behind them in a plane. The height of axis 6 over that
plane, and its slope to it, say where joints 1 and 5 are: two equations, linear in their sines and
cosines. Where axes 5 and 6 meet, joint 5 is in one of them alone; else an equation of degree four
is left. Then joint 6 follows, and the plane's arm of two links with its hand. An arm whose axes 3,
4 and 5 are parallel is one of these, from tip to base.

Source:
    Elias and Wen 2022, section on three parallel axes; Hawkins 2013 for the arms of Universal
    Robots. The two equations with their null vectors are derived.
"""

import math

import numpy as np

from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array
from teleop_core.robots import closed_form
from teleop_core.robots.branches import BESIDE
from teleop_core.robots.kinematics import is_askable
from teleop_core.robots.subproblems import one_angle, pair_of_angles, turn_between

_F1, _F2, _F3, _F4, _F5 = (37, 49, 61, 73, 85)
RULE = 97
"""Place, among the constants, of the rule of the arm's pair of equations; then B and a length."""
_ALIGNED = 1e-10  # sine under which axis 6 counts as parallel to 2, 3 and 4, and joint 6 is free


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
    """Write what joints 5 and 6 make of the hand, F4 Rz(q5) F5 Rz(q6), (3, 4)."""
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
    """Joint 6 from the plane's normal in the hand; seed where axis 6 is parallel to it."""
    c, s = math.cos(fifth), math.sin(fifth)
    u = c * K[_F4 + 8] + s * K[_F4 + 9]
    v, w = c * K[_F4 + 9] - s * K[_F4 + 8], K[_F4 + 10]
    x = u * K[_F5] + v * K[_F5 + 4] + w * K[_F5 + 8]
    y = u * K[_F5 + 1] + v * K[_F5 + 5] + w * K[_F5 + 9]
    if H[2, 0] * H[2, 0] + H[2, 1] * H[2, 1] <= _ALIGNED * _ALIGNED:
        return seed
    return turn_between(H[2, 0], H[2, 1], x, y, seed)


@inner
def _plane(H: Array, M: Array, K: Array, seed: float, angles: Array) -> float:
    """Write joints 2, 3 and 4 of both elbows into ``angles`` (2, 3): they turn M into H.

    Returns:
        1.0 if the plane's arm reaches so far, else 0.0.
    """
    # The plane's motion D = H M⁻¹: its turn, and the place of axis 4.
    c = H[0, 0] * M[0, 0] + H[0, 1] * M[0, 1] + H[0, 2] * M[0, 2]
    s = H[1, 0] * M[0, 0] + H[1, 1] * M[0, 1] + H[1, 2] * M[0, 2]
    c += H[1, 0] * M[1, 0] + H[1, 1] * M[1, 1] + H[1, 2] * M[1, 2]
    s -= H[0, 0] * M[1, 0] + H[0, 1] * M[1, 1] + H[0, 2] * M[1, 2]
    whole = math.atan2(s, c)
    c, s = math.cos(whole), math.sin(whole)
    x, y = H[0, 3] - c * M[0, 3] + s * M[1, 3], H[1, 3] - s * M[0, 3] - c * M[1, 3]
    a0, a1, b0, b1 = K[_F2 + 3], K[_F2 + 7], K[_F3 + 3], K[_F3 + 7]
    rest = 0.5 * (x * x + y * y - a0 * a0 - a1 * a1 - b0 * b0 - b1 * b1)
    base, spread, is_exact = one_angle(a0 * b0 + a1 * b1, a1 * b0 - a0 * b1, rest, 0.0)
    for k in range(2):
        q3 = base + spread if k == 0 else base - spread
        c, s = math.cos(q3), math.sin(q3)
        q2 = turn_between(a0 + c * b0 - s * b1, a1 + s * b0 + c * b1, x, y, seed)
        angles[k, 0], angles[k, 1], angles[k, 2] = q2, q3, whole - q2 - q3
    return is_exact


@kernel
def _branches(T: Array, geometry: Array, seed: Array, found: Array) -> tuple[int, float]:
    """Write all branches into ``found`` (8, 7), and whether each reaches the pose.

    Returns:
        How many, and the least sine between axis 6 and the parallel ones.
    """
    K, work = geometry[closed_form.constants_at(6) :], np.empty((30, 7))
    G, M, N, A, B = work[7:11], work[11:15], work[15:19], work[19:21], work[21:23]
    h, pairs, angles = work[23], work[24:28], work[28:30]
    closed_form.wanted_motion(T, K, 6, M, G)
    _equations(G, K, A, B, h)
    h[2], h[3] = closed_form.angle_of(K, 6, 0, seed), closed_form.angle_of(K, 6, 4, seed)
    count, least = pair_of_angles(A, B, h, K[RULE : RULE + 4], h[2:4], work[:7], pairs), math.inf
    for k in range(count):
        first, fifth = pairs[k, 0], pairs[k, 1]
        for i in range(3):
            for j in range(4):
                M[i, j] = G[i, j]
        closed_form.undo_turn(first, M, 4)
        closed_form.undo_between(K, _F1, M, N, 4)
        least = min(least, math.hypot(N[2, 0], N[2, 1]))
        sixth = _sixth(N, K, fifth, closed_form.angle_of(K, 6, 5, seed))
        _hand(K, fifth, sixth, M)
        is_near = _plane(N, M, K, closed_form.angle_of(K, 6, 1, seed), angles)
        for j in range(2):
            q = found[2 * k + j]
            q[6] = pairs[k, 2] * is_near
            closed_form.set_angle(K, 6, 0, first, q)
            closed_form.set_angle(K, 6, 4, fifth, q)
            closed_form.set_angle(K, 6, 5, sixth, q)
            for i in range(3):
                closed_form.set_angle(K, 6, 1 + i, angles[j, i], q)
    return 2 * count, least


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (6,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`."""
    if not is_askable(T, seed):
        return -1
    found = np.empty((12, 7))
    if closed_form.is_beside(T, seed, limits, geometry, q):
        return int(closed_form.settled(T, seed, limits, geometry, 2, found, 0, q, residual))
    count, least = _branches(T, geometry, seed, found)
    K = geometry[closed_form.constants_at(6) :]
    reach, _ = closed_form.choose(found, count, seed, limits, K, least < BESIDE, q)
    return int(closed_form.settled(T, seed, limits, geometry, reach, found, count, q, residual))


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the branches (k, 6), at most eight, without regard to limits; how many reach T.

    On a singularity, where a joint is free, it is zero and branches may coincide.
    """
    found = np.empty((8, 7))
    count = _branches(T, geometry, np.zeros(6), found)[0]
    return int(closed_form.kept(T, found, count, geometry, solutions))
