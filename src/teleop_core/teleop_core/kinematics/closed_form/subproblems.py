"""Subproblems of closed-form inverse kinematics: angles that solve linear equations in sines.

Every arm that decomposes leads to two kinds of equations. *One angle*: a cos x + b sin x = d, with two solutions
(subproblems 1, 3 and 4 of Paden and Kahan). *A pair of angles*: two equations that are linear in (cos x, sin x) and in
(cos y, sin y), with two to four pairs (subproblems 5 and 6). If an equation has no solution, the result is the angle
with the smallest error, marked as not exact.

Source:
    Murray, Li and Sastry 1994, section 3.3; Elias and Wen 2022, Canonical subproblems for robot
    inverse kinematics. The elimination by null vectors is derived.
"""

import math

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room

# An equation whose error, divided by its squared amplitude, is not larger counts as solved.
_SLACK = 1e-9
# An equation with a smaller amplitude does not determine its angle; the angle is then the seed.
_FREE = 1e-12
_STEPS = 60  # largest number of steps of a bracketed Newton search


@inner
def one_angle(a: float, b: float, d: float, seed: float) -> tuple[float, float, float]:
    """Base and spread of the two angles x = base ± spread with a cos x + b sin x = d.

    Returns:
        Base [rad], spread [rad] in [0, pi], and 1.0 if the angles solve the equation. Otherwise the last value is 0.0,
        and the two angles are equal to the angle with the smallest error. If a and b are zero, the base is the seed.
    """
    square = a * a + b * b
    if square <= _FREE * _FREE:
        return seed, 0.0, 1.0 if abs(d) <= _FREE else 0.0
    size = math.sqrt(square)
    rest = (size - d) * (size + d)
    spread = math.atan2(math.sqrt(max(rest, 0.0)), d)
    return math.atan2(b, a), spread, 1.0 if rest >= -_SLACK * square else 0.0


@inner
def turn_between(x0: float, y0: float, x1: float, y1: float, seed: float) -> float:
    """Angle [rad] that rotates the direction of (x0, y0) to that of (x1, y1); the seed if a vector is zero."""
    if min(x0 * x0 + y0 * y0, x1 * x1 + y1 * y1) <= _FREE * _FREE:
        return seed
    return math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)


@inner
def _value(p: Array, degree: int, t: float) -> tuple[float, float]:
    """Value and slope of a polynomial; p[i] is the coefficient of t^i."""
    value, slope = p[degree], 0.0
    for i in range(degree - 1, -1, -1):
        slope = slope * t + value
        value = value * t + p[i]
    return value, slope


@inner
def _root(p: Array, degree: int, low: float, high: float) -> float:
    """Root between two points with values of opposite sign, by Newton steps kept in the bracket."""
    is_rising = _value(p, degree, low)[0] < 0.0
    t = 0.5 * (low + high)
    for _ in range(_STEPS):
        value, slope = _value(p, degree, t)
        if (value < 0.0) == is_rising:
            low = t
        else:
            high = t
        after = t - value / slope if slope != 0.0 else low
        if not low < after < high:
            after = 0.5 * (low + high)
        if abs(after - t) <= 1e-16:
            break
        t = after
    return t


@inner
def _roots(p: Array, work: Array, most: int) -> int:
    """Write real roots of p (5,) in [-1, 1], and its extrema, into rows of ``work`` (6, 7).

    The roots of each derivative bracket those of the derivative one order lower (Rolle). Row 0 gets the roots of p,
    row 1 those of its slope; rows 2 to 5 are scratch memory.

    Returns:
        10 times the number of extrema, plus the number of roots.
    """
    count, before = 0, 0
    for degree in range(1, most + 1):
        order = most - degree
        q = work[5]
        for i in range(degree + 1):
            factor = 1.0
            for k in range(order):
                factor *= i + order - k
            q[i] = factor * p[i + order]
        before = count
        for i in range(before):
            work[1, i] = work[0, i]
        count, low = 0, -1.0
        for i in range(before + 1):
            high = work[1, i] if i < before else 1.0
            if (_value(q, degree, low)[0] < 0.0) != (_value(q, degree, high)[0] < 0.0):
                work[0, count] = _root(q, degree, low, high)
                count += 1
            low = high
    return 10 * before + count


@inner
def _append(found: Array, count: int, angle: float, is_exact: float) -> int:
    if count < found.shape[0]:
        found[count, 0], found[count, 2] = angle, is_exact
        count += 1
    return count


