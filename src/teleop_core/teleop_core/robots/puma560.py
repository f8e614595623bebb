"""PUMA 560: the 6R arm with shoulder offset and spherical wrist, eight branches.

Modified (Craig) Denavit-Hartenberg table: alpha = 0, -90, 0, -90, 90, -90 degrees, a = 0, 0, a2,
a3, 0, 0, d = 0, 0, d3, d4, 0, 0; the tip is the wrist centre. In the vertical plane of joint 1,
which lies d3 beside axis 1, u is the horizontal and z the vertical coordinate of the wrist.

Source:
    Ghosal 2020, lecture 6, PUMA 560, misprints corrected. Lengths: Corke and Armstrong-Hélouvry
    1994; joint ranges: Wang and Chen 1991; both as roboticstoolbox quotes them, brought to this
    table's zeros.
"""

import math

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array
from teleop_core.robots.branches import BESIDE, bounded, cost_of, is_allowed, turn, turned, wrapped
from teleop_core.robots.drives import ENTRIES, Drives
from teleop_core.robots.kinematics import IkStatus, Kernels, is_askable, pose_residual
from teleop_core.robots.robot import Robot, geometry_of

JOINTS = tuple(f"theta{i}" for i in range(1, 7))
GEOMETRY = {"a2": 0.4318, "a3": 0.0203, "d3": 0.15005, "d4": 0.4318}
_DEGREES = math.pi / 180.0
LOWER = np.array([-160.0, -225.0, -225.0, -110.0, -100.0, -266.0]) * _DEGREES
UPPER = np.array([160.0, 45.0, 45.0, 170.0, 100.0, 266.0]) * _DEGREES
# Upper arm 45 degrees up, forearm level, tool 45 degrees down.
HOME = np.array([0.0, -45.0, -45.0, 0.0, 45.0, 0.0]) * _DEGREES
# Answer of :func:`teleop_core.robots.room.start_posture` for the published lengths, rounded.
START = np.array([-0.4783, -1.6627, -0.035, 0.3949, 1.0084, -0.57])

DRIVES = Drives(  # assumed, of the size of this arm's drives; quoted from memory, not checked
    inertia=np.array([2.6, 6.8, 1.16, 0.20, 0.18, 0.19]),
    viscous=np.array([4.9, 8.2, 3.5, 0.4, 0.4, 0.3]),
    coulomb=np.array([6.3, 5.5, 2.6, 1.3, 1.0, 1.2]),
    friction_speed=np.full(6, 0.01),
    effort_limit=np.array([97.6, 186.4, 89.4, 24.2, 20.1, 21.3]),
    speed_limit=np.array([82.0, 74.0, 122.0, 228.0, 241.0, 228.0]) * _DEGREES,
    encoder_step=np.array([1.0, 0.7, 1.2, 0.9, 0.9, 0.9]) * 1e-4,
    bandwidth=np.full(6, 60.0),
    assumed=ENTRIES,
)

