"""Arms of seven turning joints with a spherical shoulder and wrist: closed form over the swivel.

The distance between shoulder centre and wrist centre determines joint 4. The arm can then swivel about the line
between them: the shoulder's rotation is A(psi) = P cos psi + Q sin psi + N. The psi at which a joint of shoulder or
wrist has a given angle follow from an equation linear in cos psi and sin psi. So the limits of all joints cut the
circle of psi exactly into arcs. Each arc, however narrow, is either completely legal or completely illegal. psi = 0 is
the seed's posture. The solution is the legal psi nearest to 0 that keeps a margin to the ends of its arc.

In a path the arm makes the least joint move that reaches the next pose. Near a joint limit, the swivel moves back to
its margin. Otherwise, when the axes of shoulder or wrist become coplanar, the swivel moves slowly to the side where the
manipulabilities of shoulder and wrist increase, with the speed that the path does not need. The manipulability here is
the volume that the unit axes span.

Source:
    Shimizu, Kakuya, Yoon, Kitagaki and Kosuge 2008, IEEE T-RO 24(5), sections on joint limits;
    here for axes at any angles, with the equations of joints instead of their inverse functions.
    Yoshikawa 1985, IJRR 4(2), eq. 6 (manipulability).
"""

import math

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room
from teleop_core.kinematics import damped, dh_kernels, is_askable
from teleop_core.kinematics.branches import BESIDE, cost_of, is_allowed, turn
from teleop_core.kinematics.closed_form import candidates, spherical_wrist, swivel_arcs, swivel_families

_SPEED = 0.3  # share of a joint's largest step with which psi moves back to its margin in a path
_ROUNDS = 8  # largest number of rounds of the search for the least move
_MORE_ROUNDS = 40  # largest number of further rounds if the error is close to zero
_CLOSE = 1e-4  # squared weighted error that is close to zero: a joint limit only slows the convergence
_FLAT = 0.3  # with a larger volume of the three unit axes, the manipulability is ignored
_ASIDE = 1e-3  # the manipulabilities at psi plus and minus this angle are compared [rad]
_GAIN = 200.0  # gain from the relative difference to the share of full speed
_NONE = 1e-9  # a smaller sum of two manipulabilities counts as zero


@inner
def _elbow_cost(fourth: float, K: Array, seed: Array, limits: Array, q: Array) -> float:
    """:func:`cost_of` joint 4 alone, a lower bound for all branches of this elbow; ``q`` is scratch memory."""
    candidates.set_angle(K, 7, 3, fourth, q)
    turn(q, seed, limits, 3, 4)
    return cost_of(q, seed, limits, 3, 4, True)


