"""Arcs of the swivel: where the limits of shoulder and wrist cut the circle of psi.

A joint of a spherical shoulder is at a given angle where an equation linear in cos psi and sin psi
says so (:mod:`teleop_core.robots.swivel`), and likewise of the wrist. Between such cuts a branch is
legal as a whole or not at all.

Source:
    Shimizu, Kakuya, Yoon, Kitagaki and Kosuge 2008, IEEE T-RO 24(5), sections on joint limits;
    here for axes at any angles, with the equations of joints instead of their inverse functions.
"""

import math

import numpy as np

from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array
from teleop_core.robots.branches import turned, wrapped
from teleop_core.robots.closed_form import joint_of
from teleop_core.robots.spherical_wrist import wrist_angles
from teleop_core.robots.subproblems import one_angle

FIRST, FIFTH = 39, 87
"""Places, among the constants, of the transforms after joints 1 and 5."""
MARGIN = 0.1
"""Angle psi [rad] to the ends of its arc, at most a quarter of the arc."""
_SLACK = 1e-10  # rounding of a joint on its limit [rad]
_MOST = 36  # ends of arcs, and room


@inner
def blend(S: Array, psi: float, M: Array) -> None:
    """Write P cos psi + Q sin psi + N."""
    c, s = math.cos(psi), math.sin(psi)
    for i in range(3):
        for j in range(3):
            M[i, j] = c * S[i, j] + s * S[3 + i, j] + S[6 + i, j]


@inner
def _cut(a: float, b: float, d: float, edges: Array, count: int) -> int:
    """Append the psi where a cos psi + b sin psi = d, if any; the new count."""
    base, spread, is_exact = one_angle(a, b, d, 0.0)
    if is_exact > 0.5 and a * a + b * b > 1e-20:
        edges[count], edges[count + 1] = wrapped(base + spread), wrapped(base - spread)
        count += 2
    return count


@inner
def _cuts(S: Array, K: Array, at: int, i: int, limits: Array, edges: Array, count: int) -> int:
    """Append the psi where joints i, i + 1 or i + 2 meet a limit, or lose a solution."""
    r0, r1, r2 = K[at + 8], K[at + 9], K[at + 10]
    e0, e1 = r0 * K[at + 14] + r1 * K[at + 18], r1 * K[at + 14] - r0 * K[at + 18]
    even, size = r2 * K[at + 22], math.hypot(e0, e1)
    for side in range(2):
        far = even + size if side == 0 else even - size
        count = _cut(S[2, 2], S[5, 2], far - S[8, 2], edges, count)
        angle = K[1 + i] * limits[side, joint_of(K, 7, i)]
        c, s = math.cos(angle), math.sin(angle)
        x, y, z = c * K[at + 2] - s * K[at + 6], s * K[at + 2] + c * K[at + 6], K[at + 10]
        a, b = x * S[0, 2] + y * S[1, 2] + z * S[2, 2], x * S[3, 2] + y * S[4, 2] + z * S[5, 2]
        d = K[at + 22] - x * S[6, 2] - y * S[7, 2] - z * S[8, 2]
        count = _cut(a, b, d, edges, count)
        angle = K[2 + i] * limits[side, joint_of(K, 7, i + 1)]
        d = even + e0 * math.cos(angle) + e1 * math.sin(angle)
        count = _cut(S[2, 2], S[5, 2], d - S[8, 2], edges, count)
        angle = K[3 + i] * limits[side, joint_of(K, 7, i + 2)]
        c, s = math.cos(angle), math.sin(angle)
        x, y = c * K[at + 20] + s * K[at + 21], c * K[at + 21] - s * K[at + 20]
        z = K[at + 22]
        a, b = x * S[2, 0] + y * S[2, 1] + z * S[2, 2], x * S[5, 0] + y * S[5, 1] + z * S[5, 2]
        count = _cut(a, b, r2 - x * S[8, 0] - y * S[8, 1] - z * S[8, 2], edges, count)
    return count


@inner
def _sort(edges: Array, count: int) -> None:
    for k in range(1, count):
        value, at = edges[k], k
        while at > 0 and edges[at - 1] > value:
            edges[at] = edges[at - 1]
            at -= 1
        edges[at] = value


@inner
def _legal(angles: Array, is_exact: float, K: Array, i: int, seed: Array, limits: Array) -> int:
    """Bits of the two solutions (2, 3) of joints i to i + 2 that are inside the limits."""
    bits = 0
    for k in range(2):
        is_in = is_exact > 0.5
        for j in range(3):
            at = joint_of(K, 7, i + j)
            low, high = limits[0, at], limits[1, at]
            value = turned(K[1 + i + j] * angles[k, j], seed[at], low, high, False)
            is_in = is_in and low - _SLACK <= value <= high + _SLACK
        bits += (1 + k) if is_in else 0
    return bits


@inner
def _nearest(low: float, high: float) -> float:
    """Angle nearest to 0 in an arc less its margins [rad]."""
    margin = min(MARGIN, 0.25 * (high - low))
    best = math.inf
    for k in range(-1, 2):
        shift = 2.0 * math.pi * k
        psi = min(max(0.0, low + margin + shift), high - margin + shift)
        if abs(psi) < abs(best):
            best = psi
    return best


@inner
def _has(bits: float, shoulder: int, wrist: int) -> bool:
    """Whether the bits of a branch of the shoulder and of one of the wrist are set."""
    return (int(bits) & shoulder) != 0 and (int(bits) & wrist) != 0


@inner
def _psi_of(edges: Array, legal: Array, count: int, shoulder: int, wrist: int) -> float:
    """Psi of a branch next to 0 in its legal arcs; infinity where there is none."""
    first, psi, low, is_in = -1, math.inf, 0.0, False
    for k in range(count):
        if not _has(legal[k], shoulder, wrist):
            first = k
    if first < 0:
        return 0.0
    for step in range(1, count + 1):  # once round, from an arc that is not legal
        k = (first + step) % count
        is_legal = _has(legal[k], shoulder, wrist)
        if is_legal and not is_in:
            low = edges[k]
        elif is_in and not is_legal:
            high = edges[k] if edges[k] >= low else edges[k] + 2.0 * math.pi
            found = _nearest(low, high)
            psi = found if abs(found) < abs(psi) else psi
        is_in = is_legal
    return psi


@kernel
def swivels(
    S: Array, W: Array, K: Array, seed: Array, limits: Array, M: Array, angles: Array, psi: Array
) -> None:
    """Write the psi (4,) of each branch of shoulder and wrist; infinity where no arc is legal."""
    edges, legal = np.empty(_MOST), np.empty(_MOST)
    count = _cuts(W, K, FIFTH, 4, limits, edges, _cuts(S, K, FIRST, 0, limits, edges, 0))
    _sort(edges, count)
    if count == 0:
        edges[0], count = -math.pi, 1
    for k in range(count):
        high = edges[k + 1] if k + 1 < count else edges[0] + 2.0 * math.pi
        middle = 0.5 * (edges[k] + high)
        blend(S, middle, M)
        is_exact = wrist_angles(M, K, FIRST, 0.0, angles)[1]
        bits = _legal(angles, is_exact, K, 0, seed, limits)
        if bits > 0:
            blend(W, middle, M)
            is_exact = wrist_angles(M, K, FIFTH, 0.0, angles)[1]
            bits = 4 * bits + _legal(angles, is_exact, K, 4, seed, limits)
        legal[k] = bits
    for branch in range(4):
        psi[branch] = _psi_of(edges, legal, count, 4 * (1 + branch // 2), 1 + branch % 2)
