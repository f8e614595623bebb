"""Stewart legs: lengths, Jacobian and direct kinematics of a body held by six legs, as kernels.

Joints of the legs are given as (6, 3) points: ``base`` in base coordinates, ``platform`` in
platform coordinates [m]. ``T`` is ``T_base_platform``.

Source:
    Merlet 2006 (leg Jacobian); Levenberg 1944, Marquardt 1963 (direct kinematics).
"""

import math

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kinematics.damped import eliminate

# Legs count as closed if the errors of their lengths are not larger [m].
CLOSED = 1e-11
_ITERATIONS = 100
_ROUNDING = 1e-26  # more iterations cannot reduce a squared relative error below this value
_LARGEST_TURN = 0.5  # largest rotation in one iteration [rad]


@kernel
def leg_system(T: Array, base: Array, platform: Array, lengths: Array, J: Array) -> None:
    """Write leg lengths (6,) [m] and the leg Jacobian (6, 6), legs by twist in base axes.

    A row is (u, R m × u), where u is the unit vector along the leg. It maps linear, then angular velocity of the
    platform frame to the speed of the leg.
    """
    for i in range(6):
        a, b, c = platform[i, 0], platform[i, 1], platform[i, 2]
        mx = T[0, 0] * a + T[0, 1] * b + T[0, 2] * c
        my = T[1, 0] * a + T[1, 1] * b + T[1, 2] * c
        mz = T[2, 0] * a + T[2, 1] * b + T[2, 2] * c
        x, y, z = T[0, 3] + mx - base[i, 0], T[1, 3] + my - base[i, 1], T[2, 3] + mz - base[i, 2]
        lengths[i] = math.sqrt(x * x + y * y + z * z)
        share = 1.0 / max(lengths[i], 1e-300)
        x, y, z = share * x, share * y, share * z
        J[i, 0], J[i, 1], J[i, 2] = x, y, z
        J[i, 3], J[i, 4], J[i, 5] = my * z - mz * y, mz * x - mx * z, mx * y - my * x


@kernel
def moved(T: Array, move: Array, out: Array) -> None:
    """Write T after a small move (6,) in base axes: shift [m], then rotation [rad] about the origin of T."""
    x, y, z = move[3], move[4], move[5]
    angle = math.sqrt(x * x + y * y + z * z)
    s = math.sin(angle) / angle if angle > 1e-8 else 1.0
    c = 2.0 * (math.sin(0.5 * angle) / angle) ** 2 if angle > 1e-8 else 0.5
    for j in range(3):
        a, b, d = T[0, j], T[1, j], T[2, j]
        # Rodrigues: v + s (w × v) + c (w × (w × v)).
        p, q, r = y * d - z * b, z * a - x * d, x * b - y * a
        out[0, j] = a + s * p + c * (y * r - z * q)
        out[1, j] = b + s * q + c * (z * p - x * r)
        out[2, j] = d + s * r + c * (x * q - y * p)
        out[j, 3] = T[j, 3] + move[j]
        out[3, j] = 0.0
    out[3, 3] = 1.0


@inner
def _damped_move(J: Array, gap: Array, damping: float, size: float, A: Array, move: Array) -> float:
    """Write the damped least-squares move (6,) that closes the gaps (6,).

    Rotations are weighted by the length ``size``.

    ``A`` (6, 6) is overwritten.

    Returns:
        Largest component of the move.
    """
    for r in range(6):
        for s in range(r, 6):
            value = 0.0
            for i in range(6):
                value += J[i, r] * J[i, s]
            A[r, s] = value
        A[r, r] += damping * (size * size if r > 2 else 1.0)
        value = 0.0
        for i in range(6):
            value += J[i, r] * gap[i]
        move[r] = value
    eliminate(A, move)
    turn = math.sqrt(move[3] ** 2 + move[4] ** 2 + move[5] ** 2)
    share, largest = min(1.0, _LARGEST_TURN / max(turn, 1e-300)), 0.0
    for r in range(6):
        move[r] *= share
        largest = max(largest, abs(move[r]))
    return largest


@inner
def _gaps(
    T: Array, wanted: Array, base: Array, platform: Array, is_pinned: bool, gap: Array, J: Array
) -> tuple[float, float]:
    """Write the leg errors (6,) [m] and the leg Jacobian (6, 6); if ``is_pinned``, the platform's origin is fixed.

    Returns:
        Sum of squares and largest magnitude of the leg errors.
    """
    leg_system(T, base, platform, gap, J)
    square = largest = 0.0
    for i in range(6):
        gap[i] = wanted[i] - gap[i]
        square += gap[i] * gap[i]
        largest = max(largest, abs(gap[i]))
        if is_pinned:
            J[i, 0] = J[i, 1] = J[i, 2] = 0.0
    return square, largest


@kernel
def direct(wanted: Array, base: Array, platform: Array, size: float, is_pinned: bool, T: Array) -> float:
    """Move T from its current pose to the platform pose with the wanted leg lengths.

    The damping decreases after each successful step, so that the final convergence is quadratic. If no pose near the
    start has these lengths, the result has the smallest sum of squared errors.

    Args:
        wanted: Leg lengths (6,) [m].
        base: Base joints (6, 3) [m].
        platform: Platform joints (6, 3) [m].
        size: Length [m] that counts as much as one radian.
        is_pinned: Whether the platform's origin is fixed, so that T only rotates.
        T: Start, then result (4, 4).

    Returns:
        Largest remaining error of a leg length [m].
    """
    gap, J = np.empty(6), np.empty((6, 6))
    cost, worst = _gaps(T, wanted, base, platform, is_pinned, gap, J)
    damping, A, move, trial = 1e-4, np.empty((6, 6)), np.empty(6), np.empty((4, 4))
    for _ in range(_ITERATIONS):
        if cost <= 1e-29 * size * size or damping > 1e8:
            break
        largest = _damped_move(J, gap, damping, size, A, move)
        moved(T, move, trial)
        trial_cost, trial_worst = _gaps(trial, wanted, base, platform, is_pinned, gap, J)
        if trial_cost >= cost:
            if cost <= _ROUNDING * size * size or largest < 1e-13:
                break
            _gaps(T, wanted, base, platform, is_pinned, gap, J)
            damping = max(10.0 * damping, 1e-12)
            continue
        gained, cost, worst, damping = cost - trial_cost, trial_cost, trial_worst, 0.05 * damping
        for i in range(3):
            for j in range(4):
                T[i, j] = trial[i, j]
        if gained <= 1e-14 * cost:
            break
    return worst


@inner
def _identity(A: Array) -> None:
    for i in range(A.shape[0]):
        for j in range(A.shape[0]):
            A[i, j] = 1.0 if i == j else 0.0


@inner
def invert(A: Array, inverse: Array) -> float:
    """Write the inverse (n, n) of A into ``inverse``; A is overwritten. Return the product of the pivots' signs.

    Uses partial pivoting; a pivot of zero is replaced by 1e-12, so that the result stays finite.
    """
    n, sign = A.shape[0], 1.0
    _identity(inverse)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if best != k:
            sign = -sign
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
                inverse[k, j], inverse[best, j] = inverse[best, j], inverse[k, j]
        pivot = math.copysign(max(abs(A[k, k]), 1e-12), A[k, k])
        sign *= math.copysign(1.0, pivot)
        for j in range(n):
            A[k, j] /= pivot
            inverse[k, j] /= pivot
        for i in range(n):
            factor = A[i, k]
            if i != k and factor != 0.0:
                for j in range(n):
                    A[i, j] -= factor * A[k, j]
                    inverse[i, j] -= factor * inverse[k, j]
    return sign
