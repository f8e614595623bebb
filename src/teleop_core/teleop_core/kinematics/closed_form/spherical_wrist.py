"""Arms of six turning joints with a spherical wrist: closed form, up to eight branches.

The last three axes meet in the wrist centre, whose position determines the first three joints. In the frame of axis 2,
the height of the wrist centre and its distance from the origin do not change when joint 2 turns. This gives two
equations in joints 1 and 3, linear in their sines and cosines. If axes 1 and 2, or 2 and 3, are parallel or meet, one
equation contains only one of the joints. If these axes are skew, an equation of degree four remains. The remaining
attitude determines the wrist. An arm whose first three axes meet in a point belongs to this class when it is described
from tip to base.

Source:
    Pieper 1968 (three axes that meet decouple); Elias and Wen 2022, sections on spherical wrists.
    The two equations with their null vectors are derived.
"""

import math

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room
from teleop_core.kinematics import is_askable
from teleop_core.kinematics.branches import BESIDE, OUTSIDE, hold, is_allowed, turn, wrapped
from teleop_core.kinematics.closed_form import candidates, subproblems

_F1, _F2, _F3, _F4, _F5 = (37, 49, 61, 73, 85)
RULE = 97
"""Index in the constants of the rule that solves the arm's two equations; B and a length follow the rule."""
_LEVEL, _SECOND, _COST, _TRIG = 3, 4, 5, 6
# Row of an arm: joint 1, joint 3, whether the arm reaches the pose, which joints are known (0: one of these two, 1:
# both, 2: also joint 2), joint 2, the least cost of the arm's branches, cosine and sine of joints 1 and 3.
_ALIGNED = 1e-10  # below this sine, axes 4 and 6 count as one line, and joint 4 keeps its value
_BARE = 1e-12  # a smaller distance of tip and wrist centre counts as zero [m]
_EVEN = 1e-9  # a smaller constant term of joint 5's equation counts as zero


@inner
def _equations(G: Array, K: Array, A: Array, B: Array, h: Array) -> None:
    """Write the equations in joints 1 and 3 of a wrist centre, G's last column."""
    x, y, z, over = G[0, 3], G[1, 3], G[2, 3], K[RULE + 8]
    m0, m1, m2 = K[_F1 + 2], K[_F1 + 6], K[_F1 + 10]  # axis 2 in frame 1; the origin of axis 2 follows
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
def _joint2(G: Array, K: Array, arm: Array, seed: float) -> float:
    """Joint 2 that rotates the wrist centre of joint 3 to that of joint 1; the seed if the centre is on axis 2.

    Cosine and sine of joints 1 and 3 are stored in the arm's row.
    """
    c, s = math.cos(arm[0]), math.sin(arm[0])
    arm[_TRIG], arm[_TRIG + 1] = c, s
    x = c * G[0, 3] + s * G[1, 3] - K[_F1 + 3]
    y, z = c * G[1, 3] - s * G[0, 3] - K[_F1 + 7], G[2, 3] - K[_F1 + 11]
    wanted_x = K[_F1] * x + K[_F1 + 4] * y + K[_F1 + 8] * z
    wanted_y = K[_F1 + 1] * x + K[_F1 + 5] * y + K[_F1 + 9] * z
    c, s = math.cos(arm[1]), math.sin(arm[1])
    arm[_TRIG + 2], arm[_TRIG + 3] = c, s
    x, y = c * K[_F3 + 3] - s * K[_F3 + 7], s * K[_F3 + 3] + c * K[_F3 + 7]
    z = K[_F3 + 11]
    has_x = K[_F2] * x + K[_F2 + 1] * y + K[_F2 + 2] * z + K[_F2 + 3]
    has_y = K[_F2 + 4] * x + K[_F2 + 5] * y + K[_F2 + 6] * z + K[_F2 + 7]
    return subproblems.turn_between(has_x, has_y, wanted_x, wanted_y, seed)


