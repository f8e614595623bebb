"""Assemblies of six legs: the assembly nearest to a seed, and the search for other assemblies, as kernels.

The search moves a platform from starts, which are spread evenly over orientations and positions, to poses at which the
legs close. If leg lengths have an assembly, at least a quarter of the starts find one. So the probability that none of
64 starts finds one is 1e-8.

Source:
    Roberts 2018 (even spread, the R sequence); Shoemake 1992 (even attitudes).
"""

import math

import numpy as np

from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array, rotation_angle_between
from teleop_core.kinematics import MAX_ASSEMBLIES, REACHED, FkStatus
from teleop_core.kinematics.damped import is_near_singular
from teleop_machines.stewart_legs import direct, leg_system

# A pose is close to singular if the smallest singular value of its leg Jacobian, divided by the largest, is smaller.
NEAR = 1e-3
# Root of x^6 = x + 1; its powers spread points evenly in five dimensions.
_ROOT = 1.1347241384015194
WAY = 48  # number of steps of the path from a seed
# Rotation [rad] above which the path is followed. Of 4300 random leg sets with a least-squares pose nearer than
# 0.6 rad, all had this pose at the path's end.
FAR = 0.5
_SAME = 1e-6  # assemblies with a smaller difference are equal [rad, share of the platform's size]
_CLOSED, _NEAR_SINGULAR = int(FkStatus.CLOSED), int(FkStatus.NEAR_SINGULAR)
_OTHER_MODE, _NOT_CLOSED = int(FkStatus.OTHER_MODE), int(FkStatus.NOT_CLOSED)


@inner
def side_of(J: Array) -> float:
    """Sign of the determinant of J (6, 6); 0 if a pivot is 0. J is overwritten."""
    sign = 1.0
    for k in range(6):
        best = k
        for i in range(k + 1, 6):
            if abs(J[i, k]) > abs(J[best, k]):
                best = i
        if J[best, k] == 0.0:
            return 0.0
        if best != k:
            sign = -sign
            for j in range(k, 6):
                J[k, j], J[best, j] = J[best, j], J[k, j]
        sign = math.copysign(sign, sign * J[k, k])
        for i in range(k + 1, 6):
            share = J[i, k] / J[k, k]
            for j in range(k, 6):
                J[i, j] -= share * J[k, j]
    return sign


