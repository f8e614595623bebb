"""Five-axis articulated arm: yaw, three parallel pitches, roll; four branches.

Modified (Craig) Denavit-Hartenberg table: alpha = 0, -90, 0, 0, -90, 0 degrees, a = 0, 0, a2, a3,
0, 0, d = d1, 0, 0, 0, 0, d5, the last row without a joint. The tool stays in the vertical plane of
joint 1, so the arm controls position, pitch in that plane and roll about the tool. At home the
tool points down and the direction it lacks is the turn about x.

With psi = q2 + q3 + q4 the rotation is R = Rz(q1) Ry(psi) Rz(-q5) Rx(180°).

Source:
    Table 3.4 of the MMA thesis (its Microbot Alpha II and Rhino XR-3), joint 4 home corrected. It
    prints no lengths; the defaults are assumed, of the size of these arms.
"""

import math

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array
from teleop_core.robots.branches import OUTSIDE, hold, is_allowed, move_cost, turn, turned, wrapped
from teleop_core.robots.drives import ENTRIES, Drives
from teleop_core.robots.kinematics import REACHED, IkStatus, Kernels, is_askable, pose_residual
from teleop_core.robots.planar_3r import NEAR, elbow_angle, first_angle, pointing, second_angle
from teleop_core.robots.robot import Robot, geometry_of

JOINTS = tuple(f"theta{i}" for i in range(1, 6))
GEOMETRY = {"d1": 0.215, "a2": 0.1778, "a3": 0.1778, "d5": 0.1295}
_DEGREES = math.pi / 180.0
# Assumed.
LOWER = np.array([-150.0, -145.0, -10.0, -150.0, -270.0]) * _DEGREES
UPPER = np.array([150.0, 35.0, 150.0, 150.0, 270.0]) * _DEGREES
# Upper arm 60 degrees up, forearm 30 degrees down, tool straight down.
HOME = np.array([0.0, -60.0, 90.0, -30.0, 0.0]) * _DEGREES

DRIVES = Drives(  # assumed
    inertia=np.array([0.15, 0.15, 0.08, 0.02, 0.01]),
    viscous=np.array([0.3, 0.3, 0.2, 0.05, 0.02]),
    coulomb=np.array([0.2, 0.2, 0.15, 0.05, 0.02]),
    friction_speed=np.full(5, 0.01),
    effort_limit=np.array([15.0, 15.0, 10.0, 4.0, 2.0]),
    speed_limit=np.array([1.5, 1.5, 2.0, 3.0, 4.0]),
    encoder_step=np.full(5, 5e-5),
    bandwidth=np.full(5, 60.0),
    assumed=ENTRIES,
)
# Below this sine two axes count as one line and a joint keeps its value.
_COLLINEAR = 1e-10
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip``, (4, 4), of joints (5,).

    Source:
        Product of table 3.4 of the MMA thesis, derived.
    """
    psi, q23 = q[1] + q[2] + q[3], q[1] + q[2]
    c1, s1, c, s = math.cos(q[0]), math.sin(q[0]), math.cos(psi), math.sin(psi)
    c5, s5 = math.cos(q[4]), math.sin(q[4])
    T[0, 0], T[0, 1], T[0, 2] = c1 * c * c5 + s1 * s5, -c1 * c * s5 + s1 * c5, -c1 * s
    T[1, 0], T[1, 1], T[1, 2] = s1 * c * c5 - c1 * s5, -s1 * c * s5 - c1 * c5, -s1 * s
    T[2, 0], T[2, 1], T[2, 2] = -s * c5, s * s5, -c
    d1, a2, a3, d5 = geometry[0], geometry[1], geometry[2], geometry[3]
    r = a2 * math.cos(q[1]) + a3 * math.cos(q23) - d5 * s
    T[0, 3], T[1, 3] = c1 * r, s1 * r
    T[2, 3] = d1 - a2 * math.sin(q[1]) - a3 * math.sin(q23) - d5 * c
    T[3, 0] = T[3, 1] = T[3, 2] = 0.0
    T[3, 3] = 1.0


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the geometric Jacobian (6, 5): rows linear, then angular, in base axes."""
    c1, s1 = math.cos(q[0]), math.sin(q[0])
    psi = q[1] + q[2] + q[3]
    # From the tool back to the shoulder: horizontal and downward distance to each pitch axis.
    along, down = -geometry[3] * math.sin(psi), geometry[3] * math.cos(psi)
    for j in range(3, 0, -1):
        if j < 3:
            angle = q[1] + (q[2] if j == 2 else 0.0)
            along += geometry[j] * math.cos(angle)
            down += geometry[j] * math.sin(angle)
        J[0, j], J[1, j], J[2, j] = -c1 * down, -s1 * down, -along
        J[3, j], J[4, j], J[5, j] = -s1, c1, 0.0
    J[0, 0], J[1, 0], J[2, 0] = -s1 * along, c1 * along, 0.0
    J[3, 0], J[4, 0], J[5, 0] = 0.0, 0.0, 1.0
    J[0, 4], J[1, 4], J[2, 4] = 0.0, 0.0, 0.0
    J[3, 4], J[4, 4], J[5, 4] = -c1 * math.sin(psi), -s1 * math.sin(psi), -math.cos(psi)


