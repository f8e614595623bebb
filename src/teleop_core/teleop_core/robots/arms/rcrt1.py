"""RCRT-1: the R-R-P-R-R-R slave with a spherical wrist, reach 458 mm.

Standard Denavit-Hartenberg table (the source labels its columns as if it were modified): alpha = -90, 90, 0, -90, 90, 0
degrees, d = 0, d2, d3, 0, 0, L6. With R2 = Rz(q1) Ry(q2) and R = R2 Rz(q4) Ry(q5) Rz(q6) the tip is at R2 (0, d2, d3) +
L6 R z.

Source:
    Vongbunyong 2008, sections 3.3, 4.4, 4.5, 6.3 and tables 3.6, 6.2; misprints corrected.
"""

import math
from dataclasses import replace

import numpy as np

from teleop_core.base import ParameterError
from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room
from teleop_core.kinematics import IkStatus, Kernels, is_askable, pose_residual
from teleop_core.kinematics.branches import BESIDE, bounded, cost_of, hold, is_allowed, turn, wrapped
from teleop_core.robots.arms import rcrt1_dynamics, rcrt1_hardware
from teleop_core.robots.robot import Robot, geometry_of

JOINTS = ("theta1", "theta2", "d3", "theta4", "theta5", "theta6")
GEOMETRY = {"L6": 0.037, "d2": 0.0}
_DEGREES = math.pi / 180.0
LOWER = np.array([-80.0, 50.0, 0.0, -170.0, -80.0, -170.0]) * _DEGREES
UPPER = np.array([80.0, 160.0, 0.0, 170.0, 80.0, 170.0]) * _DEGREES
UPPER[2] = 0.421
HOME = np.array([0.0, 113.4 * _DEGREES, 0.421, 0.0, 0.0, 0.0])
# Result of :func:`teleop_core.robots.freedom.start_posture` for the published lengths, rounded.
START = np.array([-0.7622, 1.7058, 0.3445, 1.1233, 0.7795, -1.3396])

# Below this sine the wrist axes 4 and 6 count as one line, and joint 4 keeps its value. Rounding in T (1e-16), divided
# by this sine, then changes joint 4 by less than 1e-6 rad.
_COLLINEAR = 1e-10
# Below this sine of joint 5, or this wrist distance divided by the full reach, small moves of the tool need large moves
# of the joints: more than 50 rad of joint per rad of tool.
_NEAR = 0.02
_REACH = 0.421  # full reach of the wrist [m]
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip``, (4, 4), of joints (6,).

    Source:
        Vongbunyong 2008, eq. 4.4.1, corrected.
    """
    c1, s1 = math.cos(q[0]), math.sin(q[0])
    c2, s2 = math.cos(q[1]), math.sin(q[1])
    c4, s4 = math.cos(q[3]), math.sin(q[3])
    c5, s5 = math.cos(q[4]), math.sin(q[4])
    c6, s6 = math.cos(q[5]), math.sin(q[5])
    # The columns of Rz(q6) are rotated into the base one by one.
    u, v, w = c6, s6, 0.0
    for column in range(3):
        f, z = c5 * u + s5 * w, c5 * w - s5 * u
        x, y = c4 * f - s4 * v, s4 * f + c4 * v
        h = c2 * x + s2 * z
        T[0, column] = c1 * h - s1 * y
        T[1, column] = s1 * h + c1 * y
        T[2, column] = c2 * z - s2 * x
        u, v, w = (-s6, c6, 0.0) if column == 0 else (0.0, 0.0, 1.0)
    L6, d2 = geometry[0], geometry[1]
    T[0, 3] = c1 * s2 * q[2] - s1 * d2 + L6 * T[0, 2]
    T[1, 3] = s1 * s2 * q[2] + c1 * d2 + L6 * T[1, 2]
    T[2, 3] = c2 * q[2] + L6 * T[2, 2]
    T[3, 0] = T[3, 1] = T[3, 2] = 0.0
    T[3, 3] = 1.0


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the geometric Jacobian (6, 6): rows linear, then angular, in base axes.

    Its determinant is d3² sin(q2) sin(q5) for d2 = 0.
    """
    T = room(4, 4)
    fk(q, geometry, T)
    c1, s1 = math.cos(q[0]), math.sin(q[0])
    c2, s2 = math.cos(q[1]), math.sin(q[1])
    c4, s4 = math.cos(q[3]), math.sin(q[3])
    L6 = geometry[0]
    axes = room(6, 3)
    axes[0] = (0.0, 0.0, 1.0)
    axes[1] = (-s1, c1, 0.0)
    axes[2] = (c1 * s2, s1 * s2, c2)
    axes[3] = axes[2]
    axes[4] = (-c1 * c2 * s4 - s1 * c4, -s1 * c2 * s4 + c1 * c4, s2 * s4)
    axes[5] = (T[0, 2], T[1, 2], T[2, 2])
    for j in range(6):
        a = axes[j]
        # Joints 1 and 2 rotate the tip about the origin of the base; the wrist joints rotate it about the wrist centre.
        x, y, z = T[0, 3], T[1, 3], T[2, 3]
        if j > 2:
            x, y, z = L6 * T[0, 2], L6 * T[1, 2], L6 * T[2, 2]
        is_prismatic = j == 2
        J[0, j] = a[0] if is_prismatic else a[1] * z - a[2] * y
        J[1, j] = a[1] if is_prismatic else a[2] * x - a[0] * z
        J[2, j] = a[2] if is_prismatic else a[0] * y - a[1] * x
        for i in range(3):
            J[3 + i, j] = 0.0 if is_prismatic else a[i]