@inner
def _write(S: Array, W: Array, psi: float, K: Array, seed: Array, M: Array, angles: Array, q: Array, k: int) -> float:
    """Write the joints of shoulder and wrist of branch k at psi into q (8,); return the least spread."""
    swivel_arcs.blend(S, psi, M)
    spread, is_exact = spherical_wrist.wrist_angles(
        M, K, swivel_families.F1, candidates.angle_of(K, 7, 0, seed), angles
    )
    least = min(spread, math.pi - spread)
    for i in range(3):
        candidates.set_angle(K, 7, i, angles[k // 2, i], q)
    swivel_arcs.blend(W, psi, M)
    spread, is_wrist = spherical_wrist.wrist_angles(
        M, K, swivel_families.F5, candidates.angle_of(K, 7, 4, seed), angles
    )
    for i in range(3):
        candidates.set_angle(K, 7, 4 + i, angles[k % 2, i], q)
    q[7] *= is_exact * is_wrist
    return min(least, spread, math.pi - spread)


@kernel
def _branches(
    T: Array, geometry: Array, seed: Array, limits: Array, is_free: bool, found: Array, work: Array
) -> tuple[int, float]:
    """Write branches into ``found`` (8, 8): at the seed's swivel or, if ``is_free``, at legal swivels.

    If ``is_free``, the elbow of the smaller move comes first. The search ends there if one of its branches moves less
    than joint 4 of the other elbow. ``work`` (60, 4) gets the families S and W of both elbows, for later use.

    Returns:
        Number of branches, and the least spread of a shoulder or wrist [rad].
    """
    K = geometry[candidates.constants_at(7) :]
    G, N, M, angles, arcs = work[:4], work[4:8], work[8:12], work[12:14], room(8, 36)
    candidates.wanted_motion(T, K, 7, N, G)
    for i in range(3):
        for j in range(3):
            N[i, j] = 1.0 if i == j else 0.0
    swivel_families.turned_about_z(K, swivel_families.F1, candidates.angle_of(K, 7, 0, seed), N, M)
    swivel_families.turned_about_z(K, swivel_families.F2, candidates.angle_of(K, 7, 1, seed), M, N)
    c, s = math.cos(candidates.angle_of(K, 7, 2, seed)), math.sin(candidates.angle_of(K, 7, 2, seed))
    for i in range(3):
        x, y = N[i, 0], N[i, 1]
        N[i, 0], N[i, 1] = c * x + s * y, c * y - s * x
    base, spread, does_reach = swivel_families.elbow_of(G, K, candidates.angle_of(K, 7, 3, seed))
    least, memory, best, other = math.inf, room(11, 3), math.inf, 0.0
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
        swivel_families.families(G, K, fourth, N, memory, S, W)
        if is_free:
            swivel_arcs.cut_circle(S, W, K, limits, arcs)
        for k in range(4):
            q = found[4 * elbow + k]
            candidates.set_angle(K, 7, 3, fourth, q)
            q[7] = does_reach
            psi = swivel_arcs.swivel_of(k, S, W, K, seed, limits, arcs) if is_free else 0.0
            psi = psi if math.isfinite(psi) else 0.0
            least = min(least, _write(S, W, psi, K, seed, M, angles, q, k))
            best = min(best, candidates.branch_cost(q, seed, limits)) if is_free else best
    return 8, least


@inner
def _step_to_margin(seed: Array, limits: Array, K: Array, work: Array, found: Array, best: int, q: Array) -> None:
    """Move the swivel of a branch in a path slowly back to the margin of its arc."""
    elbow, k, trial = best // 4, best % 4, found[8]
    S, W = work[16 + 20 * elbow : 25 + 20 * elbow], work[25 + 20 * elbow : 34 + 20 * elbow]
    M, angles, arcs, step = work[8:12], work[12:14], room(8, 36), math.inf
    swivel_arcs.cut_circle(S, W, K, limits, arcs)
    psi = swivel_arcs.swivel_of(k, S, W, K, seed, limits, arcs)
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
    """Write the pose's joints with the least move from the seed; return whether one step allows them."""
    box = room(2, 7)
    candidates.box_around(seed, limits, box)
    for i in range(7):
        q[i] = min(max(seed[i], box[0, i]), box[1, i])
    square = dh_kernels.descend(T, box, geometry, _ROUNDS, q)
    if damped.ZERO < square < _CLOSE and not math.isfinite(limits[2, 0]):
        square = dh_kernels.descend(T, box, geometry, _MORE_ROUNDS, q)
    return square <= damped.ZERO


@inner
def _room(q: Array, limits: Array) -> float:
    """Least distance [rad] of a joint from its limits."""
    least = math.inf
    for i in range(7):
        least = min(least, q[i] - limits[0, i], limits[1, i] - q[i])
    return least


@inner
def _width(q: Array, K: Array, i: int) -> float:
    """Manipulability of the shoulder (i = 1) or wrist (5): the volume that their axes span."""
    return abs(
        swivel_families.triple_product(
            K, swivel_families.F1 if i == 1 else swivel_families.F5, candidates.angle_of(K, 7, i, q)
        )
    )


@inner
def _urge(q: Array, seed: Array, limits: Array, K: Array) -> float:
    """Weight of the manipulability, from 0 to 1, continuous at both ends.

    The weight is 0 in four cases: the axes are far from coplanar; the axes pass through a plane; a joint is within the
    margin of a limit; or a joint needs all of its speed. Noise of the hand's readings always needs a part of that
    speed.
    """
    left, apart = 1.0, _room(q, limits) / swivel_arcs.MARGIN - 1.0
    for i in range(7):
        left = min(left, max(1.0 - abs(q[i] - seed[i]) / max(limits[2, i], 1e-300), 0.0))
    share = min(_width(q, K, 1), _width(q, K, 5)) / _FLAT
    urge = 6.75 * share * share * max(1.0 - share, 0.0) * left * left
    return urge * min(max(apart, 0.0), 1.0)


@inner
def _step_to_width(T: Array, seed: Array, limits: Array, geometry: Array, urge: float, found: Array, q: Array) -> None:
    """Move the swivel of a path to the side where manipulability grows, with a speed given by ``urge``.

    This motion uses only a share of each joint's step, and every joint stays within its step from the seed.
    """
    work, trial, near, K = room(60, 4), found[8], found[9, :7], geometry[candidates.constants_at(7) :]
    _branches(T, geometry, q, limits, False, found, work)
    k = candidates.choose(found, 8, q, limits, K, False, near)[1]
    S, W = work[16 + 20 * (k // 4) : 25 + 20 * (k // 4)], work[25 + 20 * (k // 4) :]
    M, angles, change, total, step = work[8:12], work[12:14], 0.0, _NONE, math.inf
    trial[3] = near[3]
    for side in (-1.0, 1.0):
        _write(S, W, side * _ASIDE, K, q, M, angles, trial, k % 4)
        width = _width(trial, K, 1) * _width(trial, K, 5)
        change, total = change + side * width, total + width
    for i in range(7):
        step = min(step, _SPEED * limits[2, i])
    psi = urge * min(max(_GAIN * change / total, -1.0), 1.0) * step
    _write(S, W, psi, K, q, M, angles, trial, k % 4)
    turn(trial, q, limits, 0, 7)
    share = 1.0
    for i in range(7):
        free = min(0.9 * (limits[2, i] - abs(q[i] - seed[i])), _SPEED * limits[2, i])
        share = min(share, free / max(abs(trial[i] - q[i]), 1e-300))
    _write(S, W, share * psi, K, q, M, angles, trial, k % 4)
    turn(trial, q, limits, 0, 7)
    if is_allowed(trial[:7], seed, limits):
        for i in range(7):
            q[i] = trial[i]


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (7,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`."""
    if not is_askable(T, seed):
        return -1
    found, work, K = room(10, 8), room(60, 4), geometry[candidates.constants_at(7) :]
    is_free, posture, most, near = not math.isfinite(limits[2, 0]), seed, math.inf, room(7)
    if _least_move(T, seed, limits, geometry, q):
        damped.assign(near, q)
        most = candidates.move_of(q, seed)
        if _room(q, limits) > swivel_arcs.MARGIN and most < candidates.BESIDE_SEED:
            urge = 0.0 if is_free else _urge(q, seed, limits, K)
            if urge > 0.0:
                _step_to_width(T, seed, limits, geometry, urge, found, q)
            return int(candidates.settled(T, seed, limits, geometry, 2, found, 0, q, residual))
        posture = seed if is_free else near
    count, least = _branches(T, geometry, posture, limits, is_free, found, work)
    reach, best = candidates.choose(found, count, posture, limits, K, least < BESIDE, q)
    if not is_free and reach == 2:
        _step_to_margin(seed, limits, K, work, found, best, q)
    if is_free and candidates.move_of(q, seed) > most + candidates.BESIDE_SEED:  # too large a move for a margin
        reach = 2
        for i in range(7):
            q[i] = near[i]
    return int(candidates.settled(T, seed, limits, geometry, reach, found, count, q, residual))


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write one joint vector (k, 7) of each branch, at most eight, at the swivel nearest to that of the zero posture.

    Limits are ignored. Rotating the elbow about the line from shoulder to wrist gives infinitely many other joint
    vectors.
    """
    found, work, seed, limits = room(8, 8), room(60, 4), room(7), room(3, 7)
    candidates.forget(seed, limits)
    _branches(T, geometry, seed, limits, False, found, work)
    return int(candidates.kept(T, found, 8, geometry, solutions))
