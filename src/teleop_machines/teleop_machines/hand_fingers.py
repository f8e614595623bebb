"""Fingers of the three-fingered hand: contact point and joints of one R-R-R finger, as kernels.

A finger's base is at the origin of its frame F: theta rotates the finger about z, psi lifts the second link, phi bends
the third link. ``links`` are l1, l2, l3 [m]. Points are passed as three numbers, so that no array must be allocated.

Source:
    Ghosal 2020, lecture 6, table and F_p of the hand (after Salisbury 1982). The inverse kinematics and their four
    branches are derived from the table and F_p.
"""

import math
from typing import NamedTuple

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kinematics.branches import bounded, turned, wrapped

# Sine of phi that replaces 0 for a straight finger. It shortens the finger by less than rounding, and has a sign, so
# that a path through the straight position keeps its branch.
_STRAIGHT = 1e-8
_HELD = 1e-12
Triple = tuple[float, float, float]


class Branch(NamedTuple):
    """A branch of a finger: its number, its angles [rad], and whether the finger reaches the point."""

    number: int
    theta: float
    psi: float
    phi: float
    is_reachable: bool


@kernel
def finger_point(theta: float, psi: float, phi: float, links: Triple) -> Triple:
    """Contact point [m] in F."""
    outer = psi + phi
    r = links[0] + links[1] * math.cos(psi) + links[2] * math.cos(outer)
    z = links[1] * math.sin(psi) + links[2] * math.sin(outer)
    return math.cos(theta) * r, math.sin(theta) * r, z


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
def _bent(r: float, z: float, links: Triple, is_positive: bool) -> tuple[float, float, bool]:
    """Angles psi and phi for a point at distance r in front of joint 2 and z above joint 2.

    The third value is whether the finger reaches the point.
    """
    _, l2, l3 = links
    k = (r * r + z * z - l2 * l2 - l3 * l3) / (2.0 * l2 * l3)
    sine, cosine = max(math.sqrt(max(1.0 - k * k, 0.0)), _STRAIGHT), min(max(k, -1.0), 1.0)
    if not is_positive:
        sine = -sine
    psi = math.atan2(z, r) - math.atan2(l3 * sine, l2 + l3 * cosine)
    return wrapped(psi), math.atan2(sine, cosine), abs(k) <= 1.0 + 1e-12


@kernel
def finger_branch(p: Triple, links: Triple, branch: int, seed: float) -> tuple[float, float, float, bool]:
    """Angles theta, psi, phi of one of four branches; and whether the finger reaches p.

    In branches 0 and 1 the finger is turned towards p, in branches 2 and 3 away from p. Even branches have phi > 0. If
    p is on the axis of joint 1, every theta is possible, and the seed's theta is kept.
    """
    x, y, z = p
    theta, reach, turn = seed, math.sqrt(x * x + y * y), 0.0
    if branch > 1:
        reach, turn = -reach, math.pi
    if abs(reach) > 1e-12:
        theta = wrapped(math.atan2(y, x) + turn)
    psi, phi, is_reachable = _bent(reach - links[0], z, links, branch % 2 == 0)
    return theta, psi, phi, is_reachable


@inner
def _side(psi: float, phi: float, links: Triple) -> int:
    """Number of the branch that a finger is on."""
    reach = links[0] + links[1] * math.cos(psi) + links[2] * math.cos(psi + phi)
    return (2 if reach < 0.0 else 0) + (0 if math.sin(phi) >= 0.0 else 1)


@inner
def _cost(angles: Triple, seed: Array, limits: Array, first: int) -> float:
    """Largest joint move from the seed, plus 100 for each joint outside its limits."""
    worst, outside = 0.0, 0.0
    for i in range(3):
        j = first + i
        angle = turned(angles[i], seed[j], limits[0, j], limits[1, j], False)
        worst = max(worst, abs(angle - seed[j]))
        if angle < limits[0, j] - _HELD or angle > limits[1, j] + _HELD:
            outside += 100.0
    return worst + outside


@inner
def _nearest_branch(p: Triple, links: Triple, seed: Array, limits: Array, first: int) -> Branch:
    """Branch nearest to the seed by the largest joint move; a branch inside the limits is preferred.

    The search begins with the seed's sign of phi and with the theta that is less than a quarter turn away. The branches
    with the other sign or the other theta are examined only if the move of phi or theta alone is not already larger.
    """
    theta, phi = seed[first], seed[first + 2]
    is_away = p[0] * math.cos(theta) + p[1] * math.sin(theta) < 0.0
    begin = (2 if is_away else 0) + (0 if math.sin(phi) >= 0.0 else 1)
    best = finger_branch(p, links, begin, theta)
    least = _cost(best[:3], seed, limits, first) + (0.0 if best[3] else 1000.0)
    number, bend = begin, abs(wrapped(best[2] + phi))
    for k in range(1, 4):
        if least <= (bend if k == 1 else 0.5 * math.pi):
            continue
        found = finger_branch(p, links, begin ^ k, theta)
        cost = _cost(found[:3], seed, limits, first) + (0.0 if found[3] else 1000.0)
        if cost < least:
            number, best, least = begin ^ k, found, cost
    return Branch(number, best[0], best[1], best[2], best[3])


@inner
def _is_held(angle: float, i: int, seed: Array, limits: Array, q: Array) -> bool:
    """Write joint i, as near as possible to an angle plus full turns.

    Return whether limits or the step prevent this angle.
    """
    is_path = math.isfinite(limits[2, i])
    wanted = turned(angle, seed[i], limits[0, i], limits[1, i], is_path)
    q[i] = bounded(wanted, seed[i], limits[0, i], limits[1, i], limits[2, i])
    return bool(abs(q[i] - wanted) > _HELD)


@inner
def finger_joints(p: Triple, links: Triple, seed: Array, limits: Array, first: int, q: Array) -> bool:
    """Write theta, psi, phi for a contact point; return whether the finger reaches it.

    In a path (finite steps) the finger stays on its branch. If limits or the step change the angle of a joint, the
    later joints are computed for the changed angle: psi and phi for the changed theta, phi for the changed psi.

    Args:
        p: Wanted contact point [m] in F.
        links: l1, l2, l3 [m].
        seed: Joints (n,) near which the result should be [rad].
        limits: Rows lower, upper, largest step: (3, n) [rad].
        first: Index of theta among the joints.
        q: Output joints (n,), within the limits and one step of the seed.
    """
    if math.isfinite(limits[2, first]):
        side = _side(seed[first + 1], seed[first + 2], links)
        theta, psi, phi, is_reachable = finger_branch(p, links, side, seed[first])
        branch = Branch(side, theta, psi, phi, is_reachable)
    else:
        branch = _nearest_branch(p, links, seed, limits, first)
    psi, phi = branch.psi, branch.phi
    is_held = _is_held(branch.theta, first, seed, limits, q)
    r = p[0] * math.cos(q[first]) + p[1] * math.sin(q[first]) - links[0]
    if is_held:
        psi, phi, _ = _bent(r, p[2], links, branch.number % 2 == 0)
    if _is_held(psi, first + 1, seed, limits, q):
        psi = q[first + 1]
        phi = math.atan2(p[2] - links[1] * math.sin(psi), r - links[1] * math.cos(psi)) - psi
    _is_held(phi, first + 2, seed, limits, q)
    return bool(branch.is_reachable)
