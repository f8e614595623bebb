"""Branches: the small decisions about joint angles that every closed-form solution shares."""

import math

from teleop_core.kernels import Array, inner

SLACK = 1e-12
"""Rounding by which a joint on its limit may exceed the limit [rad or m]."""
# If joint 5 of a spherical wrist is within this angle of zero [rad], its two branches are neighbours. Then a path
# considers limits too: before a limit the wrist changes to the other branch by a small move. At larger angles the
# branch never changes in a path.
BESIDE = 0.1
# Cost added to a branch outside the limits; it is larger than any move inside the limits.
OUTSIDE = 100.0


@inner
def wrapped(angle: float) -> float:
    """The angle plus whole turns, in (-pi, pi] [rad]."""
    if -math.pi < angle <= math.pi:
        return angle
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


@inner
def bounded(wanted: float, seed: float, lower: float, upper: float, step: float) -> float:
    """Nearest value to ``wanted`` within a step of the seed and inside the limits."""
    near = min(max(wanted, seed - step), seed + step)
    return min(max(near, lower), upper)


@inner
def hold(q: Array, i: int, seed: Array, limits: Array) -> None:
    """Clip joint i of ``q`` to its step around the seed and to its limits."""
    q[i] = bounded(q[i], seed[i], limits[0, i], limits[1, i], limits[2, i])


@inner
def slowed(wanted: Array, seed: Array, limits: Array, q: Array) -> bool:
    """Write ``q`` on the straight path from the seed to ``wanted``; return whether ``q`` reaches ``wanted``.

    All actuators are slowed by one common factor, so that actuators that move the same body keep their proportion. Then
    each actuator is clipped to its own limits.

    Args:
        wanted: Joint positions (n,) [rad or m].
        seed: Joint positions (n,) to start from.
        limits: Rows lower, upper, largest step: (3, n).
        q: Allowed joint positions (n,), written; may be the array ``wanted``.
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


@inner
def turned(angle: float, seed: float, lower: float, upper: float, is_path: bool) -> float:
    """The angle plus whole turns [rad]: nearest to the seed, and inside the limits if possible.

    In a path only the angle nearest to the seed is allowed, so a joint at its end stop does not jump by a whole turn.
    """
    near = seed if is_path else min(max(seed, lower), upper)
    angle -= 2.0 * math.pi * math.floor((angle - near) / (2.0 * math.pi) + 0.5)
    if is_path:
        return angle
    if angle > upper + SLACK and angle - 2.0 * math.pi >= lower - SLACK:
        return angle - 2.0 * math.pi
    if angle < lower - SLACK and angle + 2.0 * math.pi <= upper + SLACK:
        return angle + 2.0 * math.pi
    return angle


@inner
def turn(q: Array, seed: Array, limits: Array, first: int, last: int) -> None:
    """Add whole turns to joints first..last-1, so that they are nearest to the seed, or inside their limits."""
    is_path = math.isfinite(limits[2, 0])
    for i in range(first, last):
        q[i] = turned(q[i], seed[i], limits[0, i], limits[1, i], is_path)


@inner
def cost_of(q: Array, seed: Array, limits: Array, first: int, last: int, do_limits_count: bool) -> float:
    """Largest move of joints first..last-1 from the seed; branches are sorted by this cost.

    If ``do_limits_count``, branches outside the limits come after all other branches.
    """
    worst, is_outside = 0.0, False
    for i in range(first, last):
        worst = max(worst, abs(q[i] - seed[i]))
        is_outside |= (q[i] < limits[0, i] - SLACK) | (q[i] > limits[1, i] + SLACK)
    return OUTSIDE + worst if is_outside and do_limits_count else worst


@inner
def move_cost(q: Array, seed: Array, limits: Array, first: int, last: int) -> float:
    """:func:`cost_of` joints; in a path without limits, so that the branch never changes."""
    return cost_of(q, seed, limits, first, last, not math.isfinite(limits[2, 0]))


@inner
def is_allowed(q: Array, seed: Array, limits: Array) -> bool:
    """Whether every joint is inside its limits and within its step of the seed."""
    for i in range(q.shape[0]):
        if not limits[0, i] <= q[i] <= limits[1, i] or abs(q[i] - seed[i]) > limits[2, i]:
            return False
    return True