# Below this sine axes 4 and 6 count as one line and joint 4 keeps its value; below this distance
# [m] a point counts as lying on the axis that turns it, and that joint keeps its value.
_COLLINEAR = 1e-10
_ON_AXIS = 1e-12
# Sines and relative distances under which small moves need large joint moves.
_NEAR = 0.02
_COST = 6  # column after the six joints of a branch
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip``, (4, 4), of joints (6,).

    Source:
        Ghosal 2020, lecture 6, 0_3T and 3_6T, corrected.
    """
    a2, a3, d3, d4 = geometry[0], geometry[1], geometry[2], geometry[3]
    c1, s1 = math.cos(q[0]), math.sin(q[0])
    c23, s23 = math.cos(q[1] + q[2]), math.sin(q[1] + q[2])
    c4, s4 = math.cos(q[3]), math.sin(q[3])
    c5, s5 = math.cos(q[4]), math.sin(q[4])
    c6, s6 = math.cos(q[5]), math.sin(q[5])
    # Columns of 3_6T, turned into the base one by one.
    u, v, w = c6, s6, 0.0
    for column in range(3):
        f, y = c5 * u - s5 * w, s5 * u + c5 * w
        x, z = c4 * f - s4 * v, -s4 * f - c4 * v
        h = c23 * x - s23 * y
        T[0, column] = c1 * h - s1 * z
        T[1, column] = s1 * h + c1 * z
        T[2, column] = -s23 * x - c23 * y
        u, v, w = (-s6, c6, 0.0) if column == 0 else (0.0, 0.0, 1.0)
    u = a2 * math.cos(q[1]) + a3 * c23 - d4 * s23
    T[0, 3] = c1 * u - s1 * d3
    T[1, 3] = s1 * u + c1 * d3
    T[2, 3] = -a2 * math.sin(q[1]) - a3 * s23 - d4 * c23
    T[3, 0] = T[3, 1] = T[3, 2] = 0.0
    T[3, 3] = 1.0


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the geometric Jacobian (6, 6): rows linear, then angular, in base axes.

    The wrist axes meet in the tip, so joints 4 to 6 do not move it.
    """
    T = np.empty((4, 4))
    fk(q, geometry, T)
    c1, s1 = math.cos(q[0]), math.sin(q[0])
    c23, s23 = math.cos(q[1] + q[2]), math.sin(q[1] + q[2])
    c4, s4 = math.cos(q[3]), math.sin(q[3])
    u = c1 * T[0, 3] + s1 * T[1, 3]
    elbow_u, elbow_z = geometry[0] * math.cos(q[1]), -geometry[0] * math.sin(q[1])
    J[:] = 0.0
    J[0, 0], J[1, 0], J[5, 0] = -T[1, 3], T[0, 3], 1.0
    for j in range(1, 3):
        across = T[2, 3] - (elbow_z if j == 2 else 0.0)
        along = u - (elbow_u if j == 2 else 0.0)
        J[0, j], J[1, j], J[2, j] = c1 * across, s1 * across, -along
        J[3, j], J[4, j] = -s1, c1
    J[3, 3], J[4, 3], J[5, 3] = -c1 * s23, -s1 * s23, -c23
    J[3, 4], J[4, 4], J[5, 4] = c1 * c23 * s4 - s1 * c4, s1 * c23 * s4 + c1 * c4, -s23 * s4
    J[3, 5], J[4, 5], J[5, 5] = T[0, 2], T[1, 2], T[2, 2]


@inner
def _bend(u: float, z: float, geometry: Array) -> tuple[float, bool]:
    """Bend of the elbow that puts the wrist at its distance from axis 2, and whether one does.

    Joint 3 is atan2(a3, d4) less the bend, or less its supplement. Beyond reach the arm is
    stretched or folded.
    """
    a2, a3, d4 = geometry[0], geometry[1], geometry[3]
    K = (u * u + z * z - a2 * a2 - a3 * a3 - d4 * d4) / (2.0 * a2)
    square = a3 * a3 + d4 * d4 - K * K
    return math.atan2(K, math.sqrt(max(square, 0.0))), square >= -_ON_AXIS


@inner
def _upper_arm(u: float, z: float, q3: float, geometry: Array, seed: float) -> float:
    """Joint 2 that points the arm, bent by joint 3, at the wrist; the seed if that is on axis 2."""
    a2, a3, d4 = geometry[0], geometry[1], geometry[3]
    if u * u + z * z <= _ON_AXIS * _ON_AXIS:
        return seed
    x, y = a3 + a2 * math.cos(q3), d4 - a2 * math.sin(q3)
    return math.atan2(-x * z - u * y, x * u - y * z) - q3


@inner
def _arms(T: Array, geometry: Array, seed: Array, arms: Array) -> bool:
    """Write joints 1 to 3 of the branches into four rows: front up, front down, back up, back down.

    With the wrist on an axis the joint of that axis keeps the seed's value.

    Returns:
        Whether they reach the wrist centre; else they are the nearest.
    """
    x, y, z, d3 = T[0, 3], T[1, 3], T[2, 3], geometry[2]
    square = x * x + y * y - d3 * d3
    u = math.sqrt(max(square, 0.0))
    bend, is_near = _bend(u, z, geometry)
    aside, lead = math.atan2(d3, u), math.atan2(geometry[1], geometry[3])
    azimuth = math.atan2(y, x)
    if x * x + y * y <= _ON_AXIS * _ON_AXIS:
        azimuth = seed[0] + aside
    for branch in range(4):
        is_back, is_down = branch > 1, branch % 2 == 1
        arms[branch, 0] = azimuth - (math.pi - aside if is_back else aside)
        arms[branch, 2] = lead - (math.pi - bend if is_down else bend)
        arms[branch, 1] = _upper_arm(-u if is_back else u, z, arms[branch, 2], geometry, seed[1])
    return square >= -_ON_AXIS and is_near


