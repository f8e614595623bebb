"""Planar 3R: three parallel rotary joints, two branches; also the two-link solution of others.

Modified (Craig) Denavit-Hartenberg table: alpha = 0, a = 0, l1, l2, d = 0, and a tool l3 along
the last x axis. The arm controls x, y and the heading about z.

Source:
    Ghosal 2020, lecture 6, planar 3R; it prints no lengths, the defaults are assumed.
"""

import math

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array
from teleop_core.robots.branches import hold, is_allowed, move_cost, turn, wrapped
from teleop_core.robots.drives import ENTRIES, Drives
from teleop_core.robots.kinematics import REACHED, IkStatus, Kernels, is_askable, pose_residual
from teleop_core.robots.robot import Robot, geometry_of

JOINTS = ("theta1", "theta2", "theta3")
GEOMETRY = {"l1": 1.0, "l2": 0.8, "l3": 0.5}
_DEGREES = math.pi / 180.0
UPPER = np.array([170.0, 160.0, 170.0]) * _DEGREES  # assumed
HOME = np.array([30.0, 60.0, -30.0]) * _DEGREES

DRIVES = Drives(  # assumed
    inertia=np.array([3.0, 1.0, 0.1]),
    viscous=np.array([2.0, 1.0, 0.1]),
    coulomb=np.array([1.0, 0.5, 0.05]),
    friction_speed=np.full(3, 0.01),
    effort_limit=np.array([150.0, 60.0, 10.0]),
    speed_limit=np.array([3.0, 3.0, 6.0]),
    encoder_step=np.full(3, 1e-5),
    bandwidth=np.full(3, 60.0),
    assumed=ENTRIES,
)

# Below this distance [m] a point counts as lying on the axis that turns it, and the joint stays.
ON_AXIS = 1e-12
# Sine of the elbow under which small moves need large joint moves.
NEAR = 0.02
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@inner
def pointing(x: float, y: float, seed: float) -> float:
    """Direction [rad] of a point from an axis; the seed if it lies on the axis."""
    return math.atan2(y, x) if x * x + y * y > ON_AXIS * ON_AXIS else seed


@inner
def elbow_angle(x: float, y: float, a: float, b: float) -> tuple[float, bool]:
    """Angle in [0, pi] between links a and b that puts their end at the distance of (x, y).

    The other elbow has the opposite sign.

    Returns:
        The angle [rad], 0 beyond reach and pi too close, and whether the point is reached.
    """
    k = (x * x + y * y - a * a - b * b) / (2.0 * a * b)
    root = math.sqrt(max(1.0 - k * k, 0.0))
    return math.atan2(root, k), abs(k) <= 1.0 + ON_AXIS


@inner
def first_angle(x: float, y: float, a: float, b: float, elbow: float, seed: float) -> float:
    """Angle [rad] of link a that points links a and b, bent by the elbow, at (x, y).

    Folded onto the axis by equal links, any angle will do and the seed's is kept.
    """
    along, across = a + b * math.cos(elbow), b * math.sin(elbow)
    if along * along + across * across <= ON_AXIS * ON_AXIS:
        return seed
    return pointing(x, y, seed + math.atan2(across, along)) - math.atan2(across, along)


@inner
def second_angle(x: float, y: float, a: float, q1: float, seed: float) -> float:
    """Angle [rad] between the links that points link b at (x, y) from where link a really is."""
    elbow_x, elbow_y = a * math.cos(q1), a * math.sin(q1)
    return pointing(x - elbow_x, y - elbow_y, q1 + seed) - q1


@kernel
def heading(T: Array) -> float:
    """Turn about z [rad] next to the rotation of T."""
    return math.atan2(T[1, 0] - T[0, 1], T[0, 0] + T[1, 1])


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip``, (4, 4), of joints (3,).

    Source:
        Ghosal 2020, lecture 6, 0_ToolT of the planar 3R.
    """
    l1, l2, l3 = geometry[0], geometry[1], geometry[2]
    c, s = math.cos(q[0] + q[1] + q[2]), math.sin(q[0] + q[1] + q[2])
    for i in range(4):
        for j in range(4):
            T[i, j] = 1.0 if i == j else 0.0
    T[0, 0], T[0, 1], T[1, 0], T[1, 1] = c, -s, s, c
    T[0, 3] = l1 * math.cos(q[0]) + l2 * math.cos(q[0] + q[1]) + l3 * c
    T[1, 3] = l1 * math.sin(q[0]) + l2 * math.sin(q[0] + q[1]) + l3 * s


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the geometric Jacobian (6, 3): rows linear, then angular, in base axes."""
    x = y = angle = 0.0
    for i in range(3):
        angle += q[i]
    for j in range(2, -1, -1):
        x += geometry[j] * math.cos(angle)
        y += geometry[j] * math.sin(angle)
        angle -= q[j]
        for i in range(6):
            J[i, j] = 0.0
        J[0, j], J[1, j], J[5, j] = -y, x, 1.0