@inner
def _start(k: int, reach: float, base: Array, platform: Array, T: Array) -> None:
    """Write start k of the search (4, 4): any attitude, centres of base and platform ``reach`` [m] apart."""
    u = np.empty(5)
    for i in range(5):
        u[i] = (0.5 + (k + 1) * _ROOT ** -(i + 1.0)) % 1.0
    a, b = math.sqrt(1.0 - u[0]), math.sqrt(u[0])
    w, x = a * math.sin(2.0 * math.pi * u[1]), a * math.cos(2.0 * math.pi * u[1])
    y, z = b * math.sin(2.0 * math.pi * u[2]), b * math.cos(2.0 * math.pi * u[2])
    T[0, 0], T[0, 1], T[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    T[1, 0], T[1, 1], T[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    T[2, 0], T[2, 1], T[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    height = 2.0 * u[3] - 1.0
    width = reach * math.sqrt(1.0 - height * height)
    T[0, 3] = width * math.cos(2.0 * math.pi * u[4])
    T[1, 3], T[2, 3] = width * math.sin(2.0 * math.pi * u[4]), reach * height
    for r in range(3):
        T[3, r] = 0.0
        for i in range(6):
            T[r, 3] += base[i, r] / 6.0
            for c in range(3):
                T[r, 3] -= T[r, c] * platform[i, c] / 6.0
    T[3, 3] = 1.0


@inner
def _away(T: Array, other: Array, size: float) -> float:
    """Sum of the angle [rad] and the distance, divided by ``size``, between two poses."""
    square = 0.0
    for r in range(3):
        square += (T[r, 3] - other[r, 3]) ** 2
    return rotation_angle_between(T, other) + math.sqrt(square) / size


@kernel
def closing_poses(legs: Array, base: Array, platform: Array, size: float, starts: int, found: Array) -> int:
    """Write all poses with these leg lengths that the search finds.

    Args:
        legs: Leg lengths (6,) [m].
        base: Base joints (6, 3) [m].
        platform: Platform joints (6, 3) [m].
        size: Length [m] that counts as much as one radian.
        starts: Number of starts of the search.
        found: Output array for poses (MAX_ASSEMBLIES, 4, 4).

    Returns:
        Number of poses found.
    """
    count, reach, T = 0, 0.0, np.empty((4, 4))
    for i in range(6):
        reach += legs[i] / 6.0
    for k in range(starts):
        _start(k, reach, base, platform, T)
        if direct(legs, base, platform, size, False, T) > REACHED or count == MAX_ASSEMBLIES:
            continue
        is_new = True
        for j in range(count):
            is_new = is_new and _away(T, found[j], size) > _SAME
        if is_new:
            found[count] = T
            count += 1
    return count


@inner
def _nearest(legs: Array, base: Array, platform: Array, size: float, starts: int, T: Array) -> bool:
    """Replace a pose by the nearest pose that the search finds; return whether it finds one."""
    found, best, chosen = np.empty((MAX_ASSEMBLIES, 4, 4)), math.inf, -1
    for k in range(closing_poses(legs, base, platform, size, starts, found)):
        far = _away(T, found[k], size)
        if far < best:
            best, chosen = far, k
    if chosen >= 0:
        T[:] = found[chosen]
    return chosen >= 0


@inner
def _is_singular(T: Array, base: Array, platform: Array, size: float, lengths: Array, J: Array) -> tuple[bool, float]:
    """Write leg lengths (6,) [m].

    Return whether the legs hardly determine the pose, and the pose's side of the singular poses.
    """
    leg_system(T, base, platform, lengths, J)
    is_near = bool(is_near_singular(J.T, 1.0 / size, NEAR * 2.0 * size))
    return is_near, side_of(J)


@inner
def _lead(legs: Array, base: Array, platform: Array, size: float, side: float, T: Array) -> bool:
    """Move a closed pose (4, 4) along the straight path of its leg lengths to other lengths (6,).

    Returns:
        Whether the end was reached: the legs close on the whole path, on one side of the singular poses.
    """
    first, now, J, before = np.empty(6), np.empty(6), np.empty((6, 6)), np.empty((4, 4))
    leg_system(T, base, platform, first, J)
    for k in range(1, WAY + 1):
        before[:] = T
        for i in range(6):
            now[i] = first[i] + k / WAY * (legs[i] - first[i])
        if direct(now, base, platform, size, False, T) > REACHED:
            return False
        if rotation_angle_between(before, T) > FAR:
            return False
        leg_system(T, base, platform, now, J)
        if side_of(J) * side < 0.0:
            return False
    return True


@kernel
def close_legs(
    legs: Array, base: Array, platform: Array, size: float, starts: int, side: float, T: Array, out: Array
) -> int:
    """Move a pose to the nearest assembly with the given leg lengths.

    This is the assembly at the end of the straight path of the leg lengths, if the legs close on the whole path. If the
    least-squares pose is near the seed, this pose is used; otherwise the path is followed in :data:`WAY` steps.

    Args:
        legs: Leg lengths (6,) [m].
        base: Base joints (6, 3) [m].
        platform: Platform joints (6, 3) [m].
        size: Length [m] that counts as much as one radian.
        starts: Number of starts of the search that follows if the legs do not close on the path.
        side: Sign of the leg Jacobian's determinant at the seed; 0 if it must be computed.
        T: Seed, then result (4, 4); the pose of least error if no pose closes.
        out: Written (2,): largest error of a leg [m], then the sign of the leg Jacobian's determinant.

    Returns:
        :class:`FkStatus`.
    """
    J, lengths, seed, trial = np.empty((6, 6)), np.empty(6), np.empty((4, 4)), np.empty((4, 4))
    seed[:], trial[:] = T, T
    if side == 0.0:
        leg_system(T, base, platform, lengths, J)
        side = side_of(J)
    status, out[0] = _OTHER_MODE, direct(legs, base, platform, size, False, T)
    is_near, out[1] = _is_singular(T, base, platform, size, lengths, J)
    is_same = out[1] * side > 0.0 or is_near
    if not is_same:  # a seed on a singular pose is on neither side
        is_same = _is_singular(seed, base, platform, size, lengths, J)[0]
    if out[0] <= REACHED and is_same and rotation_angle_between(seed, T) <= FAR:
        return _NEAR_SINGULAR if is_near else _CLOSED
    if _lead(legs, base, platform, size, side, trial):
        T[:], status = trial, _CLOSED
    elif starts > 0:
        trial[:] = seed
        if _nearest(legs, base, platform, size, starts, trial):
            T[:] = trial
    is_near, out[1] = _is_singular(T, base, platform, size, lengths, J)
    out[0] = 0.0
    for i in range(6):
        out[0] = max(out[0], abs(lengths[i] - legs[i]))
    if out[0] > REACHED:
        return _NOT_CLOSED
    return _NEAR_SINGULAR if is_near and status == _CLOSED else status