@inner
def _wrist_rotation(T: Array, q1: float, q23: float, M: Array) -> None:
    """Write R03ᵀ R, the rotation that is left to the wrist, into the 3x3 corner of M."""
    c1, s1, c23, s23 = math.cos(q1), math.sin(q1), math.cos(q23), math.sin(q23)
    for j in range(3):
        h = c1 * T[0, j] + s1 * T[1, j]
        M[0, j] = c23 * h - s23 * T[2, j]
        M[1, j] = -s23 * h - c23 * T[2, j]
        M[2, j] = -s1 * T[0, j] + c1 * T[1, j]


@inner
def _joint5(M: Array, c4: float, s4: float) -> float:
    """Joint 5 that brings the tool axis next to its wanted direction, given joint 4."""
    return math.atan2(s4 * M[2, 2] - c4 * M[0, 2], M[1, 2])


@inner
def _joint6(M: Array, c4: float, s4: float, c5: float, s5: float) -> float:
    """Joint 6 that turns the tool next to its wanted attitude, given joints 4 and 5."""
    h0, h1 = c4 * M[0, 0] - s4 * M[2, 0], c4 * M[0, 1] - s4 * M[2, 1]
    x0, x1 = c5 * h0 + s5 * M[1, 0], c5 * h1 + s5 * M[1, 1]
    y0, y1 = -s4 * M[0, 0] - c4 * M[2, 0], -s4 * M[0, 1] - c4 * M[2, 1]
    return math.atan2(y0 - x1, x0 + y1)


@inner
def _wrist(M: Array, seed: float, q: Array) -> None:
    """Write joints 4 to 6 of the branch with sin(q5) >= 0; joint 4 is the seed if it is zero."""
    s5 = math.sqrt(M[0, 2] * M[0, 2] + M[2, 2] * M[2, 2])
    if s5 > _COLLINEAR:
        q[3], c4, s4 = math.atan2(M[2, 2], -M[0, 2]), -M[0, 2] / s5, M[2, 2] / s5
    else:
        q[3], c4, s4 = seed, math.cos(seed), math.sin(seed)
    q[4] = math.atan2(s4 * M[2, 2] - c4 * M[0, 2], M[1, 2])
    q[5] = _joint6(M, c4, s4, M[1, 2], s5)


@inner
def _choose(T: Array, seed: Array, limits: Array, geometry: Array, work: Array, q: Array) -> bool:
    """Write the best of the eight branches; whether the wrist centre can be reached at all.

    The arm with the smallest move comes first, and no wrist is solved for one that cannot win;
    in a path the wrist has no say in the arm's branch.
    """
    M, is_path = work[4:], math.isfinite(limits[2, 0])
    is_reachable, best = _arms(T, geometry, seed, work), math.inf
    for branch in range(4):
        turn(work[branch], seed, limits, 0, 3)
        work[branch, _COST] = cost_of(work[branch], seed, limits, 0, 3, not is_path)
    for _ in range(1 if is_path else 4):
        arm = 0
        for branch in range(1, 4):
            if work[branch, _COST] < work[arm, _COST]:
                arm = branch
        trial = work[arm]
        arm_cost = trial[_COST]
        if arm_cost >= best:
            break
        _wrist_rotation(T, trial[0], trial[1] + trial[2], M)
        _wrist(M, seed[3], trial)
        for _ in range(2):
            turn(trial, seed, limits, 3, 6)
            does_count = not is_path or abs(trial[4]) < BESIDE
            cost = max(arm_cost, cost_of(trial, seed, limits, 3, 6, does_count))
            if cost < best:
                best = cost
                for i in range(6):
                    q[i] = trial[i]
            trial[3], trial[4], trial[5] = trial[3] + math.pi, -trial[4], trial[5] + math.pi
        trial[_COST] = math.inf
    return is_reachable


@inner
def _held(angle: float, i: int, seed: Array, limits: Array) -> float:
    """Angle of joint i next to its seed, within its step and inside its limits."""
    low, high, step = limits[0, i], limits[1, i], limits[2, i]
    return bounded(turned(angle, seed[i], low, high, math.isfinite(step)), seed[i], low, high, step)


