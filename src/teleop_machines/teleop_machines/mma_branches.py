"""Closed-form family of the MMA: all joint vectors that reach a pose, by θ10 and branch.

A given θ10 determines the other six joints, in eight branches: shoulder in front or behind, wrist flipped or not, elbow
on one side or the other.

Source:
    The thesis has no inverse kinematics; derived here from Singh 2014, eq. 4.81 corrected.
"""

import math

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_machines.mma_forward import groups

BRANCHES = 8
_ROUNDING = 1e-12  # a point that is out of reach by less counts as reached [m]


@inner
def _wrist_centre(T: Array, turn: float, geometry: Array, out: Array) -> None:
    """Write rows (4, 3) for θ10 = ``turn``: the point where axes 6 and 8 meet [m], K, column 1, X."""
    _, S, F, G = groups(geometry)
    c10, s10 = math.cos(turn), math.sin(turn)
    c12, s12 = math.cos(geometry[12]), math.sin(geometry[12])
    for i in range(3):
        column1 = c12 * T[i, 0] - s12 * T[i, 1]
        column2 = s12 * T[i, 0] + c12 * T[i, 1]
        K = c10 * column2 + s10 * T[i, 2]
        out[0, i] = T[i, 3] - F * column1 - G * T[i, 2] - S * K
        out[1, i], out[2, i] = K, column1
        out[3, i] = c10 * T[i, 2] - s10 * column2


@inner
def _shoulder(wrist: Array, is_back: bool, geometry: Array, seed: Array, q: Array) -> float:
    """Write θ1. Return the radius of the arm in its plane [m]; NaN if axis 6 cannot pass through the wrist centre.

    The distance of the arm's plane from the base axis is a5. If the wrist centre is on the base axis, θ1 keeps the
    value of the seed.
    """
    x, y, a5 = wrist[0, 0], wrist[0, 1], geometry[4]
    square = x * x + y * y - a5 * a5
    if square < -_ROUNDING * a5:
        return math.nan
    radius = math.sqrt(max(square, 0.0))
    if is_back:
        radius = -radius
    q[0] = seed[0]
    if x != 0.0 or y != 0.0:
        q[0] = math.atan2(y, x) - math.atan2(-a5, radius)
    return float(radius)


@inner
def _wrist(wrist: Array, is_flipped: bool, seed: Array, q: Array) -> float:
    """Write θ6 and θ8 for a given θ1; returns θ23.

    If axis 8 is normal to the plane of the arm, every θ23 is possible, and the seed's value is kept.
    """
    c1, s1 = math.cos(q[0]), math.sin(q[0])
    K, column1, X = wrist[1], wrist[2], wrist[3]
    sine, cosine = c1 * K[0] + s1 * K[1], K[2]
    c6 = math.hypot(sine, cosine)
    pitch = seed[1] + seed[2]
    if c6 > 1e-10:
        pitch = math.atan2(-sine, -cosine) if is_flipped else math.atan2(sine, cosine)
    q[4] = math.atan2(s1 * K[0] - c1 * K[1], -c6 if is_flipped else c6)
    c, s = math.cos(pitch), math.sin(pitch)
    x, y, z = c1 * c, s1 * c, -s
    q[5] = math.atan2(column1[0] * x + column1[1] * y + column1[2] * z, X[0] * x + X[1] * y + X[2] * z)
    return float(pitch)


@inner
def _miss(radius: float, height: float, geometry: Array) -> float:
    """Distance [m] by which a point in the plane of the arm is out of reach of the two long links."""
    a2, a3 = geometry[1], geometry[2]
    distance = math.hypot(radius, height)
    miss = max(distance - a2 - a3, abs(a2 - a3) - distance)
    return float(miss) if miss > _ROUNDING else 0.0


@inner
def _elbow(radius: float, height: float, is_other: bool, geometry: Array, seed: Array, q: Array) -> None:
    """Write θ2 and θ3' of the two long links; the links are stretched or folded if the point is out of reach."""
    a2, a3 = geometry[1], geometry[2]
    square = radius * radius + height * height
    cosine = min(max((square - a2 * a2 - a3 * a3) / (2.0 * a2 * a3), -1.0), 1.0)
    sine = math.sqrt(1.0 - cosine * cosine)
    if is_other:
        sine = -sine
    q[3] = math.atan2(sine, cosine)
    q[1] = seed[1]
    if square > 1e-24:
        q[1] = math.atan2(height, radius) - math.atan2(a3 * sine, a2 + a3 * cosine)


