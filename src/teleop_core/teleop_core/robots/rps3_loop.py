"""Loop equations of the 3-RPS: ball joints of leg coordinates, and leg angles that close the loop.

Source:
    Ghosal 2020, lectures 6 (ball joints) and 11 (distances of ball joints stay the same).
"""

import math

import numpy as np

from teleop_core.compiled import inner, kernel
from teleop_core.geometry import Array
from teleop_core.robots.damped import factorise, solve

_ITERATIONS = 100
_ROUNDING = 1e-28  # squared relative error that more iterations cannot improve
_LARGEST_TURN = 0.5  # rad, of one iteration


@inner
def _dot(a: Array, b: Array) -> float:
    """Scalar product of vectors (3,); numba's own needs BLAS and seconds to compile."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@kernel
def points(lengths: Array, theta: Array, b: float, S: Array) -> None:
    """Write ball joints (3, 3) [m], one a row."""
    for i in range(3):
        angle = 2.0 * math.pi / 3.0 * i
        out = b - lengths[i] * math.cos(theta[i])
        S[i, 0], S[i, 1] = out * math.cos(angle), out * math.sin(angle)
        S[i, 2] = lengths[i] * math.sin(theta[i])


@kernel
def frame(S: Array, T: Array) -> None:
    """Write the platform frame (4, 4): origin at the centre of S, x towards S1, z normal."""
    x, y = np.empty(3), np.empty(3)
    for r in range(3):
        T[r, 3] = (S[0, r] + S[1, r] + S[2, r]) / 3.0
        x[r], y[r] = S[0, r] - T[r, 3], S[1, r] - S[2, r]
    xx, xy = _dot(x, x), _dot(x, y)
    for r in range(3):
        y[r] -= xy / xx * x[r]
    yy = _dot(y, y)
    for r in range(3):
        T[r, 0], T[r, 1] = x[r] / math.sqrt(xx), y[r] / math.sqrt(yy)
        T[3, r] = 0.0
    T[3, 3] = 1.0
    T[0, 2] = T[1, 0] * T[2, 1] - T[2, 0] * T[1, 1]
    T[1, 2] = T[2, 0] * T[0, 1] - T[0, 0] * T[2, 1]
    T[2, 2] = T[0, 0] * T[1, 1] - T[1, 0] * T[0, 1]


@kernel
def constraints(
    lengths: Array, theta: Array, b: float, a: float, gap: Array, G: Array, H: Array
) -> None:
    """Write the loop equations and their slopes, one row for each pair of legs.

    gap = |Si - Sj|² - 3 a² = 3 (b² - a²) + li² + lj² - 3 b (li ci + lj cj)
    + li lj (ci cj - 2 si sj).

    Args:
        lengths: Legs (3,) [m].
        theta: Leg angles (3,) [rad].
        b: Distance of the hinges from the base centre [m].
        a: Distance of the ball joints from the platform centre [m].
        gap: Errors (3,) [m²].
        G: Slopes along the angles (3, 3) [m²/rad].
        H: Slopes along the lengths (3, 3) [m].
    """
    for k in range(3):
        G[k, (k + 2) % 3] = H[k, (k + 2) % 3] = 0.0
        for first in range(2):
            i, j = (k + first) % 3, (k + 1 - first) % 3
            li, lj = lengths[i], lengths[j]
            ci, si, cj, sj = (
                math.cos(theta[i]), math.sin(theta[i]), math.cos(theta[j]), math.sin(theta[j])
            )  # fmt: skip
            G[k, i] = li * (3.0 * b * si - lj * (si * cj + 2.0 * ci * sj))
            H[k, i] = 2.0 * li - 3.0 * b * ci + lj * (ci * cj - 2.0 * si * sj)
            gap[k] = 3.0 * (b * b - a * a) + li * li + lj * lj - 3.0 * b * (li * ci + lj * cj)
            gap[k] += li * lj * (ci * cj - 2.0 * si * sj)


@inner
def _damped_turn(G: Array, gap: Array, damping: float, turn: Array) -> None:
    """Write the change (3,) of the leg angles that lessens the errors, damped."""
    A, largest = np.empty((3, 3)), 0.0
    for r in range(3):
        turn[r] = 0.0
        for i in range(3):
            turn[r] -= G[i, r] * gap[i]
        for s in range(r + 1):
            A[r, s] = G[0, r] * G[0, s] + G[1, r] * G[1, s] + G[2, r] * G[2, s]
        A[r, r] += damping
    factorise(A)
    solve(A, turn)
    for r in range(3):
        largest = max(largest, abs(turn[r]))
    if largest > _LARGEST_TURN:
        for r in range(3):
            turn[r] *= _LARGEST_TURN / largest


@kernel
def settle(lengths: Array, b: float, a: float, theta: Array) -> float:
    """Move leg angles (3,) from where they are to where the loop closes.

    Damping shrinks with success, so that convergence ends quadratic; lengths that do not close
    near the start end in the least sum of squared errors.

    Returns:
        Largest error that is left [m²].

    Source:
        Levenberg 1944, Marquardt 1963.
    """
    gap, turn, trial = np.empty(3), np.empty(3), np.empty(3)
    G, H = np.empty((3, 3)), np.empty((3, 3))
    constraints(lengths, theta, b, a, gap, G, H)
    scale = (a * a + b * b) ** 2
    cost, damping = _dot(gap, gap), 1e-3 * scale
    for _ in range(_ITERATIONS):
        if cost <= 1e-31 * scale or damping > 1e8 * scale:
            break
        _damped_turn(G, gap, damping, turn)
        for i in range(3):
            trial[i] = theta[i] + turn[i]
        constraints(lengths, trial, b, a, gap, G, H)
        trial_cost = _dot(gap, gap)
        if trial_cost >= cost:
            if cost <= _ROUNDING * scale:
                break
            constraints(lengths, theta, b, a, gap, G, H)
            damping = max(10.0 * damping, 1e-12 * scale)
            continue
        gained, cost, damping = cost - trial_cost, trial_cost, 0.05 * damping
        for i in range(3):
            theta[i] = trial[i]
        if gained <= 1e-14 * cost:
            break
    return max(abs(gap[0]), abs(gap[1]), abs(gap[2]))