@inner
def _arm_cost(arm: Array, K: Array, seed: Array, limits: Array) -> float:
    """Lower bound of the cost of all branches of an arm, from those of its joints 1 to 3 that are known."""
    do_count, level = not math.isfinite(limits[2, 0]), arm[_LEVEL]
    cost = candidates.INEXACT if do_count and arm[2] < 0.5 else 0.0
    worst = 0.0
    if level > 0.5 or K[RULE] < 0.5:
        worst = candidates.angle_cost(K, 6, 0, arm[0], seed, limits, do_count)
    if level > 0.5 or K[RULE] > 0.5:
        third = candidates.angle_cost(K, 6, 2, arm[1], seed, limits, do_count)
        worst = max(worst, third)
    if level > 1.5:
        second = candidates.angle_cost(K, 6, 1, arm[_SECOND], seed, limits, do_count)
        worst = max(worst, second)
    return worst + cost


@inner
def middle_angle(M: Array, K: Array, at: int) -> tuple[float, float, float]:
    """Base and spread [rad] of y in Rz(x) F Rz(y) F' Rz(z) = M, and 1.0 if the equation has a solution.

    F is at index ``at`` in the constants, and F' follows F; only the rotations of F and F' are used.
    """
    r0, r1, r2 = K[at + 8], K[at + 9], K[at + 10]
    a0, a1, a2 = K[at + 14], K[at + 18], K[at + 22]
    a, b, d = r0 * a0 + r1 * a1, r1 * a0 - r0 * a1, M[2, 2] - r2 * a2
    base, spread, is_exact = subproblems.one_angle(a, b, d, 0.0)
    if abs(r2 * a2) < _EVEN:  # 1 - cos² loses digits if axes x and z are nearly in line
        spread = math.atan2(math.sqrt(M[0, 2] * M[0, 2] + M[1, 2] * M[1, 2]), d)
    return base, spread, is_exact


@inner
def wrist_at(M: Array, K: Array, at: int, y: float, seed: float, angles: Array) -> None:
    """Write x, y and z for a known y into ``angles`` (3,); x is the seed if y leaves x undetermined.

    M, F and F' are those of :func:`middle_angle`.
    """
    a0, a1, a2 = K[at + 14], K[at + 18], K[at + 22]
    c, s = math.cos(y), math.sin(y)
    v0, v1 = c * a0 - s * a1, s * a0 + c * a1
    u0 = K[at] * v0 + K[at + 1] * v1 + K[at + 2] * a2
    u1 = K[at + 4] * v0 + K[at + 5] * v1 + K[at + 6] * a2
    x = seed
    if u0 * u0 + u1 * u1 > _ALIGNED * _ALIGNED:
        x = subproblems.turn_between(u0, u1, M[0, 2], M[1, 2], seed)
    angles[0], angles[1] = x, y
    angles[2] = _last_angle(M, K, at, math.cos(x), math.sin(x), c, s)


@inner
def wrist_angles(M: Array, K: Array, at: int, seed: float, angles: Array) -> tuple[float, float]:
    """Write the two solutions x, y, z of the equation of :func:`middle_angle` into ``angles`` (2, 3).

    Returns:
        Half the difference [rad] of the two angles y, and 1.0 if they solve the equation.
    """
    base, spread, is_exact = middle_angle(M, K, at)
    wrist_at(M, K, at, base + spread, seed, angles[0])
    wrist_at(M, K, at, base - spread, seed, angles[1])
    return spread, is_exact


@inner
def _last_angle(M: Array, K: Array, at: int, cx: float, sx: float, cy: float, sy: float) -> float:
    """Angle z that comes nearest to M, given x and y as cosines and sines."""
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
def _attitude(G: Array, K: Array, arm: Array, M: Array, N: Array) -> None:
    """Write the rotation that remains for the wrist into N (3, 3); ``M`` is scratch memory."""
    for i in range(3):
        for j in range(3):
            M[i, j] = G[i, j]
    candidates.undo_turn(arm[_TRIG], arm[_TRIG + 1], M, 3)
    candidates.undo_between(K, _F1, M, N, 3)
    candidates.undo_turn(math.cos(arm[_SECOND]), math.sin(arm[_SECOND]), N, 3)
    candidates.undo_between(K, _F2, N, M, 3)
    candidates.undo_turn(arm[_TRIG + 2], arm[_TRIG + 3], M, 3)
    candidates.undo_between(K, _F3, M, N, 3)


