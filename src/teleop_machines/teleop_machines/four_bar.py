"""Four-bar: a crank that moves a point of the coupler along a plane curve.

q is the crank angle theta1 only; the tip is the point of the coupler at distance ``a`` from the crank, with x along the
coupler. ``ik`` finds the point of the coupler curve nearest to the wanted x and y; the rest of the pose error is the
residual. ``mode``, 1 or -1, is the sign of the arc cosine in the closure. For a crank angle at which the loop does not
close, :meth:`Robot.fk` raises an error, and :meth:`Robot.solve_fk` returns NOT_CLOSED and the loop with the smallest
gap. :class:`FourBar` computes both modes and all forms of the closure.

Source:
    Ghosal 2020, lecture 11, section on the planar 4-bar; Freudenstein 1954.
"""

import math
from typing import NamedTuple

import numpy as np

from teleop_core import kinematics
from teleop_core.base import ParameterError
from teleop_core.kernels import Array, inner, kernel
from teleop_core.kinematics import branches
from teleop_core.robots.robot import Robot, geometry_of
from teleop_machines.bodies.planar import four_bar_bodies
from teleop_machines.drives import geared_motors
from teleop_machines.four_bar_loop import Assembly, Closure, FourBar

__all__ = ["GEOMETRY", "Assembly", "Closure", "FourBar", "make"]

# No lengths are published; these lengths make a crank-rocker.
GEOMETRY = {"l0": 0.4, "l1": 0.1, "l2": 0.35, "l3": 0.25, "a": 0.175, "mode": 1.0}
_TURNS = 4.0 * math.pi  # assumed cable limit of a crank that can rotate fully
_SAMPLES = 90  # number of samples of the coupler curve in the search for its nearest point
# With a smaller sine of the angle between coupler and rocker, the crank hardly determines the coupler.
_NEAR = 0.02
_ROUNDING = 1e-12
_CLOSE = 1e-15  # smaller improvements of the distance are ignored [m]
_FOLLOWED, _LIMITED = int(kinematics.IkStatus.FOLLOWED), int(kinematics.IkStatus.LIMITED)
_CLOSED, _NOT_CLOSED = int(kinematics.FkStatus.CLOSED), int(kinematics.FkStatus.NOT_CLOSED)
_NEAR_SINGULAR_FK = int(kinematics.FkStatus.NEAR_SINGULAR)
_NEAR_SINGULAR, _UNREACHABLE = (int(kinematics.IkStatus.NEAR_SINGULAR), int(kinematics.IkStatus.UNREACHABLE))


class Directions(NamedTuple):
    """Cosine and sine of the angles of the three moving links."""

    crank_x: float
    crank_y: float
    rocker_x: float
    rocker_y: float
    coupler_x: float
    coupler_y: float


