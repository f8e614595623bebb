"""Arcs of the swivel: the pieces into which the limits of shoulder and wrist cut the circle of psi.

The psi at which a joint of a spherical shoulder or wrist has a given angle follow from an equation linear in cos psi
and sin psi (:mod:`teleop_core.kinematics.closed_form.swivel`). At the limits these psi are cuts of the circle. Between
two cuts a branch is either completely legal or completely illegal.

Source:
    Shimizu, Kakuya, Yoon, Kitagaki and Kosuge 2008, IEEE T-RO 24(5), sections on joint limits;
    here for axes at any angles, with the equations of joints instead of their inverse functions.
"""

import math

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kinematics.branches import turned, wrapped
from teleop_core.kinematics.closed_form import candidates, spherical_wrist, subproblems, swivel_families

MARGIN = 0.1
"""Margin of psi [rad] to the ends of its arc; at most a quarter of the arc."""
ARCS = (8, 36)
"""Shape of the memory of a cut circle: starts of the pieces, and the branches that are legal in each piece."""
_ENOUGH = 4.0 * MARGIN  # an arc of at least this length has the full margin [rad]
_SLACK = 1e-10  # rounding of a joint on its limit [rad]
_UNKNOWN = -1.0


@inner
def blend(S: Array, psi: float, M: Array) -> None:
    """Write P cos psi + Q sin psi + N."""
    c, s = math.cos(psi), math.sin(psi)
    for i in range(3):
        for j in range(3):
            M[i, j] = c * S[i, j] + s * S[3 + i, j] + S[6 + i, j]


@inner
def _cut(a: float, b: float, d: float, edges: Array, count: int) -> int:
    """Append the solutions psi of a cos psi + b sin psi = d, if there are any; return the new count."""
    base, spread, is_exact = subproblems.one_angle(a, b, d, 0.0)
    if is_exact > 0.5 and a * a + b * b > 1e-20:
        edges[count], edges[count + 1] = wrapped(base + spread), wrapped(base - spread)
        count += 2
    return count


@inner
def _cuts(S: Array, K: Array, at: int, i: int, limits: Array, edges: Array, count: int) -> int:
    """Append the psi at which joint i, i + 1 or i + 2 reaches a limit, or a solution disappears."""
    r0, r1, r2 = K[at + 8], K[at + 9], K[at + 10]
    e0, e1 = r0 * K[at + 14] + r1 * K[at + 18], r1 * K[at + 14] - r0 * K[at + 18]
    even, size = r2 * K[at + 22], math.hypot(e0, e1)
    for side in range(2):
        far = even + size if side == 0 else even - size
        count = _cut(S[2, 2], S[5, 2], far - S[8, 2], edges, count)
        angle = K[1 + i] * limits[side, candidates.joint_of(K, 7, i)]
        c, s = math.cos(angle), math.sin(angle)
        x, y, z = c * K[at + 2] - s * K[at + 6], s * K[at + 2] + c * K[at + 6], K[at + 10]
        a, b = x * S[0, 2] + y * S[1, 2] + z * S[2, 2], x * S[3, 2] + y * S[4, 2] + z * S[5, 2]
        d = K[at + 22] - x * S[6, 2] - y * S[7, 2] - z * S[8, 2]
        count = _cut(a, b, d, edges, count)
        angle = K[2 + i] * limits[side, candidates.joint_of(K, 7, i + 1)]
        d = even + e0 * math.cos(angle) + e1 * math.sin(angle)
        count = _cut(S[2, 2], S[5, 2], d - S[8, 2], edges, count)
        angle = K[3 + i] * limits[side, candidates.joint_of(K, 7, i + 2)]
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
            at = candidates.joint_of(K, 7, i + j)
            low, high = limits[0, at], limits[1, at]
            value = turned(K[1 + i + j] * angles[k, j], seed[at], low, high, False)
            is_in = is_in and low - _SLACK <= value <= high + _SLACK
        bits += (1 + k) if is_in else 0
    return bits


