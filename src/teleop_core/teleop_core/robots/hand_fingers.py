"""Fingers of the three-fingered hand: contact point and joints of one R-R-R finger, as kernels.

A finger stands at the origin of its frame F: theta turns it about z, psi lifts the second link,
phi bends the third. ``links`` are l1, l2, l3 [m].

Source:
    Ghosal 2020, lecture 6, table and F_p of the hand (after Salisbury 1982); the inverse and its
    four branches are derived from them.
"""

import math

import numpy as np

from teleop_core.compiled import inner, kernel
from teleop_core.geometry import Array
from teleop_core.robots.branches import bounded, turned, wrapped

# Sine of phi of a straight finger: shortens it by less than rounding, and has a sign, so that a
# path through it remembers its side.
_STRAIGHT = 1e-8
_HELD = 1e-12


@kernel
def finger_point(q: Array, links: Array, p: Array) -> None:
    """Write the contact point (3,) [m] in F of theta, psi, phi (3,)."""
    outer = q[1] + q[2]
    r = links[0] + links[1] * math.cos(q[1]) + links[2] * math.cos(outer)
    p[0], p[1] = math.cos(q[0]) * r, math.sin(q[0]) * r
    p[2] = links[1] * math.sin(q[1]) + links[2] * math.sin(outer)


@inner
def finger_jacobian(q: Array, links: Array, J: Array) -> None:
    """Write the slopes (3, 3) of the contact point in F along theta, psi, phi [m/rad]."""
    c, s, outer = math.cos(q[0]), math.sin(q[0]), q[1] + q[2]
    bend = -links[2] * math.sin(outer)
    lift = bend - links[1] * math.sin(q[1])
    r = links[0] + links[1] * math.cos(q[1]) + links[2] * math.cos(outer)
    J[0, 0], J[1, 0], J[2, 0] = -s * r, c * r, 0.0
    J[0, 1], J[1, 1] = c * lift, s * lift
    J[0, 2], J[1, 2], J[2, 2] = c * bend, s * bend, links[2] * math.cos(outer)
    J[2, 1] = J[2, 2] + links[1] * math.cos(q[1])


@inner
def _bent(r: float, z: float, links: Array, is_positive: bool, q: Array) -> bool:
    """Write psi and phi of q (3,) for a point r ahead of, z above joint 2; whether it reaches."""
    l2, l3 = links[1], links[2]
    k = (r * r + z * z - l2 * l2 - l3 * l3) / (2.0 * l2 * l3)
    sine = max(math.sqrt(max(1.0 - k * k, 0.0)), _STRAIGHT)
    q[2] = math.atan2(sine if is_positive else -sine, min(max(k, -1.0), 1.0))
    inner = math.atan2(l3 * math.sin(q[2]), l2 + l3 * math.cos(q[2]))
    q[1] = wrapped(math.atan2(z, r) - inner)
    return abs(k) <= 1.0 + 1e-12


@kernel
def finger_branch(p: Array, links: Array, branch: int, seed: float, q: Array) -> bool:
    """Write theta, psi, phi (3,) of one of four branches; whether the finger reaches p at all.

    Branches 0 and 1 turn towards p, 2 and 3 away from it; even ones bend with phi > 0. On the
    axis of joint 1, where every theta will do, the seed's is kept.
    """
    q[0] = seed
    if math.hypot(p[0], p[1]) > 1e-12:
        q[0] = wrapped(math.atan2(p[1], p[0]) + (math.pi if branch > 1 else 0.0))
    r = p[0] * math.cos(q[0]) + p[1] * math.sin(q[0]) - links[0]
    return bool(_bent(r, p[2], links, branch % 2 == 0, q))


@inner
def _branch_of(seed: Array, links: Array) -> int:
    """Branch that a finger is on."""
    reach = links[0] + links[1] * math.cos(seed[1]) + links[2] * math.cos(seed[1] + seed[2])
    return (2 if reach < 0.0 else 0) + (0 if math.sin(seed[2]) >= 0.0 else 1)


@inner
def _nearest_branch(p: Array, links: Array, seed: Array, limits: Array) -> int:
    """Branch nearest to the seed by the largest joint move, inside the limits if one is."""
    q, best, least = np.empty(3), 0, math.inf
    for branch in range(4):
        cost = 0.0 if finger_branch(p, links, branch, seed[0], q) else 1000.0
        for i in range(3):
            q[i] = turned(q[i], seed[i], limits[0, i], limits[1, i], False)
            cost = max(cost, abs(q[i] - seed[i]))
        for i in range(3):
            if q[i] < limits[0, i] - _HELD or q[i] > limits[1, i] + _HELD:
                cost += 100.0
        if cost < least:
            best, least = branch, cost
    return best


@inner
def finger_joints(p: Array, links: Array, seed: Array, limits: Array, q: Array) -> bool:
    """Write theta, psi, phi (3,) for a contact point; whether the finger reaches it at all.

    In a path (finite steps) the finger stays on its branch. Where a joint is held back, the
    joints after it make the best of it: psi and phi from where theta really is, phi from psi.

    Args:
        p: Wanted contact point (3,) [m] in F.
        links: l1, l2, l3 [m].
        seed: Joints (3,) to stay next to [rad].
        limits: Rows lower, upper, largest step: (3, 3) [rad].
        q: Joints (3,), inside the limits and a step of the seed.
    """
    is_path = math.isfinite(limits[2, 0])
    branch = _branch_of(seed, links) if is_path else _nearest_branch(p, links, seed, limits)
    is_reachable = finger_branch(p, links, branch, seed[0], q)
    wanted = turned(q[0], seed[0], limits[0, 0], limits[1, 0], is_path)
    q[0] = bounded(wanted, seed[0], limits[0, 0], limits[1, 0], limits[2, 0])
    r = p[0] * math.cos(q[0]) + p[1] * math.sin(q[0]) - links[0]
    if abs(q[0] - wanted) > _HELD:
        _bent(r, p[2], links, branch % 2 == 0, q)
    wanted = turned(q[1], seed[1], limits[0, 1], limits[1, 1], is_path)
    q[1] = bounded(wanted, seed[1], limits[0, 1], limits[1, 1], limits[2, 1])
    if abs(q[1] - wanted) > _HELD:
        x, z = r - links[1] * math.cos(q[1]), p[2] - links[1] * math.sin(q[1])
        q[2] = math.atan2(z, x) - q[1]
    wanted = turned(q[2], seed[2], limits[0, 2], limits[1, 2], is_path)
    q[2] = bounded(wanted, seed[2], limits[0, 2], limits[1, 2], limits[2, 2])
    return bool(is_reachable)