@kernel
def branch(T: Array, turn: float, choice: int, geometry: Array, seed: Array, q: Array) -> float:
    """Write joints (7,) of one branch with θ10 = ``turn``, not wrapped.

    Args:
        T: Wanted ``T_base_tip`` (4, 4).
        turn: θ10 [rad].
        choice: 0 to 7; bit 0 shoulder behind, bit 1 wrist flipped, bit 2 other elbow.
        geometry: Row of the robot.
        seed: Joints (7,) whose values are kept where the pose leaves a joint free.
        q: Output (7,); for a point out of reach, the links are stretched or folded towards it.

    Returns:
        0 if the joints reach the pose, else the remaining distance of the wrist [m]; infinity if the wrist centre
        is inside the cylinder of radius a5 about axis 1.
    """
    wrist = np.empty((4, 3))
    _wrist_centre(T, turn, geometry, wrist)
    radius = _shoulder(wrist, choice & 1 != 0, geometry, seed, q)
    if math.isnan(radius):
        return math.inf
    pitch = _wrist(wrist, choice & 2 != 0, seed, q)
    H = geometry[3] + geometry[6]
    radius -= H * math.cos(pitch)
    height = geometry[0] - wrist[0, 2] - H * math.sin(pitch)
    _elbow(radius, height, choice & 4 != 0, geometry, seed, q)
    q[2], q[6] = pitch - q[1], turn
    return float(_miss(radius, height, geometry))


@kernel
def moved(angle: float, i: int, seed: Array, limits: Array) -> float:
    """Angle of joint ``i``, shifted by full turns to the value nearest to the seed, within limits if possible [rad]."""
    near = angle + 2.0 * math.pi * round((seed[i] - angle) / (2.0 * math.pi))
    if near < limits[0, i]:
        near += 2.0 * math.pi
    elif near > limits[1, i]:
        near -= 2.0 * math.pi
    return float(near)


@kernel
def unwrapped(q: Array, seed: Array, limits: Array) -> float:
    """Shift angles (7,) by full turns to be nearest to the seed, inside the limits if possible.

    Returns:
        Largest joint move from the seed [rad]; infinity if a joint is outside its limits.
    """
    worst = 0.0
    for i in range(7):
        q[i] = moved(q[i], i, seed, limits)
        worst = max(worst, abs(q[i] - seed[i]))
        if q[i] < limits[0, i] or q[i] > limits[1, i]:
            worst = math.inf
    return float(worst)


@inner
def nearest_branch(
    T: Array, turn: float, seed: Array, limits: Array, geometry: Array, best: float, found: Array
) -> float:
    """Search the branches with θ10 = ``turn`` for a branch nearer to the seed than ``best``.

    Returns:
        Largest joint move of the branch that is written as (θ10, choice) to ``found``; ``best`` if there is none.
    """
    q, wrist, H = np.empty(7), np.empty((4, 3)), geometry[3] + geometry[6]
    _wrist_centre(T, turn, geometry, wrist)
    for choice in range(4):
        radius = _shoulder(wrist, choice & 1 != 0, geometry, seed, q)
        if math.isnan(radius) or abs(moved(q[0], 0, seed, limits) - seed[0]) >= best:
            continue
        pitch = _wrist(wrist, choice & 2 != 0, seed, q)
        if abs(moved(q[4], 4, seed, limits) - seed[4]) >= best:
            continue
        radius -= H * math.cos(pitch)
        height = geometry[0] - wrist[0, 2] - H * math.sin(pitch)
        if _miss(radius, height, geometry) > 0.0:
            continue
        for elbow in range(2):
            _elbow(radius, height, elbow == 1, geometry, seed, q)
            q[2], q[6] = pitch - q[1], turn
            cost = unwrapped(q, seed, limits)
            if cost < best:
                best, found[0], found[1] = cost, turn, float(choice + 4 * elbow)
    return float(best)


@inner
def least_miss(T: Array, turn: float, seed: Array, geometry: Array, least: float, found: Array) -> float:
    """Search the branches with θ10 = ``turn`` for a branch whose remaining distance is less than ``least`` [m].

    Returns:
        Remaining distance of the branch that is written as (θ10, choice) to ``found``; ``least`` if there is none.
    """
    q, wrist, H = np.empty(7), np.empty((4, 3)), geometry[3] + geometry[6]
    _wrist_centre(T, turn, geometry, wrist)
    for choice in range(4):  # the two elbows reach equally far
        radius = _shoulder(wrist, choice & 1 != 0, geometry, seed, q)
        if math.isnan(radius):
            break
        pitch = _wrist(wrist, choice & 2 != 0, seed, q)
        radius -= H * math.cos(pitch)
        height = geometry[0] - wrist[0, 2] - H * math.sin(pitch)
        miss = _miss(radius, height, geometry)
        if miss < least:
            least, found[0], found[1] = miss, turn, float(choice)
    return float(least)
