"""SCARA: the R-R-P-R arm of electronic assembly, two branches.

Modified (Craig) Denavit-Hartenberg table: alpha = 0, a = 0, a1, a2, 0, d = 0, 0, -d3, 0; a
positive d3 lowers the tool. The arm controls the position and the heading about z.

Source:
    Ghosal 2020, lecture 6, SCARA; it prints no lengths, the defaults are assumed.
"""

import math

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array
from teleop_core.robots.branches import hold, is_allowed, move_cost, turn, wrapped
from teleop_core.robots.drives import ENTRIES, Drives
from teleop_core.robots.kinematics import REACHED, IkStatus, Kernels, is_askable, pose_residual
from teleop_core.robots.planar_3r import NEAR, elbow_angle, first_angle, heading, second_angle
from teleop_core.robots.robot import Robot, geometry_of

JOINTS = ("theta1", "theta2", "d3", "theta4")
GEOMETRY = {"a1": 0.4, "a2": 0.3}
_DEGREES = math.pi / 180.0
# Assumed: the usual ranges of arms of this size.
LOWER = np.array([-150.0 * _DEGREES, -150.0 * _DEGREES, 0.0, -360.0 * _DEGREES])
UPPER = np.array([150.0 * _DEGREES, 150.0 * _DEGREES, 0.2, 360.0 * _DEGREES])
HOME = np.array([-45.0 * _DEGREES, 90.0 * _DEGREES, 0.1, -45.0 * _DEGREES])

DRIVES = Drives(  # assumed
    inertia=np.array([0.6, 0.2, 6.0, 0.01]),
    viscous=np.array([1.0, 0.5, 20.0, 0.02]),
    coulomb=np.array([0.5, 0.3, 2.0, 0.02]),
    friction_speed=np.array([0.01, 0.01, 0.001, 0.02]),
    effort_limit=np.array([60.0, 30.0, 150.0, 4.0]),
    speed_limit=np.array([6.0, 8.0, 1.0, 20.0]),
    encoder_step=np.array([1e-5, 1e-5, 1e-6, 5e-5]),
    bandwidth=np.full(4, 60.0),
    assumed=ENTRIES,
)
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip``, (4, 4), of joints (4,).

    Source:
        Ghosal 2020, lecture 6, 0_4T of the SCARA.
    """
    angle = q[0] + q[1] + q[3]
    for i in range(4):
        for j in range(4):
            T[i, j] = 1.0 if i == j else 0.0
    T[0, 0] = T[1, 1] = math.cos(angle)
    T[1, 0] = math.sin(angle)
    T[0, 1] = -T[1, 0]
    T[0, 3] = geometry[0] * math.cos(q[0]) + geometry[1] * math.cos(q[0] + q[1])
    T[1, 3] = geometry[0] * math.sin(q[0]) + geometry[1] * math.sin(q[0] + q[1])
    T[2, 3] = -q[2]


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the geometric Jacobian (6, 4): rows linear, then angular, in base axes."""
    for i in range(6):
        for j in range(4):
            J[i, j] = 1.0 if i == 5 and j != 2 else 0.0
    x, y = geometry[1] * math.cos(q[0] + q[1]), geometry[1] * math.sin(q[0] + q[1])
    J[0, 1], J[1, 1] = -y, x
    J[0, 0] = -y - geometry[0] * math.sin(q[0])
    J[1, 0] = x + geometry[0] * math.cos(q[0])
    J[2, 2] = -1.0


@kernel
def _solve(T: Array, geometry: Array, is_other: bool, seed: Array, q: Array) -> bool:
    """Write one branch (4,), elbow angle positive or, the other, negative; whether it reaches."""
    elbow, is_reachable = elbow_angle(T[0, 3], T[1, 3], geometry[0], geometry[1])
    q[1] = -elbow if is_other else elbow
    q[0] = first_angle(T[0, 3], T[1, 3], geometry[0], geometry[1], q[1], seed[0])
    q[2] = -T[2, 3]
    q[3] = heading(T) - q[0] - q[1]
    return is_reachable


@inner
def _settle(T: Array, seed: Array, limits: Array, geometry: Array, q: Array) -> None:
    """Keep a branch inside limits and steps; each joint makes the best of those before it."""
    for i in range(4):
        if i == 1:
            q[1] = second_angle(T[0, 3], T[1, 3], geometry[0], q[0], seed[1])
        elif i == 3:
            q[3] = heading(T) - q[0] - q[1]
        if i != 2:  # joint 3 slides
            turn(q, seed, limits, i, i + 1)
        hold(q, i, seed, limits)


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (4,) next to ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`.

    Position and heading are followed; the tilt of T is left as residual.

    Source:
        Ghosal 2020, lecture 6, for the table; the atan2 form is derived.
    """
    if not is_askable(T, seed):
        return -1
    trial, best = np.empty(4), math.inf
    # In a path the stop of joint 4 has no say in which way the elbow points.
    deciding = 2 if math.isfinite(limits[2, 0]) else 4
    is_reachable = False
    for branch in range(2):
        is_reachable = _solve(T, geometry, branch == 1, seed, trial)
        turn(trial, seed, limits, 0, 2)
        turn(trial, seed, limits, 3, 4)
        cost = move_cost(trial, seed, limits, 0, deciding)
        if cost < best:
            best = cost
            for i in range(4):
                q[i] = trial[i]
    if not is_allowed(q, seed, limits):
        _settle(T, seed, limits, geometry, q)
    reached = np.empty((4, 4))
    fk(q, geometry, reached)
    pose_residual(reached, T, residual)
    twist = wrapped(q[0] + q[1] + q[3] - heading(T))
    if residual[0] > REACHED or abs(twist) > REACHED:
        return _LIMITED if is_reachable else _UNREACHABLE
    return _NEAR_SINGULAR if abs(math.sin(q[1])) < NEAR else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the two branches (2, 4), positive elbow first, for position and heading; their number.

    A tilted pose has none.
    """
    for branch in range(2):
        if not _solve(T, geometry, branch == 1, np.zeros(4), solutions[branch]):
            return 0
        for i in (0, 1, 3):
            solutions[branch, i] = wrapped(solutions[branch, i])
    reached, residual = np.empty((4, 4)), np.empty(2)
    fk(solutions[0], geometry, reached)
    return 2 if pose_residual(reached, T, residual) else 0


def make(**geometry: float | str) -> Robot:
    """SCARA; ``a1``, ``a2`` links [m]."""
    row = geometry_of(GEOMETRY, geometry)
    for symbol, value in row.items():
        if not 0.0 < value <= 10.0:
            raise ParameterError(symbol, value, "above 0 and at most 10 m")
    return Robot(
        name="scara",
        joint_names=JOINTS,
        lower=LOWER,
        upper=UPPER,
        home=HOME,
        geometry=row,
        kernels=Kernels(fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all),
        drives=DRIVES,
        task_mask=(True, True, True, False, False, True),
    )