@inner
def _arm_branch(T: Array, geometry: Array, is_front: bool, seed: float, arm: Array) -> bool:
    """Write q1, q2, d3 (3,) of one arm branch; return whether the arm can reach the wrist centre.

    If the wrist centre is on the axis of joint 1, every q1 is a solution, and the q1 of the seed is kept.
    """
    L6, d2 = geometry[0], geometry[1]
    x, y, z = T[0, 3] - L6 * T[0, 2], T[1, 3] - L6 * T[1, 2], T[2, 3] - L6 * T[2, 2]
    square = x * x + y * y - d2 * d2
    is_reachable = square >= 0.0
    radius = math.sqrt(max(square, 0.0))
    if not is_front:
        radius = -radius
    arm[0] = seed
    if abs(radius) > 1e-12 or d2 > 0.0:
        arm[0] = wrapped(math.atan2(y, x) - math.atan2(d2, radius))
    arm[1] = math.atan2(radius, z)
    arm[2] = math.sqrt(radius * radius + z * z)
    return is_reachable


@inner
def _wrist_frame(T: Array, q1: float, q2: float, M: Array) -> None:
    """Write (Rz(q1) Ry(q2))ᵀ R, the rotation that remains for the wrist, into the 3x3 corner of M."""
    c1, s1, c2, s2 = math.cos(q1), math.sin(q1), math.cos(q2), math.sin(q2)
    for j in range(3):
        h = c1 * T[0, j] + s1 * T[1, j]
        M[0, j] = c2 * h - s2 * T[2, j]
        M[1, j] = -s1 * T[0, j] + c1 * T[1, j]
        M[2, j] = s2 * h + c2 * T[2, j]


@inner
def _joint5(M: Array, c4: float, s4: float) -> float:
    """Joint 5 that brings the tool axis nearest to its wanted direction, given joint 4."""
    return math.atan2(c4 * M[0, 2] + s4 * M[1, 2], M[2, 2])


@inner
def _joint6(M: Array, c4: float, s4: float, c5: float, s5: float) -> float:
    """Joint 6 that brings the tool nearest to its wanted attitude, given joints 4 and 5."""
    x0 = c5 * (c4 * M[0, 0] + s4 * M[1, 0]) - s5 * M[2, 0]
    x1 = c5 * (c4 * M[0, 1] + s4 * M[1, 1]) - s5 * M[2, 1]
    y0, y1 = -s4 * M[0, 0] + c4 * M[1, 0], -s4 * M[0, 1] + c4 * M[1, 1]
    return math.atan2(y0 - x1, x0 + y1)


@inner
def _wrist(M: Array, seed: float, q: Array) -> None:
    """Write joints 4 to 6 of the branch with sin(q5) >= 0; if sin(q5) is zero, joint 4 keeps the seed's value."""
    s5 = math.sqrt(M[0, 2] * M[0, 2] + M[1, 2] * M[1, 2])
    if s5 > _COLLINEAR:
        q[3], c4, s4 = math.atan2(M[1, 2], M[0, 2]), M[0, 2] / s5, M[1, 2] / s5
    else:
        q[3], c4, s4 = seed, math.cos(seed), math.sin(seed)
    q[4] = _joint5(M, c4, s4)
    q[5] = _joint6(M, c4, s4, M[2, 2], s5)


@inner
def _share_roll(M: Array, limits: Array, q: Array) -> None:
    """With axes 4 and 6 in line, joint 4 makes the part of the roll that joint 6 cannot make because of its limits."""
    if M[0, 2] * M[0, 2] + M[1, 2] * M[1, 2] > _COLLINEAR * _COLLINEAR:
        return
    low, high = limits[0, 5], limits[1, 5]
    rest = q[5] - min(max(q[5], low), high)
    is_legal = limits[0, 3] <= q[3] + rest <= limits[1, 3]
    if rest != 0.0 and not is_legal and not math.isfinite(limits[2, 3]):
        # Then try from the other end of joint 6; a path never jumps there.
        rest -= math.copysign(2.0 * math.pi - (high - low), rest)
    q[3] += rest
    q[5] = wrapped(q[5] - rest)


@inner
def _flip(q: Array) -> None:
    """Change joints 4 to 6 to the other wrist branch, which reaches the same pose."""
    q[3], q[4], q[5] = wrapped(q[3] + math.pi), -q[4], wrapped(q[5] + math.pi)


