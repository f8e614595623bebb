"""Arms of three parallel turning joints: closed form, two branches, or four with a first joint.

Two links and a hand move in a plane. A slide may move along the normal of the plane, as in the SCARA. A first joint may
turn the plane about an axis in it, and a last joint may roll the tool about an axis in it, as in five-axis arms. The
arm controls fewer than six directions: the position of the tip, within reach, and the nearest attitude that is possible
at this position.

In the geometry row (:mod:`teleop_core.kinematics.dh_kernels`) the following numbers come after the chain: indices of
the joints first, shoulder, elbow, hand, roll (-1 for a missing joint) and their signs; index of the slide and its
factor on the height; lengths of the two links; constant angles that are added to elbow and attitude; the tip in the
hand's frame and the height of the tip over the plane. Then come three transforms: the inverses of the transforms before
the first joint and after the last joint, and the transform from the first joint to the shoulder.

Source:
    Craig 2005, section 4.4 (two links); the nearest attitude is derived.
"""

import math

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room
from teleop_core.kinematics import REACHED, IkStatus, is_askable, pose_residual
from teleop_core.kinematics.branches import OUTSIDE, cost_of, hold, is_allowed, turn, wrapped
from teleop_core.kinematics.closed_form import candidates, subproblems
from teleop_core.kinematics.dh_kernels import fk

FIRST, SHOULDER, ELBOW, HAND, ROLL = 0, 1, 2, 3, 4
"""Indices in the constants of the numbers of the closed form's joints; their signs follow."""
_SIGNS, _SLIDE, _PUSH, _UPPER, _FORE, _BEND, _TURN = 5, 10, 11, 12, 13, 14, 15
_TIP_X, _TIP_Y, _HEIGHT, _BEFORE, _BEHIND, _TO_PLANE = 16, 17, 18, 19, 31, 40
_ON_AXIS = 1e-12  # a point at a smaller distance counts as lying on the axis, and the joint does not move [m]
_ALIGNED = 1e-10  # with a smaller sine the tool counts as normal to the plane
_NEAR = 0.02  # below this sine of the elbow, or share of the reach, small tip moves need large joint moves
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@inner
def _get(K: Array, joint: int, q: Array) -> float:
    """Angle [rad] of a joint of the closed form; 0 for a joint that the arm does not have."""
    place = int(K[joint])
    return K[_SIGNS + joint] * q[place] if place >= 0 else 0.0


@inner
def _put(K: Array, joint: int, angle: float, q: Array) -> None:
    """Write the angle [rad] of a joint of the closed form, if the arm has this joint."""
    place = int(K[joint])
    if place >= 0:
        q[place] = K[_SIGNS + joint] * angle


@inner
def _sum(K: Array, q: Array) -> float:
    """Turn [rad] of the hand in the plane."""
    return _get(K, SHOULDER, q) + _get(K, ELBOW, q) + _get(K, HAND, q) + K[_TURN]


@inner
def _pointing(x: float, y: float, seed: float) -> float:
    """Direction [rad] of a point from an axis; the seed if the point lies on the axis."""
    return math.atan2(y, x) if x * x + y * y > _ON_AXIS * _ON_AXIS else seed


@inner
def _elbow(x: float, y: float, a: float, b: float) -> tuple[float, bool]:
    """Elbow angle in [0, pi] with which links a and b reach the distance of (x, y); whether they can reach it."""
    k = (x * x + y * y - a * a - b * b) / (2.0 * a * b)
    return math.atan2(math.sqrt(max(1.0 - k * k, 0.0)), k), abs(k) <= 1.0 + _ON_AXIS


@inner
def _shoulder(x: float, y: float, a: float, b: float, elbow: float, seed: float) -> float:
    """Angle [rad] of link a that points links a and b, bent by the elbow, at (x, y).

    If equal links are folded onto the axis, any angle is a solution, and the seed is returned.
    """
    along, across = a + b * math.cos(elbow), b * math.sin(elbow)
    if along * along + across * across <= _ON_AXIS * _ON_AXIS:
        return seed
    lead = math.atan2(across, along)
    return _pointing(x, y, seed + lead) - lead


