"""Orientation of the hybrid's platform: the layout of its legs, and the orientation for six leg lengths.

Leg i = 1..6 is at the angle 60° (i - 1). Base joints are shifted by ∓sigma_b and platform joints by ±sigma_m (upper
sign for odd i). The published layout has no shifts: two similar hexagons in line, which is architecturally singular.
Its legs determine the orientation only because the platform's centre is fixed at (0, 0, w_z). Leg lengths never show
whether a level platform is rotated left or right.

With a fixed centre, squared leg lengths are linear in the upper left block and the third row of R. The symmetry of the
layout splits the six equations into sums that are solved by hand.

Source:
    Kucuk and Gungor 2016, eqs. 17-25 (legs). The orientation from leg lengths is derived from these equations.
"""

import math

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kinematics import AGREED, FkStatus
from teleop_machines import stewart_legs, stewart_search

# With a smaller sine of sigma_b + sigma_m, the layout counts as similar hexagons.
_SIMILAR = 1e-9
# Cosines and sines of 60° (i - 1).
_COSINES = (1.0, 0.5, -0.5, -1.0, -0.5, 0.5)
_SINES = (0.0, math.sqrt(0.75), math.sqrt(0.75), 0.0, -math.sqrt(0.75), -math.sqrt(0.75))
# Largest sum of squared leg errors, divided by r_m², that rounding causes for consistent leg lengths.
_AGREED = 1e-29
# Sine of the largest tilt of the platform, 75°, the assumed limit of its ball joints.
TILT = math.sin(math.radians(75.0))
_CLOSED, _NEAR_SINGULAR = int(FkStatus.CLOSED), int(FkStatus.NEAR_SINGULAR)
_OTHER_MODE, _NOT_CLOSED = int(FkStatus.OTHER_MODE), int(FkStatus.NOT_CLOSED)


@inner
def is_similar(sigma_b: float, sigma_m: float) -> bool:
    """Whether base and platform joints are similar hexagons: architecturally singular."""
    return abs(math.sin(sigma_b + sigma_m)) < _SIMILAR


@inner
def _joint(i: int, radius: float, c: float, s: float) -> tuple[float, float]:
    """Position of a leg's joint on its circle [m]; for odd legs shifted back by the angle with cosine c and sine s."""
    sign = 1.0 if i % 2 == 0 else -1.0
    return (radius * (_COSINES[i] * c + sign * _SINES[i] * s), radius * (_SINES[i] * c - sign * _COSINES[i] * s))


@kernel
def leg_lengths(T: Array, g: Array, legs: Array) -> float:
    """Write leg lengths (6,) [m] of a platform pose (4, 4).

    Returns:
        Root mean square of the leg speeds, divided by the angular speed of the platform about the vertical [m].
    """
    cb, sb, cm, sm = math.cos(g[3]), math.sin(g[3]), math.cos(g[4]), math.sin(g[4])
    turning = 0.0
    for i in range(6):
        bx, by = _joint(i, g[0], cb, sb)
        mx, my = _joint(i, g[1], cm, -sm)
        x, y = T[0, 0] * mx + T[0, 1] * my, T[1, 0] * mx + T[1, 1] * my
        dx, dy = T[0, 3] + x - bx, T[1, 3] + y - by
        dz = T[2, 3] + T[2, 0] * mx + T[2, 1] * my
        square = dx * dx + dy * dy + dz * dz
        legs[i] = math.sqrt(square)
        turning += (x * dy - y * dx) ** 2 / max(square, 1e-300)
    return math.sqrt(turning / 6.0)


@inner
def leg_slopes(T: Array, g: Array, J: Array) -> None:
    """Write the leg Jacobian (6, 6) of a platform pose (4, 4)."""
    joints, legs = np.empty((2, 6, 3)), np.empty(6)
    layout(g, joints)
    stewart_legs.leg_system(T, joints[0], joints[1], legs, J)


@inner
def layout(g: Array, joints: Array) -> None:
    """Write base joints and platform joints of the legs (2, 6, 3) [m]."""
    cb, sb, cm, sm = math.cos(g[3]), math.sin(g[3]), math.cos(g[4]), math.sin(g[4])
    for i in range(6):
        joints[0, i, 0], joints[0, i, 1] = _joint(i, g[0], cb, sb)
        joints[1, i, 0], joints[1, i, 1] = _joint(i, g[1], cm, -sm)
        joints[0, i, 2] = joints[1, i, 2] = 0.0


