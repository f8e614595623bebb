"""Damped least squares: for any arm, the joint vector in a box whose pose is nearest to a wanted pose.

The box contains the joint limits, or one speed-limited step around the last joint vector. Inside the box the error is
reduced to zero if possible, and otherwise to its minimum, through singularities too. The damping decreases with the
error. So steps are bounded far from the solution, and convergence near the solution is quadratic.

Source:
    Nakamura and Hanafusa 1986 (damping); Yamashita and Fukushima 2001 (damping by the error).
"""

import math

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room

# Squared weighted error that counts as zero: 1e-12 m at a length of 0.1 m, 1e-11 rad.
ZERO = 1e-22


# Loops are used instead of slices and numpy calls, because they are as fast and compile much faster.
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
    # If the sine is zero, the angle is 0 or pi. At pi the axis is arbitrary, and z is taken.
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
def eliminate(A: Array, b: Array) -> None:
    """Replace b (6,) by the solution of A x = b for a positive definite A (6, 6).

    Only the upper triangle of A is used, and it is overwritten.
    """
    for k in range(6):
        pivot = 1.0 / max(A[k, k], 1e-300)
        for i in range(k + 1, 6):
            share = A[k, i] * pivot
            b[i] -= share * b[k]
            for j in range(i, 6):
                A[i, j] -= share * A[k, j]
        A[k, k] = pivot
    for i in range(5, -1, -1):
        for j in range(i + 1, 6):
            b[i] -= A[i, j] * b[j]
        b[i] *= A[i, i]


@inner
def gram(J: Array, is_free: Array, damping: float, A: Array) -> None:
    """Write the upper triangle of J Jᵀ + damping I, (6, 6).

    Only the free columns of J (6, n) are used: those with 1.0 in ``is_free``.
    """
    for r in range(6):
        for s in range(r, 6):
            value = damping if r == s else 0.0
            for i in range(J.shape[1]):
                value += is_free[i] * J[r, i] * J[s, i]
            A[r, s] = value


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
def damped_move(J: Array, error: Array, damping: float, is_free: Array, box: Array, q: Array, moved: Array) -> None:
    """Write q + Jᵀ (J Jᵀ + damping I)⁻¹ error of the free joints, clipped to the box, into ``moved`` (n,)."""
    A, y = room(6, 6), room(6)
    assign(y, error)
    gram(J, is_free, damping, A)
    eliminate(A, y)
    for i in range(q.shape[0]):
        move = 0.0
        for r in range(6):
            move += is_free[i] * J[r, i] * y[r]
        moved[i] = min(max(q[i] + move, box[0, i]), box[1, i])


@kernel
def is_near_singular(J: Array, length: float, bound: float) -> bool:
    """Whether the smallest singular value of J (6, n), n >= 6, is below ``bound`` > 0.

    The linear rows are divided by ``length`` first. The value is below the bound if J Jᵀ - bound² I has a negative
    eigenvalue. Elimination then meets a negative pivot (Sylvester's law of inertia).
    """
    A = room(6, 6)
    for r in range(6):
        for s in range(r, 6):
            value = 0.0
            for i in range(J.shape[1]):
                value += J[r, i] * J[s, i]
            A[r, s] = value / ((length if r < 3 else 1.0) * (length if s < 3 else 1.0))
        A[r, r] -= bound * bound
    for k in range(6):
        if A[k, k] <= 0.0:
            return True
        for i in range(k + 1, 6):
            share = A[k, i] / A[k, k]
            for j in range(i, 6):
                A[i, j] -= share * A[k, j]
    return False