@inner
def _wanted(T: Array, K: Array, G: Array) -> None:
    """Write the part of ``T_base_tip`` that the joints must produce, without the rotation after them: (3, 4)."""
    for i in range(3):
        a, b, c = K[_BEFORE + 4 * i], K[_BEFORE + 4 * i + 1], K[_BEFORE + 4 * i + 2]
        x = a * T[0, 0] + b * T[1, 0] + c * T[2, 0]
        y = a * T[0, 1] + b * T[1, 1] + c * T[2, 1]
        z = a * T[0, 2] + b * T[1, 2] + c * T[2, 2]
        for j in range(3):
            G[i, j] = x * K[_BEHIND + j] + y * K[_BEHIND + 3 + j] + z * K[_BEHIND + 6 + j]
        G[i, 3] = a * T[0, 3] + b * T[1, 3] + c * T[2, 3] + K[_BEFORE + 4 * i + 3]


@inner
def _sides(G: Array, K: Array, seed: Array) -> tuple[float, float, bool, float]:
    """Two angles [rad] of the first joint, whether they bring the plane to the tip, and the root.

    The root is the distance [m] of the tip from axis 1 within the plane.
    """
    if K[FIRST] < 0.0:
        return 0.0, 0.0, True, math.inf
    m0, m1, x, y = K[_TO_PLANE + 2], K[_TO_PLANE + 6], G[0, 3], G[1, 3]
    a, b = m0 * x + m1 * y, m0 * y - m1 * x
    d = K[_HEIGHT] + m0 * K[_TO_PLANE + 3] + m1 * K[_TO_PLANE + 7]
    d += K[_TO_PLANE + 10] * (K[_TO_PLANE + 11] - G[2, 3])
    now = _get(K, FIRST, seed)
    if a * a + b * b <= _ON_AXIS * _ON_AXIS:
        return now, now + math.pi, abs(d) <= REACHED, 0.0
    base, spread, is_exact = subproblems.one_angle(a, b, d, now)
    return base + spread, base - spread, is_exact > 0.5, math.sqrt(max(a * a + b * b - d * d, 0.0))


@inner
def _seen(G: Array, K: Array, first: float, M: Array, H: Array) -> None:
    """Write G in the frame of the plane into H (3, 4); ``M`` is scratch memory."""
    for i in range(3):
        for j in range(4):
            H[i, j] = M[i, j] = G[i, j]
    if K[FIRST] >= 0.0:
        candidates.undo_turn(math.cos(first), math.sin(first), M, 4)
        candidates.undo_between(K, _TO_PLANE, M, H, 4)


@inner
def _attitude(H: Array, K: Array, turned: float, roll: float) -> tuple[float, float]:
    """Angle in the plane and roll [rad] whose rotation is nearest to that of H.

    The angle in the plane gives the tool its direction in the plane. The sum of angle and roll, or their difference,
    whichever is better defined, gives the whole attitude. If the tool is normal to the plane, only that sum or
    difference is defined. Then both angles change by equal amounts from the given angles.
    """
    sign = -1.0 if K[ROLL] >= 0.0 and H[2, 2] < 0.0 else 1.0
    both = math.atan2(H[1, 0] - sign * H[0, 1], H[0, 0] + sign * H[1, 1])  # angle in the plane plus ``sign`` times roll
    if K[ROLL] < 0.0:
        return both, 0.0
    if math.hypot(H[0, 2], H[1, 2]) > _ALIGNED:
        turned = math.atan2(H[0, 2], -H[1, 2])
    else:
        turned += 0.5 * wrapped(both - turned - sign * roll)
    return turned, sign * (both - turned)