@kernel
def turned_and_tilted(turn: float, x: float, y: float, T: Array) -> None:
    """Write the rotation of T: Rz(turn) after the smallest tilt whose third row begins with x, y."""
    z = math.sqrt(max(1.0 - x * x - y * y, 0.0))
    c, s = math.cos(turn), math.sin(turn)
    t11, t12, t22 = 1.0 - x * x / (1.0 + z), -x * y / (1.0 + z), 1.0 - y * y / (1.0 + z)
    T[0, 0], T[0, 1], T[0, 2] = c * t11 - s * t12, c * t12 - s * t22, -c * x + s * y
    T[1, 0], T[1, 1], T[1, 2] = s * t11 + c * t12, s * t12 + c * t22, -s * x - c * y
    T[2, 0], T[2, 1], T[2, 2] = x, y, z


@inner
def wanted_platform(T: Array, heading: float, w_z: float, platform: Array) -> None:
    """Write the platform pose in the Stewart base for T's attitude; the tilt is clipped to its limit."""
    c, s = math.cos(heading), math.sin(heading)
    for j in range(3):
        x, y = T[0, j], T[1, j]
        platform[0, j], platform[1, j], platform[2, j] = c * x + s * y, c * y - s * x, T[2, j]
        platform[j, 3] = platform[3, j] = 0.0
    platform[2, 3], platform[3, 3] = w_z, 1.0
    x, y = T[2, 0], T[2, 1]
    sine = math.hypot(x, y)
    if T[2, 2] > 0.0 and sine <= TILT:
        return
    turn = math.atan2(platform[1, 0] - platform[0, 1], platform[0, 0] + platform[1, 1])
    if sine < 1e-9:  # for an upside-down attitude, all tilt directions are equally near
        x, y, sine = 1.0, 0.0, 1.0
    turned_and_tilted(turn, TILT / sine * x, TILT / sine * y, platform)


@inner
def _turn_of_hexagons(cosine: float, z1: complex, tilt: complex, up: float) -> float:
    """Rotation of a platform of similar hexagons, from its cosine and from the direction of the tilt.

    z1 = -e^(i turn) tilt² / (2 (1 + up)) gives the sign, and the sine if it is small relative to the square of the
    tilt. For a level platform the sign is unknown, and plus is used.
    """
    square = tilt.real * tilt.real + tilt.imag * tilt.imag
    seen = (-2.0 * (1.0 + up) * z1 * (tilt * tilt).conjugate()).imag
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    if sine >= square:
        return math.atan2(math.copysign(sine, seen), cosine)
    most = max(2.0 * sine, square)
    return math.atan2(min(max(seen / (square * square), -most), most), cosine)


@inner
def _sums(legs: Array, constant: float, half: int) -> tuple[float, complex]:
    """Mean and first harmonic of (squared leg length - ``constant``), for odd legs (half 0) or even legs (half 1)."""
    mean, x, y = 0.0, 0.0, 0.0
    for i in range(half, 6, 2):
        value = (legs[i] * legs[i] - constant) / 3.0
        mean, x, y = mean + value, x + value * _COSINES[i], y + value * _SINES[i]
    return mean, complex(x, y)