@kernel
def pitch_and_roll(T: Array, q1: float, psi: float, q5: float) -> tuple[float, float]:
    """Pitch and joint 5 [rad] whose rotation is next to that of T, in the plane of joint 1.

    With N = Rz(-q1) R Rx(180°) the trace of Nᵀ Ry(psi) Rz(-q5) is greatest where psi leads the tool
    to its direction in the plane. psi + q5 or psi - q5, whichever is defined best, leads it to the
    attitude as a whole. A tool normal to the plane leaves only that one: the pitch moves from the
    given ``psi`` by as much as joint 5 from ``q5``.

    Source:
        Derived.
    """
    c, s = math.cos(q1), math.sin(q1)
    x, y, z = c * T[0, 0] + s * T[1, 0], c * T[0, 1] + s * T[1, 1], c * T[0, 2] + s * T[1, 2]
    out = s * T[0, 2] - c * T[1, 2]
    sign = 1.0 if out <= 0.0 else -1.0
    both = math.atan2(-sign * y - T[2, 0], x - sign * T[2, 1])  # psi + sign q5
    if math.hypot(z, T[2, 2]) > _COLLINEAR:
        psi = math.atan2(-z, -T[2, 2])
    else:
        psi += 0.5 * wrapped(both - psi - sign * q5)
    return psi, sign * (both - psi)


@inner
def _plane(T: Array, geometry: Array, seed: Array, q: Array) -> tuple[float, float, float]:
    """Pitch [rad], and where the tool is held ahead of and below joint 2 [m]; write joint 5."""
    psi, q[4] = pitch_and_roll(T, q[0], seed[1] + seed[2] + seed[3], seed[4])
    r = math.cos(q[0]) * T[0, 3] + math.sin(q[0]) * T[1, 3]
    d1, d5 = geometry[0], geometry[3]
    return psi, r + d5 * math.sin(psi), d1 - T[2, 3] - d5 * math.cos(psi)


@inner
def _bend(
    plane: tuple[float, float, float], geometry: Array, elbow: float, seed: float, q: Array
) -> None:
    """Write joints 2 to 4 for one sign of the elbow."""
    psi, x, y = plane
    q[1] = first_angle(x, y, geometry[1], geometry[2], elbow, seed)
    q[2], q[3] = elbow, psi - q[1] - elbow


@inner
def _choose(T: Array, seed: Array, limits: Array, geometry: Array, q: Array) -> bool:
    """Write the best of the four branches; whether the arm reaches the position at all.

    It begins with the side and the elbow of the seed: the others are solved only if they can
    still win.
    """
    trial, best, is_path = np.empty(5), math.inf, math.isfinite(limits[2, 0])
    base, is_reachable = pointing(T[0, 3], T[1, 3], seed[0]), False
    if abs(wrapped(base - seed[0])) > 0.5 * math.pi:
        base += math.pi
    for side in range(2):
        trial[0] = turned(base + math.pi * side, seed[0], limits[0, 0], limits[1, 0], is_path)
        if move_cost(trial, seed, limits, 0, 1) >= best:
            continue
        plane = _plane(T, geometry, seed, trial)
        elbow, is_arm = elbow_angle(plane[1], plane[2], geometry[1], geometry[2])
        is_reachable = is_reachable or is_arm
        for branch in range(2):
            elbow = math.copysign(elbow, seed[2]) if branch == 0 else -elbow
            if abs(wrapped(elbow - seed[2])) >= best:
                continue
            _bend(plane, geometry, elbow, seed[1], trial)
            turn(trial, seed, limits, 1, 5)
            cost = move_cost(trial, seed, limits, 0, 5) + (0.0 if is_arm else 10.0 * OUTSIDE)
            if cost < best:
                best = cost
                for i in range(5):
                    q[i] = trial[i]
    return is_reachable


