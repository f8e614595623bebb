"""Assemblies of the 3-RPS: the assembly nearest to a seed, and the search for other assemblies, as kernels.

For a given theta1, two loop equations give theta2 and theta3 with two signs each, which makes four starts. For values
of theta1 spread over half a turn, leg angles are moved from these starts to values at which the loop closes. The other
half turn gives the mirror images below the base.

Source:
    Lee and Shah 1988; Ghosal 2020, lectures 6 and 11. The search is derived from these sources.
"""

import math

import numpy as np

from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array, rotation_angle_between
from teleop_core.kinematics import MAX_ASSEMBLIES, REACHED, SEARCH_ALL, FkStatus
from teleop_machines.rps3_loop import COSINES, SINES, frame, loop, points, settle

# With a smaller volume of the three unit rows of the loop equations, the legs hardly determine the platform's pose.
_NEAR = 1e-3
WAY = 48  # number of steps of the path from a seed
# Rotation [rad] above which the path is followed. Of 7300 random triples with a least-squares pose nearer than 0.6 rad,
# all had this pose at the path's end.
FAR = 0.5
_SAME = 1e-6  # assemblies with a smaller difference are equal [rad]
_CLOSED, _NEAR_SINGULAR = int(FkStatus.CLOSED), int(FkStatus.NEAR_SINGULAR)
_OTHER_MODE, _NOT_CLOSED = int(FkStatus.OTHER_MODE), int(FkStatus.NOT_CLOSED)


@inner
def lean(q: Array, geometry: Array, theta: Array) -> None:
    """Write leg angles (3,) [rad] of legs (3,) [m] that lean in by b - a each."""
    b, a = geometry[0], geometry[1]
    for i in range(3):
        theta[i] = math.acos(min(max((b - a) / max(q[i], 1e-9), -1.0), 1.0))


@inner
def volume(q: Array, theta: Array, b: float, a: float) -> float:
    """Determinant of the unit rows of the loop equations' slopes, -1 to 1; 0 at a singular pose.

    The platform is on the same side of the singular poses as home if the value is above 0.
    """
    gap, G = np.empty(3), np.empty((3, 3))
    loop(q, theta, b, a, gap, G)
    scale = 1.0
    for k in range(3):
        scale *= math.sqrt(G[k, k] ** 2 + G[k, (k + 1) % 3] ** 2)
    # Row k has no slope along angle k + 2, so only two of the determinant's six products remain.
    determinant = G[0, 0] * G[1, 1] * G[2, 2] + G[0, 1] * G[1, 2] * G[2, 0]
    return float(determinant / max(scale, 1e-300))


@inner
def is_near_singular(q: Array, theta: Array, b: float, a: float) -> bool:
    """Whether the legs hardly determine the pose: the unit rows of the loop equations span a small volume."""
    return bool(abs(volume(q, theta, b, a)) < _NEAR)


@inner
def open_by(q: Array, theta: Array, b: float, a: float, S: Array) -> float:
    """Write the ball joints (3, 3) [m]; return the largest error of a distance between them [m]."""
    points(q, theta, b, S)
    worst = 0.0
    for i in range(3):
        j, square = (i + 1) % 3, 0.0
        for r in range(3):
            square += (S[i, r] - S[j, r]) ** 2
        worst = max(worst, abs(math.sqrt(square) - math.sqrt(3.0) * a))
    return worst


@inner
def joints_at(T: Array, a: float, S: Array) -> None:
    """Write the ball joints (3, 3) [m] of a platform at T (4, 4)."""
    for i in range(3):
        c, s = a * COSINES[i], a * SINES[i]
        for r in range(3):
            S[i, r] = T[r, 3] + T[r, 0] * c + T[r, 1] * s


@inner
def angles_of(T: Array, b: float, a: float, q: Array, theta: Array) -> None:
    """Write leg lengths (3,) [m] and angles (3,) [rad] of a platform at T (4, 4)."""
    S = np.empty((3, 3))
    joints_at(T, a, S)
    for i in range(3):
        inward = b - S[i, 0] * COSINES[i] - S[i, 1] * SINES[i]
        theta[i], q[i] = math.atan2(S[i, 2], inward), math.sqrt(inward * inward + S[i, 2] ** 2)


@inner
def _others(q: Array, b: float, a: float, theta1: float, pairs: Array) -> None:
    """Write the two possible angles of leg 2, and of leg 3, (2, 2) [rad] for an angle of the first leg.

    They are the roots of P cos + Q sin + R = 0; if there is no root, the angle of least error is written twice.
    """
    c, s = math.cos(theta1), math.sin(theta1)
    for leg in range(2):
        other = q[1 + leg]
        P, Q = other * (q[0] * c - 3.0 * b), -2.0 * q[0] * other * s
        R = 3.0 * (b * b - a * a) + q[0] * q[0] + other * other - 3.0 * b * q[0] * c
        middle = math.atan2(Q, P)
        half = math.acos(min(max(-R / max(math.hypot(P, Q), 1e-300), -1.0), 1.0))
        pairs[leg, 0], pairs[leg, 1] = middle + half, middle - half


@inner
def _is_known(found: Array, count: int, theta: Array) -> bool:
    for k in range(count):
        far = 0.0
        for i in range(3):
            far = max(far, abs(math.sin(0.5 * (found[k, i] - theta[i]))))
        if far <= 0.5 * _SAME:
            return True
    return False