@inner
def _wrist(G: Array, K: Array, first: float, seed: Array, H: Array, q: Array) -> tuple[float, float, float]:
    """Return angle in the plane [rad] and position of the hand's axis [m]; write the other known joints into q."""
    M = room(3, 4)
    _seen(G, K, first, M, H)
    turned, roll = _attitude(H, K, _sum(K, seed), _get(K, ROLL, seed))
    _put(K, FIRST, first, q)
    _put(K, ROLL, roll, q)
    if K[_SLIDE] >= 0.0:
        q[int(K[_SLIDE])] = K[_PUSH] * (H[2, 3] - K[_HEIGHT])
    c, s, x, y = math.cos(turned), math.sin(turned), K[_TIP_X], K[_TIP_Y]
    return turned, H[0, 3] - c * x + s * y, H[1, 3] - s * x - c * y


@inner
def _bend(turned: float, x: float, y: float, K: Array, elbow: float, seed: Array, q: Array) -> None:
    """Write shoulder, elbow and hand for one sign of the elbow."""
    upper = _shoulder(x, y, K[_UPPER], K[_FORE], elbow, _get(K, SHOULDER, seed))
    bent = elbow - K[_BEND]
    _put(K, SHOULDER, upper, q)
    _put(K, ELBOW, bent, q)
    _put(K, HAND, turned - K[_TURN] - upper - bent, q)


@inner
def _turn(q: Array, seed: Array, limits: Array, K: Array) -> None:
    """Add whole turns to all joints except the slide, so that they are nearest to the seed, or inside their limits."""
    for joint in range(5):
        if K[joint] >= 0.0:
            turn(q, seed, limits, int(K[joint]), int(K[joint]) + 1)


@inner
def _choose(seed: Array, limits: Array, K: Array, G: Array, q: Array) -> tuple[bool, float]:
    """Write the branch of the smallest move; return whether any branch reaches the position, and the root.

    The branch with the side and elbow of the seed is solved first, the other branches only if they can still be better.
    In a path the elbow decides; hand and roll do not count, because an end stop may limit them.
    """
    n, H, trial, best = q.shape[0], room(3, 4), room(6), math.inf
    is_path, any_reaches = math.isfinite(limits[2, 0]), False
    one, other, is_side, root = _sides(G, K, seed)
    if abs(wrapped(one - _get(K, FIRST, seed))) > 0.5 * math.pi:
        one, other = other, one
    bent = _get(K, ELBOW, seed) + K[_BEND]
    for side in range(1 if K[FIRST] < 0.0 else 2):
        if side == 1 and abs(wrapped(other - _get(K, FIRST, seed))) >= best:
            break
        turned, x, y = _wrist(G, K, one if side == 0 else other, seed, H, trial)
        elbow, is_arm = _elbow(x, y, K[_UPPER], K[_FORE])
        elbow = math.copysign(elbow, bent)
        is_there = is_arm and is_side
        any_reaches = any_reaches or is_there
        for branch in range(2):
            if branch == 1 and abs(wrapped(-elbow - bent)) >= best:
                break
            _bend(turned, x, y, K, elbow if branch == 0 else -elbow, seed, trial)
            _turn(trial, seed, limits, K)
            cost = 0.0 if is_path else cost_of(trial[:n], seed, limits, 0, n, True)
            for joint in range(HAND if is_path else 0):
                cost = max(cost, abs(_get(K, joint, trial) - _get(K, joint, seed)))
            cost += 0.0 if is_there else 10.0 * OUTSIDE
            if cost < best:
                best = cost
                for i in range(n):
                    q[i] = trial[i]
    return any_reaches, root


@inner
def _hold(joint: int, seed: Array, limits: Array, K: Array, q: Array) -> None:
    """Add whole turns to a joint so that it is next to the seed, and clip it to its limits and its step."""
    place = int(K[joint])
    if place >= 0:
        turn(q, seed, limits, place, place + 1)
        hold(q, place, seed, limits)


