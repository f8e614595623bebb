"""Loop equations of the 3-RPS: ball joints from leg coordinates, and leg angles that close the loop.

Source:
    Ghosal 2020, lectures 6 (ball joints) and 11 (distances of ball joints stay the same).
"""

import math

import numpy as np

from teleop_core.kernels import Array, inner, kernel

_ITERATIONS = 100
_ROUNDING = 1e-28  # more iterations cannot reduce a squared relative error below this value
_LARGEST_TURN = 0.5  # largest change of a leg angle in one iteration [rad]
# Cosines and sines of the directions of the legs: 0, 120 and 240 degrees.
COSINES = (1.0, -0.5, -0.5)
SINES = (0.0, math.sqrt(0.75), -math.sqrt(0.75))


@kernel
def points(lengths: Array, theta: Array, b: float, S: Array) -> None:
    """Write ball joints (3, 3) [m], one per row."""
    for i in range(3):
        out = b - lengths[i] * math.cos(theta[i])
        S[i, 0], S[i, 1] = out * COSINES[i], out * SINES[i]
        S[i, 2] = lengths[i] * math.sin(theta[i])


@kernel
def frame(S: Array, T: Array) -> None:
    """Write the platform frame (4, 4): origin at the centre of S, x towards S1, z normal."""
    xx = xy = yy = 0.0
    for r in range(3):
        T[r, 3] = (S[0, r] + S[1, r] + S[2, r]) / 3.0
        T[r, 0], T[r, 1] = S[0, r] - T[r, 3], S[1, r] - S[2, r]
        xx += T[r, 0] * T[r, 0]
        xy += T[r, 0] * T[r, 1]
    for r in range(3):
        T[r, 1] -= xy / xx * T[r, 0]
        yy += T[r, 1] * T[r, 1]
    shorter, narrower = 1.0 / math.sqrt(xx), 1.0 / math.sqrt(yy)
    for r in range(3):
        T[r, 0] *= shorter
        T[r, 1] *= narrower
        T[3, r] = 0.0
    T[3, 3] = 1.0
    T[0, 2] = T[1, 0] * T[2, 1] - T[2, 0] * T[1, 1]
    T[1, 2] = T[2, 0] * T[0, 1] - T[0, 0] * T[2, 1]
    T[2, 2] = T[0, 0] * T[1, 1] - T[1, 0] * T[0, 1]


@inner
def loop(lengths: Array, theta: Array, b: float, a: float, gap: Array, G: Array) -> float:
    """Write the loop equations (3,) [m²] and their slopes (3, 3) along the angles [m²/rad].

    A row for each pair of legs: gap = |Si - Sj|² - 3 a² = 3 (b² - a²) + li² + lj²
    - 3 b (li ci + lj cj) + li lj (ci cj - 2 si sj).

    Returns:
        Sum of the squared errors.
    """
    c = math.cos(theta[0]), math.cos(theta[1]), math.cos(theta[2])
    s = math.sin(theta[0]), math.sin(theta[1]), math.sin(theta[2])
    square = 0.0
    for k in range(3):
        i, j = k, (k + 1) % 3
        li, lj, ci, cj, si, sj = lengths[i], lengths[j], c[i], c[j], s[i], s[j]
        value = 3.0 * (b * b - a * a) + li * li + lj * lj - 3.0 * b * (li * ci + lj * cj)
        value += li * lj * (ci * cj - 2.0 * si * sj)
        G[k, i] = li * (3.0 * b * si - lj * (si * cj + 2.0 * ci * sj))
        G[k, j] = lj * (3.0 * b * sj - li * (sj * ci + 2.0 * cj * si))
        G[k, (k + 2) % 3] = 0.0
        gap[k] = value
        square += value * value
    return square


@kernel
def constraints(lengths: Array, theta: Array, b: float, a: float, gap: Array, G: Array, H: Array) -> None:
    """Write the loop equations and their slopes, one row for each pair of legs.

    Args:
        lengths: Legs (3,) [m].
        theta: Leg angles (3,) [rad].
        b: Distance of the hinges from the base centre [m].
        a: Distance of the ball joints from the platform centre [m].
        gap: Errors (3,) [m²].
        G: Slopes along the angles (3, 3) [m²/rad].
        H: Slopes along the lengths (3, 3) [m].
    """
    loop(lengths, theta, b, a, gap, G)
    for k in range(3):
        H[k, (k + 2) % 3] = 0.0
        for first in range(2):
            i, j = (k + first) % 3, (k + 1 - first) % 3
            ci, si = math.cos(theta[i]), math.sin(theta[i])
            cj, sj = math.cos(theta[j]), math.sin(theta[j])
            H[k, i] = 2.0 * lengths[i] - 3.0 * b * ci + lengths[j] * (ci * cj - 2.0 * si * sj)


@inner
def _damped_turn(G: Array, gap: Array, damping: float, turn: Array) -> None:
    """Write the damped change (3,) of the leg angles that reduces the errors.

    Row k of G has no slope along angle k + 2. The system Gᵀ G + damping I is solved by explicit elimination.
    """
    g00, g01, g11, g12 = G[0, 0], G[0, 1], G[1, 1], G[1, 2]
    g22, g20 = G[2, 2], G[2, 0]
    x, y, z = (-g00 * gap[0] - g20 * gap[2], -g11 * gap[1] - g01 * gap[0], -g22 * gap[2] - g12 * gap[1])
    xy, xz, yz = g00 * g01, g20 * g22, g11 * g12
    share = 1.0 / (g00 * g00 + g20 * g20 + damping)
    yy = g11 * g11 + g01 * g01 + damping - share * xy * xy
    zz = g22 * g22 + g12 * g12 + damping - share * xz * xz
    rest = yz - share * xy * xz
    y, z = y - share * xy * x, z - share * xz * x
    z = (z - rest / yy * y) / (zz - rest / yy * rest)
    y = (y - rest * z) / yy
    x = share * (x - xy * y - xz * z)
    largest = max(abs(x), abs(y), abs(z))
    share = min(1.0, _LARGEST_TURN / max(largest, 1e-300))
    turn[0], turn[1], turn[2] = share * x, share * y, share * z


@kernel
def settle(lengths: Array, b: float, a: float, theta: Array) -> float:
    """Move leg angles (3,) from their current values to values at which the loop closes.

    The damping decreases after each successful step, so that the final convergence is quadratic. If the loop does not
    close near the start, the result has the smallest sum of squared errors.

    Returns:
        Largest remaining error [m²].

    Source:
        Levenberg 1944, Marquardt 1963.
    """
    gap, turn, trial, G = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    scale = (a * a + b * b) ** 2
    cost, damping = loop(lengths, theta, b, a, gap, G), 1e-3 * scale
    for _ in range(_ITERATIONS):
        if cost <= 1e-31 * scale or damping > 1e8 * scale:
            break
        _damped_turn(G, gap, damping, turn)
        for i in range(3):
            trial[i] = theta[i] + turn[i]
        trial_cost = loop(lengths, trial, b, a, gap, G)
        if trial_cost >= cost:
            if cost <= _ROUNDING * scale:
                break
            loop(lengths, theta, b, a, gap, G)
            damping = max(10.0 * damping, 1e-12 * scale)
            continue
        gained, cost, damping = cost - trial_cost, trial_cost, 0.05 * damping
        for i in range(3):
            theta[i] = trial[i]
        if gained <= 1e-14 * cost:
            break
    return max(abs(gap[0]), abs(gap[1]), abs(gap[2]))
