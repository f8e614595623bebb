"""Spline: cubic B-splines through values at even steps, straight beyond their ends."""

import numpy as np

from teleop_core.kernels import Array, inner, kernel


@kernel
def write_spline(lines: Array) -> None:
    """Write the coefficients of cubic B-splines through values (N, n, M) along the second axis.

    The splines are straight beyond their ends. At node i a spline with the coefficients c has the value (c[i - 1] + 4
    c[i] + c[i + 1]) / 6. These equations are a tridiagonal system.
    """
    last = lines.shape[1] - 1
    share = np.zeros(last)
    for i in range(lines.shape[0]):
        for j in range(1, last):
            share[j] = 1.0 / (4.0 - share[j - 1])
            for k in range(lines.shape[2]):
                lines[i, j, k] = share[j] * (6.0 * lines[i, j, k] - lines[i, j - 1, k])
        for j in range(last - 1, 0, -1):
            for k in range(lines.shape[2]):
                lines[i, j, k] -= share[j] * lines[i, j + 1, k]


@inner
def weights(t: float) -> tuple[float, float, float, float]:
    """Weights of the four nodes around a point; the point is t steps after the second node, 0 <= t <= 1."""
    u = 1.0 - t
    return (
        u * u * u / 6.0,
        (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
        (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0,
        t * t * t / 6.0,
    )


@inner
def slopes(t: float) -> tuple[float, float, float, float]:
    """Derivatives of the weights with respect to t."""
    u = 1.0 - t
    return (-0.5 * u * u, t * (1.5 * t - 2.0), u * (2.0 - 1.5 * u), 0.5 * t * t)


@kernel
def write_between(coefficients: Array, between: Array) -> None:
    """Write the values of splines at evenly spaced points from their first to their last node.

    Args:
        coefficients: Coefficients of splines along the second axis (N, n, M), from :func:`write_spline`.
        between: Values (N, k (n - 1) + 1, M), written; k points per step.
    """
    steps = coefficients.shape[1] - 1
    parts = (between.shape[1] - 1) // steps
    for j in range(between.shape[1]):
        node = min(j // parts, steps - 1)
        before, after = max(node - 1, 0), min(node + 2, steps)
        a, b, c, d = weights((j - node * parts) / parts)
        for i in range(between.shape[0]):
            for k in range(between.shape[2]):
                here, there = coefficients[i, node, k], coefficients[i, node + 1, k]
                last = coefficients[i, before, k] if node > 0 else 2.0 * here - there
                following = coefficients[i, after, k] if node + 1 < steps else 2.0 * there - here
                between[i, j, k] = a * last + b * here + c * there + d * following