@inner
def _settle(G: Array, seed: Array, limits: Array, K: Array, q: Array) -> None:
    """Clip a branch to limits and steps; each joint reduces the error that earlier joints leave."""
    H = room(3, 4)
    _hold(FIRST, seed, limits, K, q)
    turned, x, y = _wrist(G, K, _get(K, FIRST, q), seed, H, q)
    elbow = _get(K, ELBOW, q) + K[_BEND]
    near = _get(K, SHOULDER, seed)
    _put(K, SHOULDER, _shoulder(x, y, K[_UPPER], K[_FORE], elbow, near), q)
    _hold(SHOULDER, seed, limits, K, q)
    upper = _get(K, SHOULDER, q)
    # The elbow points link b from the actual end of link a to the wanted position.
    x, y = x - K[_UPPER] * math.cos(upper), y - K[_UPPER] * math.sin(upper)
    bent = _pointing(x, y, upper + _get(K, ELBOW, seed) + K[_BEND]) - upper - K[_BEND]
    _put(K, ELBOW, bent, q)
    _hold(ELBOW, seed, limits, K, q)
    _put(K, HAND, turned - K[_TURN] - upper - _get(K, ELBOW, q), q)
    _hold(HAND, seed, limits, K, q)
    _hold(ROLL, seed, limits, K, q)
    if K[_SLIDE] >= 0.0:
        hold(q, int(K[_SLIDE]), seed, limits)


@inner
def _is_met(G: Array, reached: Array, K: Array, q: Array) -> bool:
    """Whether position and attitude of the tip are reached in the directions that the arm controls."""
    now, M, H = room(3, 4), room(3, 4), room(3, 4)
    _wanted(reached, K, now)
    off = 0.0
    for i in range(3 if K[FIRST] >= 0.0 or K[_SLIDE] >= 0.0 else 2):
        off += (now[i, 3] - G[i, 3]) ** 2
    _seen(G, K, _get(K, FIRST, q), M, H)
    turned, roll = _sum(K, q), _get(K, ROLL, q)
    wanted, rolled = _attitude(H, K, turned, roll)
    angle = max(abs(wrapped(wanted - turned)), abs(wrapped(rolled - roll)))
    return math.sqrt(off) <= REACHED and angle <= REACHED


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (n,) next to ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`.

    Directions that the arm does not control are left as residual.
    """
    if not is_askable(T, seed):
        return -1
    K, G, reached = geometry[candidates.constants_at(q.shape[0]) :], room(3, 4), room(4, 4)
    _wanted(T, K, G)
    is_reachable, root = _choose(seed, limits, K, G, q)
    if not is_allowed(q, seed, limits):
        _settle(G, seed, limits, K, q)
    fk(q, geometry, reached)
    if not (pose_residual(reached, T, residual) or _is_met(G, reached, K, q)):
        return _LIMITED if is_reachable else _UNREACHABLE
    is_near = abs(math.sin(_get(K, ELBOW, q) + K[_BEND])) < _NEAR
    is_near = is_near or root < _NEAR * (K[_UPPER] + K[_FORE])
    return _NEAR_SINGULAR if is_near else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the branches (k, n) of the whole pose, positive elbow first; return their number.

    A pose that the arm cannot reach in all six directions has no branch.
    """
    n, count = solutions.shape[1], 0
    K, G, H = geometry[candidates.constants_at(n) :], room(3, 4), room(3, 4)
    reached, residual, free = room(4, 4), room(2), room(6)
    for i in range(6):
        free[i] = 0.0
    _wanted(T, K, G)
    one, other, is_side, _ = _sides(G, K, free)
    for branch in range(2 if K[FIRST] < 0.0 else 4):
        q = solutions[count]
        turned, x, y = _wrist(G, K, one if branch < 2 else other, free, H, q)
        elbow, is_arm = _elbow(x, y, K[_UPPER], K[_FORE])
        _bend(turned, x, y, K, elbow if branch % 2 == 0 else -elbow, free, q)
        for joint in range(5):
            if K[joint] >= 0.0:
                q[int(K[joint])] = wrapped(q[int(K[joint])])
        fk(q, geometry, reached)
        if is_arm and is_side and pose_residual(reached, T, residual):
            count += 1
    return count