@inner
def _choose(T: Array, seed: Array, limits: Array, geometry: Array, M: Array, q: Array) -> bool:
    """Write the best of the four branches; return whether the arm can reach the wrist centre.

    The wrist of the rear arm branch is solved only if that branch can still be the best. A path never changes to the
    rear branch. In a path, the wrist is solved from the position that the arm can reach.
    """
    best, is_reachable, trial = math.inf, True, room(6)
    is_path = math.isfinite(limits[2, 0])
    for arm in range(1 if is_path else 2):
        is_reachable = _arm_branch(T, geometry, arm == 0, seed[0], trial)
        is_reachable = is_reachable and limits[0, 2] - 1e-9 <= trial[2] <= limits[1, 2] + 1e-9
        for i in range(3 if is_path else 0):
            hold(trial, i, seed, limits)
        arm_cost = cost_of(trial, seed, limits, 0, 3, not is_path)
        if arm_cost >= best:
            continue
        _wrist_frame(T, trial[0], trial[1], M)
        _wrist(M, seed[3], trial)
        for _ in range(2):
            turn(trial, seed, limits, 3, 6)
            _share_roll(M, limits, trial)
            does_count = not is_path or abs(trial[4]) < BESIDE
            cost = max(arm_cost, cost_of(trial, seed, limits, 3, 6, does_count))
            if cost < best:
                best = cost
                for i in range(6):
                    q[i] = trial[i]
            _flip(trial)
    return is_reachable


@inner
def _settle(T: Array, seed: Array, limits: Array, M: Array, q: Array) -> None:
    """Clamp a branch to limits and steps; each wrist joint reduces the error that earlier joints leave.

    In a path, joint 4 slows down towards the wrist singularity, because noise of the pose would rotate it at full speed
    there. When the axes of joints 4 and 6 are in line, joint 4 does not move.
    """
    for i in range(3):
        hold(q, i, seed, limits)
    _wrist_frame(T, q[0], q[1], M)
    step = limits[2, 3]
    if math.isfinite(step):
        step *= min(1.0, math.hypot(M[0, 2], M[1, 2]) / _NEAR)
    q[3] = bounded(q[3], seed[3], limits[0, 3], limits[1, 3], step)
    c4, s4 = math.cos(q[3]), math.sin(q[3])
    q[4] = _joint5(M, c4, s4)
    hold(q, 4, seed, limits)
    q[5] = _joint6(M, c4, s4, math.cos(q[4]), math.sin(q[4]))
    turn(q, seed, limits, 5, 6)
    hold(q, 5, seed, limits)


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (6,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`.

    If a limit or the largest step stops a joint, the later joints reduce the resulting error. The wrist rotates the
    tool to the wanted attitude, from the position that the arm has reached. Joint 5, and then joint 6, are computed
    from the angle that joint 4 has reached. At the wrist singularity joint 4 lags, joint 5 passes through zero and
    changes its sign, and the motion continues.

    Source:
        Vongbunyong 2008, eqs. 4.5.1-4.5.9, atan2 throughout, and its rule for q5 = 0.
    """
    if not is_askable(T, seed):
        return -1
    reached = room(4, 4)  # until the end, its rotation part is the rotation that remains for the wrist
    is_reachable = _choose(T, seed, limits, geometry, reached, q)
    is_slowed = abs(q[4]) < _NEAR and math.isfinite(limits[2, 3])
    if is_slowed or not is_allowed(q, seed, limits):
        _settle(T, seed, limits, reached, q)
    fk(q, geometry, reached)
    if not pose_residual(reached, T, residual):
        return _LIMITED if is_reachable else _UNREACHABLE
    is_near = abs(math.sin(q[4])) < _NEAR or q[2] * math.sin(q[1]) < _NEAR * _REACH
    return _NEAR_SINGULAR if is_near else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the four branches (4, 6), front arm first, wrist not flipped first; return their number.

    At a singularity a free joint is set to zero, and branches may be equal.
    """
    M = room(3, 3)
    for arm in range(2):
        for wrist in range(2):
            q = solutions[2 * arm + wrist]
            if not _arm_branch(T, geometry, arm == 0, 0.0, q):
                return 0
            _wrist_frame(T, q[0], q[1], M)
            _wrist(M, 0.0, q)
            if wrist == 1:
                _flip(q)
    return 4


def make(**geometry: float) -> Robot:
    """RCRT-1 with published lengths; ``L6`` tool length, ``d2`` shoulder offset [m]."""
    row = geometry_of(GEOMETRY, geometry)
    for symbol, value in row.items():
        if not 0.0 <= value <= 1.0:
            raise ParameterError(symbol, value, "between 0 and 1 m")
    return Robot(
        name="rcrt1",
        joint_names=JOINTS,
        lower=LOWER,
        upper=UPPER,
        home=HOME,
        start=START if row == GEOMETRY else None,
        geometry=row,
        kernels=Kernels(fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all),
        drives=rcrt1_dynamics.DRIVES,
        dynamics=replace(rcrt1_dynamics.DYNAMICS, frames=rcrt1_dynamics.link_frames(HOME, row["d2"])),
        hardware=rcrt1_hardware.HARDWARE,
    )
