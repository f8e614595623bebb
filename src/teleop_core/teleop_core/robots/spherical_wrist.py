"""Arms of six turning joints with a spherical wrist: closed form, up to eight branches.

The last three axes meet in the wrist centre, whose place says where the first three joints are. In
the frame of axis 2 its height and its distance from axis 2's origin do not change as joint 2
turns: two equations in joints 1 and 3, linear in their sines and cosines. Axes 1 and 2, or 2 and
3, that are parallel or meet take one joint out of one of them; skew ones leave an equation of
degree four. The attitude that is left gives the wrist. An arm whose first three axes meet in a
point is one of these, from tip to base.

Source:
    Pieper 1968 (three axes that meet decouple); Elias and Wen 2022, sections on spherical wrists.
    The two equations with their null vectors are derived.
"""

import math

import numpy as np

from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array
from teleop_core.robots import closed_form
from teleop_core.robots.branches import BESIDE, OUTSIDE
from teleop_core.robots.kinematics import is_askable
from teleop_core.robots.subproblems import one_angle, pair_of_angles, turn_between

_F1, _F2, _F3, _F4, _F5 = (37, 49, 61, 73, 85)
RULE = 97
"""Place, among the constants, of the rule of the arm's pair of equations; then B and a length."""
_ALIGNED = 1e-10  # sine under which axes 4 and 6 count as one line, and joint 4 keeps its value
_EVEN = 1e-9  # constant term of joint 5's equation that counts as none


@inner
def _equations(G: Array, K: Array, A: Array, B: Array, h: Array) -> None:
    """Write the equations in joints 1 and 3 of a wrist centre, G's last column."""
    x, y, z, over = G[0, 3], G[1, 3], G[2, 3], K[RULE + 8]
    m0, m1, m2 = K[_F1 + 2], K[_F1 + 6], K[_F1 + 10]  # axis 2 in frame 1, then its origin there
    u0, u1, u2 = K[_F1 + 3], K[_F1 + 7], K[_F1 + 11]
    A[0, 0], A[0, 1] = m0 * x + m1 * y, m0 * y - m1 * x
    A[1, 0], A[1, 1] = -over * (u0 * x + u1 * y), -over * (u0 * y - u1 * x)
    for i in range(2):
        for j in range(2):
            B[i, j] = K[RULE + 4 + 2 * i + j]
    square = x * x + y * y + z * z
    h[0] = K[RULE + 9] - m2 * z
    h[1] = K[RULE + 10] + over * (u2 * z - 0.5 * square)


@inner
def _joint2(G: Array, K: Array, first: float, third: float, seed: float) -> float:
    """Joint 2 that turns the wrist centre of joint 3 into that of joint 1; seed if on its axis."""
    c, s = math.cos(first), math.sin(first)
    x = c * G[0, 3] + s * G[1, 3] - K[_F1 + 3]
    y, z = c * G[1, 3] - s * G[0, 3] - K[_F1 + 7], G[2, 3] - K[_F1 + 11]
    wanted_x = K[_F1] * x + K[_F1 + 4] * y + K[_F1 + 8] * z
    wanted_y = K[_F1 + 1] * x + K[_F1 + 5] * y + K[_F1 + 9] * z
    c, s = math.cos(third), math.sin(third)
    x, y = c * K[_F3 + 3] - s * K[_F3 + 7], s * K[_F3 + 3] + c * K[_F3 + 7]
    z = K[_F3 + 11]
    has_x = K[_F2] * x + K[_F2 + 1] * y + K[_F2 + 2] * z + K[_F2 + 3]
    has_y = K[_F2 + 4] * x + K[_F2 + 5] * y + K[_F2 + 6] * z + K[_F2 + 7]
    return turn_between(has_x, has_y, wanted_x, wanted_y, seed)


@inner
def wrist_angles(M: Array, K: Array, at: int, seed: float, angles: Array) -> tuple[float, float]:
    """Write both solutions of Rz(x) F Rz(y) F' Rz(z) = M into ``angles`` (2, 3).

    F stands at a place among the constants, F' behind it; of both the rotations count.

    Returns:
        Half the difference [rad] of their angles y, and 1.0 if they solve it.
    """
    r0, r1, r2 = K[at + 8], K[at + 9], K[at + 10]
    a0, a1, a2 = K[at + 14], K[at + 18], K[at + 22]
    a, b, d = r0 * a0 + r1 * a1, r1 * a0 - r0 * a1, M[2, 2] - r2 * a2
    base, spread, is_exact = one_angle(a, b, d, 0.0)
    if abs(r2 * a2) < _EVEN:  # digits that 1 - cos² loses where axes x and z are nearly in line
        spread = math.atan2(math.sqrt(M[0, 2] * M[0, 2] + M[1, 2] * M[1, 2]), d)
    for k in range(2):
        y = base + spread if k == 0 else base - spread
        c, s = math.cos(y), math.sin(y)
        v0, v1 = c * a0 - s * a1, s * a0 + c * a1
        u0 = K[at] * v0 + K[at + 1] * v1 + K[at + 2] * a2
        u1 = K[at + 4] * v0 + K[at + 5] * v1 + K[at + 6] * a2
        x = seed
        if u0 * u0 + u1 * u1 > _ALIGNED * _ALIGNED:
            x = turn_between(u0, u1, M[0, 2], M[1, 2], seed)
        angles[k, 0], angles[k, 1] = x, y
        angles[k, 2] = _last_angle(M, K, at, math.cos(x), math.sin(x), c, s)
    return spread, is_exact