@inner
def _settle(T: Array, seed: Array, limits: Array, geometry: Array, M: Array, q: Array) -> None:
    """Keep a branch inside limits and steps; each joint makes the best of those before it."""
    lead = math.atan2(geometry[1], geometry[3])
    is_down = math.cos(lead - q[2]) < 0.0
    q[0] = _held(q[0], 0, seed, limits)
    u, z = math.cos(q[0]) * T[0, 3] + math.sin(q[0]) * T[1, 3], T[2, 3]
    bend = _bend(u, z, geometry)[0]
    q[2] = _held(lead - (math.pi - bend if is_down else bend), 2, seed, limits)
    q[1] = _held(_upper_arm(u, z, q[2], geometry, seed[1]), 1, seed, limits)
    _wrist_rotation(T, q[0], q[1] + q[2], M)
    q[3] = _held(q[3], 3, seed, limits)
    c4, s4 = math.cos(q[3]), math.sin(q[3])
    q[4] = _held(_joint5(M, c4, s4), 4, seed, limits)
    q[5] = _held(_joint6(M, c4, s4, math.cos(q[4]), math.sin(q[4])), 5, seed, limits)


@inner
def _is_near_singular(q: Array, T: Array, geometry: Array) -> bool:
    """Whether the wrist is straight, the arm stretched or folded, or the wrist over axis 1."""
    a2, a3, d4 = geometry[0], geometry[1], geometry[3]
    forearm = math.sqrt(a3 * a3 + d4 * d4)
    u = math.cos(q[0]) * T[0, 3] + math.sin(q[0]) * T[1, 3]
    bend = d4 * math.cos(q[2]) + a3 * math.sin(q[2])
    is_wrist = abs(math.sin(q[4])) < _NEAR
    return is_wrist or abs(bend) < _NEAR * forearm or abs(u) < _NEAR * (a2 + forearm)


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (6,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`.

    Singular where the wrist centre stands over axis 1 (u = 0), where the arm is stretched or
    folded, and where axes 4 and 6 are in line. A joint that a limit or step holds back lags;
    the joints after it do the best that is left, and motion goes on at the other side.

    Source:
        Craig 2005, section 4.7, for this table; the solution in atan2 form is derived.
    """
    if not is_askable(T, seed):
        return -1
    # Memory for four arms with their costs, then the rotation left to the wrist, at last the tip.
    work = np.empty((8, 7))
    reached = work[4:]
    is_reachable = _choose(T, seed, limits, geometry, work, q)
    if not is_allowed(q, seed, limits):
        _settle(T, seed, limits, geometry, reached, q)
    fk(q, geometry, reached)
    if not pose_residual(reached, T, residual):
        return _LIMITED if is_reachable else _UNREACHABLE
    return _NEAR_SINGULAR if _is_near_singular(q, T, geometry) else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the eight branches (8, 6) in the order of arms, sin(q5) >= 0 first; their number.

    On a singularity, where a joint is free, it is zero and branches may coincide.
    """
    M, arms = np.empty((3, 3)), np.empty((4, 6))
    if not _arms(T, geometry, np.zeros(6), arms):
        return 0
    for branch in range(8):
        q = solutions[branch]
        for i in range(3):
            q[i] = arms[branch // 2, i]
        _wrist_rotation(T, q[0], q[1] + q[2], M)
        _wrist(M, 0.0, q)
        if branch % 2 == 1:
            q[3], q[4], q[5] = q[3] + math.pi, -q[4], q[5] + math.pi
        for i in range(6):
            q[i] = wrapped(q[i])
    return 8


def make(**geometry: float | str) -> Robot:
    """PUMA 560; ``a2`` upper arm, ``d4`` forearm, ``d3`` and ``a3`` their offsets [m]."""
    row = geometry_of(GEOMETRY, geometry)
    for symbol, value in row.items():
        if abs(value) > 10.0:
            raise ParameterError(symbol, value, "between -10 and 10 m")
    if row["a2"] <= 0.0:
        raise ParameterError("a2", row["a2"], "> 0 m")
    if math.hypot(row["a3"], row["d4"]) <= 0.0:
        raise ParameterError("d4", row["d4"], "other than 0 m when a3 is 0")
    return Robot(
        name="puma560",
        joint_names=JOINTS,
        lower=LOWER,
        upper=UPPER,
        home=HOME,
        start=START if row == GEOMETRY else None,
        geometry=row,
        kernels=Kernels(fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all),
        drives=DRIVES,
    )