@inner
def _settle(T: Array, seed: Array, limits: Array, geometry: Array, q: Array) -> None:
    """Keep a branch inside limits and steps; each joint makes the best of those before it."""
    psi, x, y = 0.0, 0.0, 0.0
    for i in range(5):
        if i == 1:
            psi, x, y = _plane(T, geometry, seed, q)
            q[1] = first_angle(x, y, geometry[1], geometry[2], q[2], seed[1])
        elif i == 2:
            q[2] = second_angle(x, y, geometry[1], q[1], seed[2])
        elif i == 3:
            q[3] = psi - q[1] - q[2]
        turn(q, seed, limits, i, i + 1)
        hold(q, i, seed, limits)


@inner
def _is_met(q: Array, T: Array) -> bool:
    """Whether pitch and roll are the wanted ones."""
    psi = q[1] + q[2] + q[3]
    pitch, roll = pitch_and_roll(T, q[0], psi, q[4])
    angle = max(abs(wrapped(pitch - psi)), abs(wrapped(roll - q[4])))
    return angle <= REACHED


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (5,) next to ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`.

    The position is followed; of the rotations that the arm has there, the nearest one. What is
    left, the turn of the tool out of the arm's plane, is residual.

    Source:
        Derived from table 3.4 of the MMA thesis.
    """
    if not is_askable(T, seed):
        return -1
    is_reachable = _choose(T, seed, limits, geometry, q)
    is_free = is_allowed(q, seed, limits)
    if not is_free:
        _settle(T, seed, limits, geometry, q)
    reached = np.empty((4, 4))
    fk(q, geometry, reached)
    pose_residual(reached, T, residual)
    if residual[0] > REACHED or not (is_free or _is_met(q, T)):
        return _LIMITED if is_reachable else _UNREACHABLE
    reach = geometry[1] + geometry[2]
    is_near = abs(math.sin(q[2])) < NEAR or math.hypot(T[0, 3], T[1, 3]) < NEAR * reach
    return _NEAR_SINGULAR if is_near else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the branches (k, 5), front first, elbow up first, of the whole pose; their number.

    A pose whose tool leaves the vertical plane through axis 1 has none.
    """
    reached, residual, seed, count = np.empty((4, 4)), np.empty(2), np.zeros(5), 0
    for branch in range(4):
        q = solutions[count]
        q[0] = wrapped(pointing(T[0, 3], T[1, 3], 0.0) + math.pi * (branch // 2))
        plane = _plane(T, geometry, seed, q)
        elbow, is_reachable = elbow_angle(plane[1], plane[2], geometry[1], geometry[2])
        _bend(plane, geometry, elbow if branch % 2 == 0 else -elbow, 0.0, q)
        for i in range(1, 5):
            q[i] = wrapped(q[i])
        fk(q, geometry, reached)
        if is_reachable and pose_residual(reached, T, residual):
            count += 1
    return count


def make(**geometry: float | str) -> Robot:
    """Five-axis arm; ``d1`` shoulder height, ``a2``, ``a3`` links, ``d5`` tool [m]."""
    row = geometry_of(GEOMETRY, geometry)
    for symbol, value in row.items():
        if not 0.0 <= value <= 10.0 or (value == 0.0 and symbol[0] == "a"):
            raise ParameterError(symbol, value, "at least 0 (a2, a3: above 0) and at most 10 m")
    return Robot(
        name="five_axis",
        joint_names=JOINTS,
        lower=LOWER,
        upper=UPPER,
        home=HOME,
        geometry=row,
        kernels=Kernels(fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all),
        drives=DRIVES,
        task_mask=(True, True, True, False, True, True),
    )
