"""Rigid body: inertia matrix and bias of an arm, computed from its forward dynamics alone."""

from typing import Any

import numpy as np

from teleop_core.kernels import Array, kernel


@kernel
def invert_positive(A: Array) -> None:
    """Invert a symmetric positive definite matrix (n, n) in place.

    Gauss-Jordan elimination; positive definite matrices need no pivoting (Golub and Van Loan 2013, section 4.2).
    """
    n = A.shape[0]
    for k in range(n):
        pivot = 1.0 / A[k, k]
        A[k, k] = 1.0
        for j in range(n):
            A[k, j] *= pivot
        for i in range(n):
            factor = A[i, k]
            if i != k and factor != 0.0:
                A[i, k] = 0.0
                for j in range(n):
                    A[i, j] -= factor * A[k, j]


@kernel
def write_model(acceleration: Any, model: Array, q: Array, dq: Array, out: Array) -> None:
    """Write bias and inertia of ``D(q) ddq + bias(q, dq) = effort``, by n + 1 calls of the forward dynamics.

    Without effort the acceleration is ``-D⁻¹ bias``. A unit effort on joint j alone adds column j of the inverse
    inertia.

    Args:
        acceleration: Kernel or pointer ``acceleration(q, dq, effort, parameters, ddq)``.
        model: Its parameter row.
        q: Joint positions (n,) [rad or m].
        dq: Joint speeds (n,) [rad/s or m/s].
        out: Written, (n + n²,): first the bias (Coriolis, centrifugal and gravity effort) [N·m or N], then the inertia
            row by row [kg·m², kg·m or kg].

    Source:
        Walker and Orin 1982, method 1, with forward instead of inverse dynamics.
    """
    n = q.shape[0]
    effort, free, ddq, inertia = np.zeros(n), np.empty(n), np.empty(n), np.empty((n, n))
    acceleration(q, dq, effort, model, free)
    for j in range(n):
        effort[j] = 1.0
        acceleration(q, dq, effort, model, ddq)
        effort[j] = 0.0
        for i in range(n):
            inertia[i, j] = ddq[i] - free[i]
    invert_positive(inertia)
    for i in range(n):
        out[i] = 0.0
        for j in range(n):
            out[i] -= inertia[i, j] * free[j]
            out[n + n * i + j] = inertia[i, j]