@inner
def _wrist(G: Array, K: Array, arm: Array, seed: Array, limits: Array, do_both: bool, q: Array) -> tuple[float, float]:
    """Write the two branches of an arm into q (2, 7).

    Unless ``do_both``, the branch whose joint 5 moves more is left out if it cannot be the better one.

    Returns:
        The wrist's least spread, and with free steps the smaller cost of the two branches.
    """
    M, N, angles = room(4, 7), room(4, 7), room(3)
    is_path, lowest = math.isfinite(limits[2, 0]), math.inf
    _attitude(G, K, arm, M, N)
    base, spread, is_wrist = middle_angle(N, K, _F4)
    least = min(spread, math.pi - spread)
    do_both = do_both or (is_path and (least < BESIDE or arm[2] < 0.5))
    first = candidates.angle_cost(K, 6, 4, base + spread, seed, limits, not is_path)
    second = candidates.angle_cost(K, 6, 4, base - spread, seed, limits, not is_path)
    other, start = max(first, second), 1 if second < first else 0
    other = other if is_path else max(other, arm[_COST])
    for k in range(2):
        j = start if k == 0 else 1 - start
        if k == 1 and not do_both and lowest < min(other, OUTSIDE):
            q[j, 6] = candidates.UNKNOWN
            break
        y = base + spread if j == 0 else base - spread
        wrist_at(N, K, _F4, y, candidates.angle_of(K, 6, 3, seed), angles)
        q[j, 6] = arm[2] * is_wrist
        candidates.set_angle(K, 6, 0, arm[0], q[j])
        candidates.set_angle(K, 6, 1, arm[_SECOND], q[j])
        candidates.set_angle(K, 6, 2, arm[1], q[j])
        cost = 0.0
        for i in range(3):
            candidates.set_angle(K, 6, 3 + i, angles[i], q[j])
            if is_path:
                move = candidates.angle_cost(K, 6, 3 + i, angles[i], seed, limits, False)
                cost = max(cost, move)
        if not is_path:
            cost = candidates.branch_cost(q[j], seed, limits)
        lowest = min(lowest, cost)
    return least, lowest


@kernel
def _branches(T: Array, geometry: Array, seed: Array, limits: Array, do_all: bool, found: Array) -> tuple[int, float]:
    """Write branches into ``found`` (8, 7), and whether each reaches the pose.

    Unless all branches are wanted, arms with the least moves come first, and arms that cannot be the best are left out.
    With free steps, these are arms that move more than a complete branch inside the limits. In a path, these are all
    arms after the first arm that reaches the pose. The known joints of an arm give a lower bound of its move.

    Returns:
        Number of branches, and the least half difference [rad] of a wrist's two angles y.
    """
    K, is_path = geometry[candidates.constants_at(6) :], math.isfinite(limits[2, 0])
    G, M, A, B, h, seeds = room(4, 4), room(4, 4), room(2, 2), room(2, 2), room(2), room(2)
    arms, rule, do_both = room(4, 10), K[RULE:], do_all or candidates.is_nearly(geometry)
    candidates.wanted_motion(T, K, 6, M, G)
    _equations(G, K, A, B, h)
    seeds[0], seeds[1] = candidates.angle_of(K, 6, 0, seed), candidates.angle_of(K, 6, 2, seed)
    count = subproblems.open_pairs(A, B, h, rule, seeds, arms)
    for k in range(count):
        arms[k, _COST] = 0.0 if do_all else _arm_cost(arms[k], K, seed, limits)
    done, least, best = 0, math.inf, math.inf
    while True:
        k = 0
        for other in range(1, count):
            k = other if arms[other, _COST] < arms[k, _COST] else k
        arm = arms[k]
        if not arm[_COST] < math.inf or (arm[_COST] >= best and best < OUTSIDE):
            return done, least
        if arm[_LEVEL] < 0.5:
            subproblems.close_pair(A, B, h, rule, seeds, k, arms)
        elif arm[_LEVEL] < 1.5:
            arm[_SECOND] = _joint2(G, K, arm, candidates.angle_of(K, 6, 1, seed))
            arm[_LEVEL] = 2.0
        else:
            near, cost = _wrist(G, K, arm, seed, limits, do_both, found[done : done + 2])
            least, done = min(least, near), done + 2
            if is_path:
                cost = -1.0 if arm[2] > 0.5 else math.inf
            best = best if do_all else min(best, cost)
            arm[_COST] = math.inf
            continue
        for other in range(k, k + 1 if arm[_LEVEL] > 1.5 else k + 2):
            arms[other, _COST] = 0.0 if do_all else _arm_cost(arms[other], K, seed, limits)