@kernel
def orientation(legs: Array, g: Array, T: Array) -> None:
    """Write the platform pose for legs (6,) [m] if the platform's centre is at (0, 0, w_z).

    Args:
        legs: Leg lengths (6,) [m]; for inconsistent legs, an approximate orientation is written.
        g: r_b, r_m, w_z [m], sigma_b, sigma_m [rad].
        T: Pose of the platform in the Stewart base (4, 4), written; its z axis points up.
    """
    r_b, r_m, w_z, sigma_b, sigma_m = g[0], g[1], g[2], g[3], g[4]
    constant, K = w_z * w_z + r_b * r_b + r_m * r_m, r_b * r_m
    odd_mean, odd = _sums(legs, constant, 0)
    even_mean, even = _sums(legs, constant, 1)
    shift = sigma_m - sigma_b
    e_shift = complex(math.cos(shift), math.sin(shift))
    e_joint = complex(math.cos(sigma_m), math.sin(sigma_m))
    share = 0.5 / math.cos(shift + sigma_m)
    tilt = (odd * e_shift.conjugate() + even * e_shift) * share / (w_z * r_m)
    z1 = ((even * e_joint.conjugate() - odd * e_joint) * share / K).conjugate()
    length = abs(tilt)
    if length > 0.9999:
        tilt *= 0.9999 / length
    up = math.sqrt(1.0 - tilt.real**2 - tilt.imag**2)
    cosine = -(odd_mean + even_mean) / (2.0 * K * math.cos(sigma_b + sigma_m) * (1.0 + up))
    if is_similar(sigma_b, sigma_m):
        turn = _turn_of_hexagons(cosine, z1, tilt, up)
    else:
        sine = (odd_mean - even_mean) / (2.0 * K * math.sin(sigma_b + sigma_m) * (1.0 + up))
        turn = math.atan2(sine, cosine)
    turned_and_tilted(turn, tilt.real, tilt.imag, T)
    T[0, 3] = T[1, 3] = T[3, 0] = T[3, 1] = T[3, 2] = 0.0
    T[2, 3], T[3, 3] = w_z, 1.0


@inner
def platform_pose(legs: Array, g: Array, T: Array) -> None:
    """Write the platform pose (4, 4) in the Stewart base that fits six leg lengths best.

    For similar hexagons, this is the rotation about the fixed centre with the smallest squared leg errors. For other
    layouts, it is the pose with all six degrees of freedom, found from the pose with a fixed centre.
    """
    orientation(legs, g, T)
    found, square = np.empty(6), 0.0
    leg_lengths(T, g, found)
    for i in range(6):
        square += (found[i] - legs[i]) ** 2
    if square <= _AGREED * g[1] * g[1]:
        return
    joints = np.empty((2, 6, 3))
    layout(g, joints)
    stewart_legs.direct(legs, joints[0], joints[1], g[1], is_similar(g[3], g[4]), T)


@inner
def home_side(g: Array) -> float:
    """Sign of the leg Jacobian's determinant on a level platform."""
    T, J = np.empty((4, 4)), np.empty((6, 6))
    turned_and_tilted(0.0, 0.0, 0.0, T)
    T[0, 3] = T[1, 3] = T[3, 0] = T[3, 1] = T[3, 2] = 0.0
    T[2, 3], T[3, 3] = g[2], 1.0
    leg_slopes(T, g, J)
    return float(stewart_search.side_of(J))


@inner
def close_platform(legs: Array, g: Array, ask: Array, T: Array, out: Array) -> int:
    """Write the platform pose (4, 4) at which legs (6,) [m] close, starting from a seed in T if there is one.

    Args:
        legs: Leg lengths (6,) [m].
        g: r_b, r_m, w_z [m], sigma_b, sigma_m [rad].
        ask: Number of starts of the search if no pose closes near the seed; then 1 if T contains a seed, else 0.
        T: Pose of the platform in the Stewart base (4, 4): seed, then result.
        out: Written (2,): largest error of a leg [m], then the side of the singular poses.

    Returns:
        :class:`FkStatus`.
    """
    found, joints = np.empty(6), np.empty((2, 6, 3))
    layout(g, joints)
    if is_similar(g[3], g[4]):
        platform_pose(legs, g, T)
        turning, out[0], out[1] = leg_lengths(T, g, found), 0.0, 1.0
        for i in range(6):
            out[0] = max(out[0], abs(found[i] - legs[i]))
        if out[0] > AGREED:
            return _NOT_CLOSED
        return _NEAR_SINGULAR if is_blind(T, turning, g) else _CLOSED
    if ask[1] == 0.0:
        orientation(legs, g, T)
    status = stewart_search.close_legs(legs, joints[0], joints[1], g[1], int(ask[0]), 0.0, T, out)
    out[1] *= home_side(g)
    return _OTHER_MODE if status == _CLOSED and ask[1] == 0.0 and out[1] < 0.0 else status


@inner
def is_blind(T: Array, turning: float, g: Array) -> bool:
    """Whether the legs hardly determine the platform's rotation; ``turning`` is from :func:`leg_lengths`."""
    square = T[2, 0] ** 2 + T[2, 1] ** 2
    is_level = is_similar(g[3], g[4]) and square < 1e-4
    return bool(is_level or turning < 0.02 * g[1])