@inner
def _links(theta1: float, g: Array) -> Directions:
    """Directions of crank, rocker and coupler in the robot's mode; with the smallest gap if the loop is open.

    Points are relative to the end of the crank. The right pivot is at (x, y). The end of the rocker, where the coupler
    must end, is at (x, y) + l3 (cos phi1, sin phi1).
    """
    l0, l1, l2, l3 = g[0], g[1], g[2], g[3]
    c1, s1 = math.cos(theta1), math.sin(theta1)
    x, y = l0 - l1 * c1, -l1 * s1
    distance = math.sqrt(x * x + y * y)
    cosine, along, across = -1.0, 1.0, 0.0
    if distance > 0.0:
        cosine = (l2 * l2 - distance * distance - l3 * l3) / (2.0 * l3 * distance)
        cosine, along, across = min(max(cosine, -1.0), 1.0), x / distance, y / distance
    sine = g[5] * math.sqrt(1.0 - cosine * cosine)
    c3, s3 = along * cosine - across * sine, across * cosine + along * sine
    x, y = l3 * c3 + x, l3 * s3 + y
    length = math.sqrt(x * x + y * y)
    return Directions(c1, s1, c3, s3, x / length, y / length)


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip``, (4, 4), of the coupler point for theta1 (1,) [rad]."""
    links = _links(q[0], geometry)
    l1, a, c, s = geometry[1], geometry[4], links.coupler_x, links.coupler_y
    T[:] = 0.0
    T[0, 0], T[0, 1], T[1, 0], T[1, 1], T[2, 2], T[3, 3] = c, -s, s, c, 1.0, 1.0
    T[0, 3], T[1, 3] = l1 * links.crank_x + a * c, l1 * links.crank_y + a * s


@kernel
def assemble(q: Array, geometry: Array, ask: Array, T: Array, out: Array) -> int:
    """Write ``T_base_tip`` of theta1 (1,); see :class:`kinematics.Kernels`.

    With a seed, the result is the mode whose point is nearer to the seed's point. At the end of the range the angles of
    the two modes are equal. Two modes need no search.
    """
    g = geometry.copy()
    if ask[1] > 0.0:
        seed, other = T.copy(), np.empty((4, 4))
        g[5] = -geometry[5]
        fk(q, g, other)
        fk(q, geometry, T)
        if np.abs(other - seed).max() >= np.abs(T - seed).max():
            g[5] = geometry[5]
    fk(q, g, T)
    links = _links(q[0], g)
    x = g[0] + g[3] * links.rocker_x - g[1] * links.crank_x
    y = g[3] * links.rocker_y - g[1] * links.crank_y
    out[0] = abs(math.sqrt(x * x + y * y) - g[2])
    out[1] = g[5] * geometry[5]
    if out[0] > kinematics.REACHED:
        return _NOT_CLOSED
    sine = links.rocker_y * links.coupler_x - links.rocker_x * links.coupler_y
    return _NEAR_SINGULAR_FK if abs(sine) < _NEAR else _CLOSED


@kernel
def assemblies(q: Array, geometry: Array, found: Array) -> int:
    """Write ``T_base_tip`` of theta1 (1,) in both modes; see :class:`kinematics.Kernels`."""
    g, out = geometry.copy(), np.empty(2)
    if assemble(q, g, np.zeros(2), found[0], out) >= _NOT_CLOSED:
        return 0
    g[5] = -g[5]
    fk(q, g, found[1])
    return 2 if np.abs(found[0] - found[1]).max() > kinematics.REACHED else 1


@inner
def _slopes(theta1: float, g: Array) -> tuple[float, float, float]:
    """Slopes of the coupler point [m/rad] and of the coupler's angle along theta1.

    The slopes are bounded where coupler and rocker are in line. The ends of the coupler have the same speed along the
    rocker: l1 sin(phi1 - theta1) + l2 sin(phi1 - coupler) d coupler/d theta1 = 0.
    """
    c1, s1, c3, s3, c, s = _links(theta1, g)
    sine = s3 * c - c3 * s
    sine = math.copysign(max(abs(sine), _ROUNDING), sine)
    turn = -g[1] * (s3 * c1 - c3 * s1) / (g[2] * sine)
    return -g[1] * s1 - g[4] * turn * s, g[1] * c1 + g[4] * turn * c, turn


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the Jacobian (6, 1)."""
    J[:] = 0.0
    J[0, 0], J[1, 0], J[5, 0] = _slopes(q[0], geometry)


@inner
def _gap(theta1: float, T: Array, g: Array) -> tuple[float, float]:
    """Vector [m] from the coupler point to the position of T, in x and y."""
    links = _links(theta1, g)
    x = T[0, 3] - g[1] * links.crank_x - g[4] * links.coupler_x
    return x, T[1, 3] - g[1] * links.crank_y - g[4] * links.coupler_y


@inner
def _distance(theta1: float, T: Array, g: Array) -> float:
    """Distance [m] of the coupler point from the position of T."""
    x, y = _gap(theta1, T, g)
    return math.sqrt(x * x + y * y)


@inner
def _refined(theta1: float, lower: float, upper: float, T: Array, g: Array) -> float:
    """Crank angle in [lower, upper] at a local minimum of the coupler point's distance from T."""
    best = _distance(theta1, T, g)
    for _ in range(60):
        if best <= _CLOSE:
            break
        x, y = _gap(theta1, T, g)
        dx, dy, _ = _slopes(theta1, g)
        move = (dx * x + dy * y) / max(dx * dx + dy * dy, 1e-18)
        improved = False
        for _ in range(40):
            trial = min(max(theta1 + move, lower), upper)
            distance = _distance(trial, T, g)
            if distance < best:
                improved = True
                break
            move *= 0.5
        if not improved:
            break
        theta1, best = trial, distance
    return theta1