@kernel
def circle_roots(f: Array, work: Array, found: Array) -> int:
    """Angles x where f0 + f1 cos x + f2 sin x + f3 cos 2x + f4 sin 2x is 0, or nearly so.

    The angle is written into column 0 of ``found`` (4, 3). Column 2 is 1.0 for a root, and 0.0 for an extremum that
    does not reach 0. ``work`` (7, 7) is scratch memory.

    Returns:
        Number of angles, 0 to 4.
    """
    count, p = 0, work[6]
    size = abs(f[0]) + abs(f[1]) + abs(f[2]) + abs(f[3]) + abs(f[4])
    for half in range(2):
        sign, shift = (1.0, 0.0) if half == 0 else (-1.0, math.pi)
        a, b = sign * f[1], sign * f[2]
        p[0], p[1] = f[0] + a + f[3], 2.0 * b + 4.0 * f[4]
        p[2] = 2.0 * f[0] - 6.0 * f[3]
        p[3], p[4] = 2.0 * b - 4.0 * f[4], f[0] - a + f[3]
        counts = _roots(p, work, 4)
        for i in range(counts % 10):
            count = _append(found, count, shift + 2.0 * math.atan(work[0, i]), 1.0)
        for i in range(counts // 10):
            t = work[1, i]
            value = _value(p, 4, t)[0] / (1.0 + t * t) ** 2
            bend = 2.0 * p[2] + 6.0 * p[3] * t + 12.0 * p[4] * t * t
            if value * bend > 0.0:
                is_exact = 1.0 if abs(value) <= _SLACK * size else 0.0
                count = _append(found, count, shift + 2.0 * math.atan(t), is_exact)
    return count


@inner
def _alone(A: Array, h: Array, rule: Array, seed: float) -> tuple[float, float, float]:
    """Base, spread and exactness of the angle that remains after a null vector eliminates the other angle."""
    n0, n1 = rule[1], rule[2]
    a, b = n0 * A[0, 0] + n1 * A[1, 0], n0 * A[0, 1] + n1 * A[1, 1]
    return one_angle(a, b, n0 * h[0] + n1 * h[1], seed)


@inner
def _beside(A: Array, B: Array, h: Array, rule: Array, x: float, seed: float) -> tuple[float, float, float]:
    """Base, spread and exactness of the angle with factors B, given the angle ``x`` with factors A."""
    row = int(rule[3])
    d = h[row] - A[row, 0] * math.cos(x) - A[row, 1] * math.sin(x)
    return one_angle(B[row, 0], B[row, 1], d, seed)


@kernel
def open_pairs(A: Array, B: Array, h: Array, rule: Array, seeds: Array, pairs: Array) -> int:
    """Begin pairs with A (cos x, sin x) + B (cos y, sin y) = h: rows of ``pairs`` (4, 4 or more).

    A row contains x, y, 1.0 if the pair solves the equations, and 1.0 if both angles are written. Otherwise only one
    angle is written, with one value in rows 0 and 1, and another value in rows 2 and 3. :func:`close_pair` then writes
    the other angle. So callers that need only one pair save the work for the other pairs.

    Args:
        A: Factors of x, (2, 2).
        B: Factors of y, (2, 2).
        h: Right-hand side (2,).
        rule: Method (4,): 0 if B has a null vector, 1 if A has one, 2 if neither; the null vector, two numbers;
            and the row that remains for the second angle.
        seeds: Values of x and y to use if the equations leave them free (2,).
        pairs: Resulting pairs; written.

    Returns:
        Number of pairs; if no pair solves the equations, the pairs are those with the smallest error.
    """
    if rule[0] > 1.5:
        return _skew(A, B, h, pairs)
    if rule[0] < 0.5:
        base, spread, is_exact = _alone(A, h, rule, seeds[0])
    else:
        base, spread, is_exact = _alone(B, h, rule, seeds[1])
    for k in range(4):
        pairs[k, int(rule[0])] = base + spread if k < 2 else base - spread
        pairs[k, 2], pairs[k, 3] = is_exact, 0.0
    return 4


@inner
def close_pair(A: Array, B: Array, h: Array, rule: Array, seeds: Array, k: int, pairs: Array) -> None:
    """Write the other angle of rows k and k + 1 of pairs from :func:`open_pairs`."""
    if rule[0] < 0.5:
        base, spread, is_exact = _beside(A, B, h, rule, pairs[k, 0], seeds[1])
    else:
        base, spread, is_exact = _beside(B, A, h, rule, pairs[k, 1], seeds[0])
    other = 1 - int(rule[0])
    for j in range(2):
        pairs[k + j, other] = base + spread if j == 0 else base - spread
        pairs[k + j, 2] *= is_exact
        pairs[k + j, 3] = 1.0


@kernel
def _skew(A: Array, B: Array, h: Array, pairs: Array) -> int:
    """Write all pairs if neither A nor B has a null vector, by an equation of degree four."""
    work, f, found = room(7, 7), room(5), room(4, 3)
    over = 1.0 / (B[0, 0] * B[1, 1] - B[0, 1] * B[1, 0])
    g0, g1 = over * (B[1, 1] * h[0] - B[0, 1] * h[1]), over * (B[0, 0] * h[1] - B[1, 0] * h[0])
    u0 = over * (B[0, 1] * A[1, 0] - B[1, 1] * A[0, 0])
    u1 = over * (B[1, 0] * A[0, 0] - B[0, 0] * A[1, 0])
    v0 = over * (B[0, 1] * A[1, 1] - B[1, 1] * A[0, 1])
    v1 = over * (B[1, 0] * A[0, 1] - B[0, 0] * A[1, 1])
    # The vector of the other angle is g + u cos x + v sin x; its length is 1.
    uu, vv = u0 * u0 + u1 * u1, v0 * v0 + v1 * v1
    f[0] = g0 * g0 + g1 * g1 + 0.5 * (uu + vv) - 1.0
    f[1], f[2] = 2.0 * (g0 * u0 + g1 * u1), 2.0 * (g0 * v0 + g1 * v1)
    f[3], f[4] = 0.5 * (uu - vv), u0 * v0 + u1 * v1
    count = int(circle_roots(f, work, found))
    for k in range(count):
        c, s = math.cos(found[k, 0]), math.sin(found[k, 0])
        pairs[k, 0], pairs[k, 2], pairs[k, 3] = found[k, 0], found[k, 2], 1.0
        pairs[k, 1] = math.atan2(g1 + u1 * c + v1 * s, g0 + u0 * c + v0 * s)
    return count