@inner
def _held(K: Array, i: int, angle: float, seed: Array, limits: Array, q: Array) -> float:
    """Write joint i of the closed form, clipped to limits and step; return the resulting angle [rad]."""
    candidates.set_angle(K, 6, i, angle, q)
    place = candidates.joint_of(K, 6, i)
    turn(q, seed, limits, place, place + 1)
    hold(q, place, seed, limits)
    return candidates.angle_of(K, 6, i, q)


@inner
def _has_no_tool(K: Array) -> bool:
    """Whether the tip is the wrist centre; then a lag in attitude causes no position error."""
    return K[0] > 0.0 and max(abs(K[28]), abs(K[32]), abs(K[36])) < _BARE


@kernel
def _settle(T: Array, seed: Array, limits: Array, geometry: Array, q: Array) -> None:
    """Clip a branch to limits and steps; each joint reduces the error that earlier joints leave."""
    K, arm = geometry[candidates.constants_at(6) :], room(10)
    G, M, N, A, B, h = room(4, 4), room(4, 4), room(4, 7), room(2, 2), room(2, 2), room(2)
    candidates.wanted_motion(T, K, 6, M, G)
    _equations(G, K, A, B, h)
    third, fourth = candidates.angle_of(K, 6, 2, q), candidates.angle_of(K, 6, 3, q)
    arm[0] = _held(K, 0, candidates.angle_of(K, 6, 0, q), seed, limits, q)
    d = h[1] - A[1, 0] * math.cos(arm[0]) - A[1, 1] * math.sin(arm[0])
    base, spread, _ = subproblems.one_angle(B[1, 0], B[1, 1], d, third)
    if abs(wrapped(base + spread - third)) > abs(wrapped(base - spread - third)):
        spread = -spread
    arm[1] = _held(K, 2, base + spread, seed, limits, q)
    second = _joint2(G, K, arm, candidates.angle_of(K, 6, 1, seed))
    arm[_SECOND] = _held(K, 1, second, seed, limits, q)
    _attitude(G, K, arm, M, N)
    angle = _held(K, 3, fourth, seed, limits, q)
    candidates.undo_turn(math.cos(angle), math.sin(angle), N, 3)
    candidates.undo_between(K, _F4, N, M, 3)
    fifth = candidates.angle_of(K, 6, 4, seed)
    angle = subproblems.turn_between(K[_F5 + 2], K[_F5 + 6], M[0, 2], M[1, 2], fifth)
    angle = _held(K, 4, angle, seed, limits, q)
    candidates.undo_turn(math.cos(angle), math.sin(angle), M, 3)
    candidates.undo_between(K, _F5, M, N, 3)
    _held(K, 5, math.atan2(N[1, 0] - N[0, 1], N[0, 0] + N[1, 1]), seed, limits, q)


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (6,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`."""
    if not is_askable(T, seed):
        return -1
    found = room(8, 7)
    if candidates.is_beside(T, seed, limits, geometry, q):
        return int(candidates.settled(T, seed, limits, geometry, 2, found, 0, q, residual))
    K = geometry[candidates.constants_at(6) :]
    count, least = _branches(T, geometry, seed, limits, False, found)
    reach, _ = candidates.choose(found, count, seed, limits, K, least < BESIDE, q)
    if math.isfinite(limits[2, 0]) and _has_no_tool(K) and not is_allowed(q, seed, limits):
        _settle(T, seed, limits, geometry, q)
        return int(candidates.told(T, geometry, reach, q, residual))
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