@inner
def _candidates(T: Array, g: Array) -> tuple[float, float]:
    """Mean and half the difference of the two crank angles at which the crank's end is at distance ``a`` from T."""
    x, y, l1, a = T[0, 3], T[1, 3], g[1], g[4]
    radius = math.sqrt(x * x + y * y)
    cosine = (radius * radius + l1 * l1 - a * a) / max(2.0 * l1 * radius, 1e-300)
    return math.atan2(y, x), math.acos(min(max(cosine, -1.0), 1.0))


@inner
def _nearest(T: Array, seed: float, limits: Array, g: Array) -> float:
    """Crank angle of the nearest point of the whole curve; of equally near points, the one nearest to the seed."""
    lower, upper = limits[0, 0], limits[1, 0]
    best, cost = seed, math.inf
    middle, half = _candidates(T, g)
    for side in (1.0, -1.0):
        angle = branches.turned(middle + side * half, seed, lower, upper, False)
        is_nearer = abs(angle - seed) < cost and lower - _ROUNDING <= angle <= upper + _ROUNDING
        if is_nearer and _distance(angle, T, g) <= kinematics.REACHED:
            best, cost = angle, abs(angle - seed)
    if cost < math.inf:
        return best
    start = max(lower, seed - math.pi)
    width = (min(upper, start + 2.0 * math.pi) - start) / _SAMPLES
    for i in range(_SAMPLES + 1):
        distance = _distance(start + i * width, T, g)
        if distance < cost:
            best, cost = start + i * width, distance
    return best


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write theta1 (1,); see :class:`teleop_core.robots.robot.Kernels`.

    In a path, the crank moves from its current angle towards smaller distance, so it stays on its part of the curve;
    otherwise the whole curve is searched.
    """
    if not kinematics.is_askable(T, seed):
        return -1
    lower, upper = limits[0, 0], limits[1, 0]
    start = branches.bounded(seed[0], seed[0], lower, upper, math.inf)
    if math.isinf(limits[2, 0]):
        start = _nearest(T, start, limits, geometry)
    else:
        lower, upper = max(lower, seed[0] - limits[2, 0]), min(upper, seed[0] + limits[2, 0])
        start = min(max(start, lower), upper)
    q[0] = min(max(_refined(start, lower, upper, T, geometry), limits[0, 0]), limits[1, 0])
    reached = np.empty((4, 4))
    fk(q, geometry, reached)
    kinematics.pose_residual(reached, T, residual)
    if _distance(q[0], T, geometry) > kinematics.REACHED:
        return _LIMITED if q[0] <= lower or q[0] >= upper else _UNREACHABLE
    links = _links(q[0], geometry)
    sine = links.rocker_y * links.coupler_x - links.rocker_x * links.coupler_y
    return _NEAR_SINGULAR if abs(sine) < _NEAR else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the crank angles (k, 1), k <= 2, whose coupler point is at T's x and y."""
    count = 0
    middle, half = _candidates(T, geometry)
    for side in (1.0, -1.0):
        angle = branches.wrapped(middle + side * half)
        is_exact = _distance(angle, T, geometry) <= kinematics.REACHED
        if is_exact and (count == 0 or abs(branches.wrapped(angle - solutions[0, 0])) > kinematics.REACHED):
            solutions[count, 0] = angle
            count += 1
    return count


def make(**geometry: float | str) -> Robot:
    """Four-bar with lengths l0..l3, coupler point ``a`` [m] and assembly ``mode`` 1 or -1."""
    row = geometry_of(GEOMETRY, geometry)
    loop = FourBar(row["l0"], row["l1"], row["l2"], row["l3"])
    if row["mode"] not in {1.0, -1.0}:
        raise ParameterError("mode", row["mode"], "1 or -1")
    ranges = loop.crank_ranges()
    if not ranges:
        lengths = (loop.l0, loop.l1, loop.l2, loop.l3)
        raise ParameterError("l0, l1, l2, l3", lengths, "lengths that close a loop")
    lower, upper = ranges[0]
    if (lower, upper) == (-math.pi, math.pi):
        lower, upper = -_TURNS, _TURNS
    drives = geared_motors(1)
    return Robot(
        name="four_bar",
        joint_names=("theta1",),
        lower=np.array([lower]),
        upper=np.array([upper]),
        home=np.array([0.5 * (lower + upper)]),
        geometry=row,
        kernels=kinematics.Kernels(
            fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all, assemble=assemble, assemblies=assemblies
        ),
        drives=drives,
        task_mask=(True, True, False, False, False, False),
        describe=four_bar_bodies,
    )
