"""Branches: the small decisions about joint angles that every closed-form solution shares."""

import math

from teleop_core.compiled import kernel
from teleop_core.geometry import Array


@kernel
def wrapped(angle: float) -> float:
    """Same angle [rad] in (-pi, pi]."""
    if -math.pi < angle <= math.pi:
        return angle
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


@kernel
def bounded(wanted: float, seed: float, lower: float, upper: float, step: float) -> float:
    """Nearest value to ``wanted`` within a step of the seed and inside the limits."""
    near = min(max(wanted, seed - step), seed + step)
    return min(max(near, lower), upper)


@kernel
def slowed(wanted: Array, seed: Array, limits: Array, q: Array) -> bool:
    """Write ``q`` on the straight way from the seed to ``wanted``; whether it got there.

    All actuators are slowed by one common factor, so that those that hold one body together keep
    their proportion; only then is each kept inside its own limits.

    Args:
        wanted: Joint positions (n,) [rad or m].
        seed: Joint positions (n,) to start from.
        limits: Rows lower, upper, largest step: (3, n).
        q: Joint positions (n,) that are allowed; may be ``wanted``.
    """
    n, share = wanted.shape[0], 1.0
    for i in range(n):
        move = abs(wanted[i] - seed[i])
        if move > limits[2, i]:
            share = min(share, limits[2, i] / move)
    is_there = share >= 1.0
    for i in range(n):
        target = wanted[i] if share >= 1.0 else seed[i] + share * (wanted[i] - seed[i])
        value = bounded(target, seed[i], limits[0, i], limits[1, i], limits[2, i])
        is_there = is_there and abs(value - target) <= 1e-12
        q[i] = value
    return is_there