@inner
def _last_angle(M: Array, K: Array, at: int, cx: float, sx: float, cy: float, sy: float) -> float:
    """Angle z that comes next to M, given those before it as cosines and sines."""
    cosine = sine = 0.0
    for i in range(2):  # columns 0 and 1 of Rz(x) F Rz(y) F'
        f0, f1, f2 = K[at + 12 + i], K[at + 16 + i], K[at + 20 + i]
        v0, v1 = cy * f0 - sy * f1, sy * f0 + cy * f1
        u0 = K[at] * v0 + K[at + 1] * v1 + K[at + 2] * f2
        u1 = K[at + 4] * v0 + K[at + 5] * v1 + K[at + 6] * f2
        w2 = K[at + 8] * v0 + K[at + 9] * v1 + K[at + 10] * f2
        w0, w1 = cx * u0 - sx * u1, sx * u0 + cx * u1
        cosine += w0 * M[0, i] + w1 * M[1, i] + w2 * M[2, i]
        along = w0 * M[0, 1 - i] + w1 * M[1, 1 - i] + w2 * M[2, 1 - i]
        sine += along if i == 1 else -along
    return math.atan2(sine, cosine)


@inner
def _wrist(G: Array, K: Array, arm: Array, M: Array, N: Array, seed: Array, q: Array) -> float:
    """Write both branches of an arm (7,), joints 1 to 3, into q (2, 7); the wrist's least spread.

    ``M`` and ``N`` are memory; the wrist's angles stand in M at last.
    """
    for i in range(3):
        for j in range(3):
            M[i, j] = G[i, j]
    closed_form.undo_turn(arm[3], M, 3)
    closed_form.undo_between(K, _F1, M, N, 3)
    closed_form.undo_turn(arm[4], N, 3)
    closed_form.undo_between(K, _F2, N, M, 3)
    closed_form.undo_turn(arm[5], M, 3)
    closed_form.undo_between(K, _F3, M, N, 3)
    spread, is_wrist = wrist_angles(N, K, _F4, closed_form.angle_of(K, 6, 3, seed), M)
    for j in range(2):
        q[j, 6] = arm[2] * is_wrist
        for i in range(3):
            closed_form.set_angle(K, 6, i, arm[3 + i], q[j])
            closed_form.set_angle(K, 6, 3 + i, M[j, i], q[j])
    return min(spread, math.pi - spread)


@kernel
def _branches(
    T: Array, geometry: Array, seed: Array, limits: Array, do_all: bool, found: Array
) -> tuple[int, float]:
    """Write branches into ``found`` (9, 7), and whether each reaches the pose.

    Unless all are wanted, the arms of the least moves come first, and none that cannot win: with
    free steps those that move more than a whole branch inside the limits does, in a path all after
    the first that reaches. Row 8 is memory.

    Returns:
        How many, and the least half difference [rad] of a wrist's two angles y.
    """
    K, work = geometry[closed_form.constants_at(6) :], np.empty((29, 7))
    G, M, N, A, B = work[7:11], work[11:15], work[15:19], work[19:21], work[21:23]
    h, arms, trial, is_path = work[23], work[24:28], found[8], math.isfinite(limits[2, 0])
    closed_form.wanted_motion(T, K, 6, M, G)
    _equations(G, K, A, B, h)
    h[2], h[3] = closed_form.angle_of(K, 6, 0, seed), closed_form.angle_of(K, 6, 2, seed)
    count = pair_of_angles(A, B, h, K[RULE : RULE + 4], h[2:4], work[:7], arms)
    for k in range(count):  # whether it reaches, joints 1 to 3, cost
        arms[k, 3], arms[k, 5] = arms[k, 0], arms[k, 1]
        arms[k, 4] = _joint2(G, K, arms[k, 3], arms[k, 5], closed_form.angle_of(K, 6, 1, seed))
        for i in range(6):
            closed_form.set_angle(K, 6, i, arms[k, 3 + i % 3], trial)
        trial[6] = arms[k, 2]
        arms[k, 6] = 0.0 if do_all else closed_form.arm_cost(trial, K, seed, limits)
    done, least, best = 0, math.inf, math.inf
    for _ in range(count):
        arm = arms[0]
        for k in range(1, count):
            arm = arms[k] if arms[k, 6] < arm[6] else arm
        if arm[6] >= best and best < OUTSIDE:
            break
        least = min(least, _wrist(G, K, arm, M, N, seed, found[done : done + 2]))
        for k in range(done, done + 2 if not do_all else done):
            if is_path:
                best = -1.0 if arm[2] > 0.5 else best
            else:
                best = min(best, closed_form.branch_cost(found[k], seed, limits))
        done += 2
        arm[6] = math.inf
    return done, least


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (6,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`."""
    if not is_askable(T, seed):
        return -1
    found = np.empty((13, 7))
    if closed_form.is_beside(T, seed, limits, geometry, q):
        return int(closed_form.settled(T, seed, limits, geometry, 2, found, 0, q, residual))
    K = geometry[closed_form.constants_at(6) :]
    count, least = _branches(T, geometry, seed, limits, False, found)
    reach, _ = closed_form.choose(found, count, seed, limits, K, least < BESIDE, q)
    return int(closed_form.settled(T, seed, limits, geometry, reach, found, count, q, residual))


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the branches (k, 6), at most eight, without regard to limits; how many reach T.

    On a singularity, where a joint is free, it is zero and branches may coincide.
    """
    found = np.empty((9, 7))
    count = _branches(T, geometry, np.zeros(6), np.empty((3, 6)), True, found)[0]
    return int(closed_form.kept(T, found, count, geometry, solutions))
