"""Damped least squares: the joint vector of a box that comes next to a pose, for any arm.

The box is the joint limits, or one speed-limited step around the last joint vector; inside it the
error is driven to zero where that is possible and to its least where it is not, through
singularities too. Damping that shrinks with the error keeps the steps bounded far away and the
convergence quadratic close by.

Source:
    Nakamura and Hanafusa 1986 (damping); Yamashita and Fukushima 2001 (damping by the error).
"""

import math

import numpy as np

from teleop_core.compiled import inner, kernel
from teleop_core.geometry import Array

# Squared weighted error that counts as zero: 1e-12 m at a length of 0.1 m, 1e-11 rad.
ZERO = 1e-22
# Added to squared singular values, so that rounding cannot make a pivot negative.
_FLOOR = 1e-12


# Loops instead of slices and numpy calls: the same speed, a fraction of the compile time.
@inner
def assign(target: Array, source: Array) -> None:
    """Write the values of ``source`` (m,) into ``target``."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@inner
def weigh(J: Array, length: float) -> None:
    """Divide the linear rows of a Jacobian (6, n) by a length [m]."""
    for r in range(3):
        for i in range(J.shape[1]):
            J[r, i] /= length


@kernel
def pose_error(reached: Array, wanted: Array, length: float, error: Array) -> float:
    """Write the error (6,) in base axes: distance over ``length``, rotation vector [rad].

    Returns:
        Its squared norm.
    """
    x = y = z = trace = 0.0
    for j in range(3):
        x += reached[1, j] * wanted[2, j] - reached[2, j] * wanted[1, j]
        y += reached[2, j] * wanted[0, j] - reached[0, j] * wanted[2, j]
        z += reached[0, j] * wanted[1, j] - reached[1, j] * wanted[0, j]
        for i in range(3):
            trace += reached[i, j] * wanted[i, j]
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (trace - 1.0))
    # Without a sine the angle is 0, or pi, where a turn about z starts the way back.
    scale = 0.5 * angle / sine if sine > 1e-12 else 0.5
    error[3], error[4], error[5] = scale * x, scale * y, scale * z
    if sine <= 1e-12 and angle > 1.0:
        error[3], error[4], error[5] = 0.0, 0.0, angle
    square = 0.0
    for i in range(3):
        error[i] = (wanted[i, 3] - reached[i, 3]) / length
    for i in range(6):
        square += error[i] * error[i]
    return square


@inner
def factorise(A: Array) -> None:
    """Replace the lower triangle of a positive definite A (m, m) by its Cholesky factor."""
    for j in range(A.shape[0]):
        pivot = A[j, j]
        for k in range(j):
            pivot -= A[j, k] * A[j, k]
        A[j, j] = math.sqrt(max(pivot, 1e-300))
        for i in range(j + 1, A.shape[0]):
            value = A[i, j]
            for k in range(j):
                value -= A[i, k] * A[j, k]
            A[i, j] = value / A[j, j]


@kernel
def solve(L: Array, b: Array) -> None:
    """Replace b (m,) by the solution of L Lᵀ x = b."""
    m = L.shape[0]
    for i in range(m):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]


@inner
def gram(J: Array, is_free: Array, damping: float, A: Array) -> None:
    """Write J Jᵀ + damping I, (6, 6), over the columns of J (6, n) that are free (1.0 or 0.0)."""
    for r in range(6):
        for s in range(r + 1):
            value = damping if r == s else 0.0
            for i in range(J.shape[1]):
                value += is_free[i] * J[r, i] * J[s, i]
            A[r, s] = A[s, r] = value


@inner
def free_joints(J: Array, error: Array, q: Array, box: Array, is_free: Array) -> float:
    """Write 1.0 for joints that the error does not push out of the box (2, n), else 0.0.

    Returns:
        Norm of the gradient over the free joints.
    """
    square = 0.0
    for i in range(q.shape[0]):
        slope = 0.0
        for r in range(6):
            slope += J[r, i] * error[r]
        is_stuck = (q[i] <= box[0, i] and slope < 0.0) or (q[i] >= box[1, i] and slope > 0.0)
        is_free[i] = 0.0 if is_stuck else 1.0
        square += is_free[i] * slope * slope
    return math.sqrt(square)


@inner
def damped_move(
    J: Array, error: Array, damping: float, is_free: Array, box: Array, q: Array, moved: Array
) -> None:
    """Write ``moved`` (n,): q + Jᵀ (J Jᵀ + damping I)⁻¹ error over the free joints, in the box."""
    A, y = np.empty((6, 6)), np.empty(6)
    assign(y, error)
    gram(J, is_free, damping, A)
    factorise(A)
    solve(A, y)
    for i in range(q.shape[0]):
        move = 0.0
        for r in range(6):
            move += is_free[i] * J[r, i] * y[r]
        moved[i] = min(max(q[i] + move, box[0, i]), box[1, i])


@kernel
def smallest_singular_value(J: Array, length: float) -> float:
    """Smallest singular value of J (6, n), n >= 6, after dividing its linear rows by ``length``.

    By inverse iteration on J Jᵀ from the direction of the smallest pivot: never too small, and
    close where it matters, near a singularity, where one value is much smaller than the others.
    Below 1e-6 it is 0. J is overwritten by the weighted one.
    """
    A, x, is_free = np.empty((6, 6)), np.empty(6), np.empty(J.shape[1])
    for i in range(J.shape[1]):
        is_free[i] = 1.0
    weigh(J, length)
    gram(J, is_free, _FLOOR, A)
    factorise(A)
    smallest = 0
    for i in range(6):
        if A[i, i] < A[smallest, smallest]:
            smallest = i
    for i in range(6):
        x[i] = 1.0 if i == smallest else 0.0
    norm = 1.0
    for _ in range(3):
        for i in range(6):
            x[i] /= norm
        solve(A, x)
        norm = 0.0
        for i in range(6):
            norm += x[i] * x[i]
        norm = math.sqrt(norm)
    return math.sqrt(max(1.0 / norm - _FLOOR, 0.0))