@kernel
def _solve(T: Array, geometry: Array, is_other: bool, seed: Array, q: Array) -> bool:
    """Write one branch (3,), elbow angle positive or, the other, negative; whether it reaches."""
    l1, l2, l3 = geometry[0], geometry[1], geometry[2]
    angle = heading(T)
    x, y = T[0, 3] - l3 * math.cos(angle), T[1, 3] - l3 * math.sin(angle)
    elbow, is_reachable = elbow_angle(x, y, l1, l2)
    q[1] = -elbow if is_other else elbow
    q[0] = first_angle(x, y, l1, l2, q[1], seed[0])
    q[2] = angle - q[0] - q[1]
    return is_reachable


@inner
def _settle(T: Array, seed: Array, limits: Array, geometry: Array, q: Array) -> None:
    """Keep a branch inside limits and steps; each joint makes the best of those before it."""
    angle, l3 = heading(T), geometry[2]
    x, y = T[0, 3] - l3 * math.cos(angle), T[1, 3] - l3 * math.sin(angle)
    for i in range(3):
        if i == 1:
            q[1] = second_angle(x, y, geometry[0], q[0], seed[1])
        elif i == 2:
            q[2] = angle - q[0] - q[1]
        turn(q, seed, limits, i, i + 1)
        hold(q, i, seed, limits)


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (3,) next to ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`.

    Position in the plane and heading are followed; height and tilt of T are left as residual.

    Source:
        Craig 2005, section 4.4; the atan2 form is derived.
    """
    if not is_askable(T, seed):
        return -1
    trial, best = np.empty(3), math.inf
    is_reachable = False
    for branch in range(2):
        is_reachable = _solve(T, geometry, branch == 1, seed, trial)
        turn(trial, seed, limits, 0, 3)
        cost = move_cost(trial, seed, limits, 0, 3)
        if cost < best:
            best = cost
            for i in range(3):
                q[i] = trial[i]
    if not is_allowed(q, seed, limits):
        _settle(T, seed, limits, geometry, q)
    reached = np.empty((4, 4))
    fk(q, geometry, reached)
    pose_residual(reached, T, residual)
    off = math.hypot(reached[0, 3] - T[0, 3], reached[1, 3] - T[1, 3])
    twist = wrapped(q[0] + q[1] + q[2] - heading(T))
    if off > REACHED or abs(twist) > REACHED:
        return _LIMITED if is_reachable else _UNREACHABLE
    return _NEAR_SINGULAR if abs(math.sin(q[1])) < NEAR else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the two branches (2, 3), positive elbow first, for position and heading; their number.

    A pose off the plane or tilted has none.
    """
    for branch in range(2):
        if not _solve(T, geometry, branch == 1, np.zeros(3), solutions[branch]):
            return 0
        for i in range(3):
            solutions[branch, i] = wrapped(solutions[branch, i])
    reached, residual = np.empty((4, 4)), np.empty(2)
    fk(solutions[0], geometry, reached)
    return 2 if pose_residual(reached, T, residual) else 0


def make(**geometry: float | str) -> Robot:
    """Planar 3R; ``l1``, ``l2`` links, ``l3`` tool [m]."""
    row = geometry_of(GEOMETRY, geometry)
    for symbol, value in row.items():
        if not 0.0 <= value <= 10.0 or (value == 0.0 and symbol != "l3"):
            raise ParameterError(symbol, value, "above 0 (l3: at least 0) and at most 10 m")
    return Robot(
        name="planar_3r",
        joint_names=JOINTS,
        lower=-UPPER,
        upper=UPPER,
        home=HOME,
        geometry=row,
        kernels=Kernels(fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all),
        drives=DRIVES,
        task_mask=(True, True, False, False, False, True),
    )