@kernel
def closing_angles(q: Array, b: float, a: float, starts: int, found: Array) -> int:
    """Write leg angles of all assemblies that the search finds, above and below the base.

    Args:
        q: Leg lengths (3,) [m].
        b: Distance of the hinges from the base centre [m].
        a: Distance of the ball joints from the platform centre [m].
        starts: Starts of the search, four for each angle of the first leg.
        found: Output array for leg angles (MAX_ASSEMBLIES, 3) [rad].

    Returns:
        Number of assemblies found.
    """
    count, pairs, S, theta = 0, np.empty((2, 2)), np.empty((3, 3)), np.empty(3)
    for k in range(4 * (starts // 4)):
        if k % 4 == 0:
            first = math.pi * (k // 4 + 0.5) / (starts // 4)
            _others(q, b, a, first, pairs)
        theta[0], theta[1], theta[2] = first, pairs[0, k % 2], pairs[1, (k // 2) % 2]
        settle(q, b, a, theta)
        if open_by(q, theta, b, a, S) > REACHED:
            continue
        for _ in range(2):
            if count < MAX_ASSEMBLIES and not _is_known(found, count, theta):
                for i in range(3):
                    found[count, i] = theta[i]
                count += 1
            for i in range(3):
                theta[i] = -theta[i]
    return count


@inner
def _nearest(q: Array, b: float, a: float, starts: int, near: Array, theta: Array) -> bool:
    """Write leg angles (3,) of the assembly with ball joints nearest to ``near`` (3, 3); return whether it exists."""
    found, S = np.empty((MAX_ASSEMBLIES, 3)), np.empty((3, 3))
    best, chosen = math.inf, -1
    for k in range(closing_angles(q, b, a, starts, found)):
        points(q, found[k], b, S)
        far = 0.0
        for i in range(3):
            for r in range(3):
                far += (S[i, r] - near[i, r]) ** 2
        if far < best:
            best, chosen = far, k
    if chosen >= 0:
        for i in range(3):
            theta[i] = found[chosen, i]
    return chosen >= 0


@inner
def _lead(q: Array, first: Array, b: float, a: float, side: float, theta: Array) -> bool:
    """Move leg angles (3,) of an assembly with legs ``first`` along the straight path to legs q.

    Returns:
        Whether the end was reached: the loop closes on the whole path, on one side of the singular poses.
    """
    now, before, S = np.empty(3), np.empty(3), np.empty((3, 3))
    for k in range(1, WAY + 1):
        for i in range(3):
            now[i], before[i] = first[i] + k / WAY * (q[i] - first[i]), theta[i]
        settle(now, b, a, theta)
        if open_by(now, theta, b, a, S) > REACHED or volume(now, theta, b, a) * side < 0.0:
            return False
        for i in range(3):
            if abs(theta[i] - before[i]) > FAR:
                return False
    return True


@inner
def _at_seed(g: Array, ask: Array, T: Array, first: Array, theta: Array) -> float:
    """Write legs (3,) and angles (3,) of the seed or of home, and T of home. Return their side of the singular poses.

    On home's side, :func:`volume` is above 0.
    """
    if ask[1] > 0.0:
        angles_of(T, g[0], g[1], first, theta)
        return float(volume(first, theta, g[0], g[1]))
    first[:] = g[2]
    lean(first, g, theta)
    for r in range(4):
        for c in range(4):
            T[r, c] = 1.0 if r == c else 0.0
    T[2, 3] = first[0] * math.sin(theta[0])
    return 1.0


@inner
def _far(q: Array, first: Array, g: Array, starts: int, side: float, T: Array, seed: Array, theta: Array) -> int:
    """Replace leg angles (3,) by those at the end of the path from the seed, else by the nearest assembly found."""
    if _lead(q, first, g[0], g[1], side, seed):
        theta[:] = seed
        return _CLOSED
    if starts > 0:
        S = np.empty((3, 3))
        joints_at(T, g[1], S)
        _nearest(q, g[0], g[1], starts, S, theta)
    return _OTHER_MODE


@kernel
def assemble(q: Array, geometry: Array, ask: Array, T: Array, out: Array) -> int:
    """Write ``T_base_tip`` of leg lengths (3,) [m]; see :class:`kinematics.Kernels`."""
    b, a, S, pose = geometry[0], geometry[1], np.empty((3, 3)), np.empty((4, 4))
    first, seed, theta = np.empty(3), np.empty(3), np.empty(3)
    side = _at_seed(geometry, ask, T, first, seed)
    theta[:] = seed
    if ask[1] == 0.0:
        lean(q, geometry, theta)
    settle(q, b, a, theta)
    out[0], found = open_by(q, theta, b, a, S), volume(q, theta, b, a)
    frame(S, pose)
    is_same = found * side > 0.0 or min(abs(found), abs(side)) < _NEAR
    status = _CLOSED
    if out[0] > REACHED or not is_same or rotation_angle_between(T, pose) > FAR:
        status = _far(q, first, geometry, int(ask[0]), side, T, seed, theta)
        out[0], found = open_by(q, theta, b, a, S), volume(q, theta, b, a)
        frame(S, pose)
    T[:] = pose
    out[1] = math.copysign(1.0, found)
    if out[0] > REACHED:
        return _NOT_CLOSED
    return _NEAR_SINGULAR if status == _CLOSED and abs(found) < _NEAR else status


@kernel
def assemblies(q: Array, geometry: Array, found: Array) -> int:
    """Write all ``T_base_tip`` of leg lengths (3,) [m]; see :class:`kinematics.Kernels`."""
    angles, S = np.empty((MAX_ASSEMBLIES, 3)), np.empty((3, 3))
    count = closing_angles(q, geometry[0], geometry[1], SEARCH_ALL, angles)
    for k in range(count):
        points(q, angles[k], geometry[0], S)
        frame(S, found[k])
    return count