@kernel
def cut_circle(S: Array, W: Array, K: Array, limits: Array, arcs: Array) -> None:
    """Cut the circle of psi at the limits into pieces, in memory of shape :data:`ARCS`."""
    count = _cuts(W, K, swivel_families.F5, 4, limits, arcs[0], _cuts(S, K, swivel_families.F1, 0, limits, arcs[0], 0))
    _sort(arcs[0], count)
    if count == 0:
        arcs[0, 0], count = -math.pi, 1
    for k in range(count):
        arcs[1, k] = _UNKNOWN
    arcs[2, 0] = count


@inner
def _edge(arcs: Array, j: int) -> float:
    """Psi [rad] at which piece j begins; j may be outside 0 to count - 1 by up to one full circle."""
    count = int(arcs[2, 0])
    if j < 0:
        return arcs[0, j + count] - 2.0 * math.pi
    return arcs[0, j] if j < count else arcs[0, j - count] + 2.0 * math.pi


@inner
def _is_legal(j: int, branch: int, S: Array, W: Array, K: Array, seed: Array, limits: Array, arcs: Array) -> bool:
    """Whether a branch of shoulder and wrist is legal in piece j; the result is stored in ``arcs``."""
    count, M, angles = int(arcs[2, 0]), arcs[3:6, :3], arcs[6:8, :3]
    k = j + count if j < 0 else (j if j < count else j - count)
    if arcs[1, k] == _UNKNOWN:
        middle = 0.5 * (_edge(arcs, k) + _edge(arcs, k + 1))
        blend(S, middle, M)
        is_exact = spherical_wrist.wrist_angles(M, K, swivel_families.F1, 0.0, angles)[1]
        bits = _legal(angles, is_exact, K, 0, seed, limits)
        if bits > 0:
            blend(W, middle, M)
            is_exact = spherical_wrist.wrist_angles(M, K, swivel_families.F5, 0.0, angles)[1]
            bits = 4 * bits + _legal(angles, is_exact, K, 4, seed, limits)
        arcs[1, k] = bits
    bits = int(arcs[1, k])
    return (bits & (4 * (1 + branch // 2))) != 0 and (bits & (1 + branch % 2)) != 0


@inner
def _nearest(low: float, high: float) -> float:
    """Angle nearest to 0 in an arc without its margins [rad]."""
    margin = min(MARGIN, 0.25 * (high - low))
    return min(max(0.0, low + margin), high - margin)


@kernel
def swivel_of(branch: int, S: Array, W: Array, K: Array, seed: Array, limits: Array, arcs: Array) -> float:
    """Psi [rad] of a branch nearest to 0 in its legal arcs; infinity if no arc is legal.

    ``arcs`` is the result of :func:`cut_circle`. Pieces are tested from psi = 0 outwards, until all remaining pieces
    are farther away than the answer. Neighbouring pieces of an arc are tested until its margin is certain.
    """
    count, psi = int(arcs[2, 0]), math.inf
    up = count - 1
    while up >= 0 and arcs[0, up] > 0.0:
        up -= 1
    down = up - 1
    while up - down <= count:
        above, below = max(_edge(arcs, up), 0.0), -_edge(arcs, down + 1)
        if min(above, below) >= abs(psi):
            break
        first = last = up if above <= below else down
        if _is_legal(first, branch, S, W, K, seed, limits, arcs):
            far = max(_edge(arcs, first), 0.0) + _ENOUGH
            while last - first < count and _edge(arcs, last + 1) < far:
                if not _is_legal(last + 1, branch, S, W, K, seed, limits, arcs):
                    break
                last += 1
            far = min(_edge(arcs, last + 1), 0.0) - _ENOUGH
            while last - first < count and _edge(arcs, first) > far:
                if not _is_legal(first - 1, branch, S, W, K, seed, limits, arcs):
                    break
                first -= 1
            if last - first >= count:
                return 0.0
            found = _nearest(_edge(arcs, first), _edge(arcs, last + 1))
            psi = found if abs(found) < abs(psi) else psi
        up, down = max(up, last + 1), min(down, first - 1)
    return psi
