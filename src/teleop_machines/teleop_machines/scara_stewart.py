"""SCARA + Stewart hybrid: three axes that position the tip, six legs that orient it.

q is theta1, theta2, d3 (up), then six leg lengths. The platform's centre stays ``w_z`` above the Stewart base, so
position and orientation decouple: R = Rx(alpha) Ry(beta) Rz(gamma), tip = s + (0, 0, w_z) + e_eff R z, where s is the
tip of the SCARA. ``heading="fixed"`` is the published model, in which the Stewart base does not rotate. With
``"carried"`` the Stewart base is fixed to link 2. Then the SCARA is solved first, and the legs compensate the rotation
theta1 + theta2.

The published leg layout is architecturally singular: the legs alone do not hold the platform. For a level platform, the
leg lengths do not show whether it is rotated left or right about the vertical (``ik`` then returns NEAR_SINGULAR).
``fk`` uses the published assumption that the centre is fixed. With ``sigma_b`` and ``sigma_m``, such as 15° each, the
joints are arranged in pairs, and the legs alone determine the pose that ``fk`` returns.

Source:
    Kucuk and Gungor 2016, eqs. 1-25, corrected. The heading "carried" and direct kinematics are derived from these
    equations.
"""

import math

import numpy as np

from teleop_core import kinematics
from teleop_core.base import ParameterError, UnknownNameError
from teleop_core.kernels import Array, inner, kernel
from teleop_core.kinematics import branches
from teleop_core.robots.robot import Robot, geometry_of
from teleop_machines import scara_stewart_drives, scara_stewart_legs, stewart_legs, stewart_search
from teleop_machines.bodies.hybrid_bodies import scara_stewart_bodies

JOINTS = ("theta1", "theta2", "d3", "leg1", "leg2", "leg3", "leg4", "leg5", "leg6")
# r_b to sigma_m are passed to the leg kernels in this order.
GEOMETRY = {
    "l1": 0.5, "l2": 0.5, "h1": 0.0, "e_eff": 0.1,
    "r_b": 0.2, "r_m": 0.1, "w_z": 0.2, "sigma_b": 0.0, "sigma_m": 0.0,
}  # fmt: skip
HEADINGS = ("fixed", "carried")
_L1, _L2, _H1, _E, _LEGS, _W, _CARRIED = 0, 1, 2, 3, 4, 6, 9
# Limits, strokes and home are assumed, because they are not published.
_TURN = math.radians(175.0)
_STROKES = 0.45, 1.6  # smallest and largest leg length, divided by that of a level platform
HOME_JOINTS = -math.pi / 4.0, math.pi / 2.0, 0.25
# Result of :func:`teleop_core.robots.freedom.start_posture` for the published lengths, rounded.
START = np.array([-0.0032, 2.145, 0.2651, 0.2327, 0.3012, 0.1801, 0.1219, 0.1221, 0.1767])
HOME_TILT = math.radians(30.0)  # alpha of the published example; a level platform would hide the rotation
_NEAR = 0.02  # sine of the elbow below which small moves need large joint moves
_SWING = 1.25 * math.pi  # largest rotation of a joint that moves in the other direction in a path [rad]
# Sine of the elbow that replaces 0 for a straight arm. It shortens the arm by less than rounding, and has a sign.
_STRAIGHT = 1e-8
_NOT_CLOSED = int(kinematics.FkStatus.NOT_CLOSED)
_FOLLOWED, _LIMITED = int(kinematics.IkStatus.FOLLOWED), int(kinematics.IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = (int(kinematics.IkStatus.NEAR_SINGULAR), int(kinematics.IkStatus.UNREACHABLE))


@kernel
def _place(q: Array, g: Array, platform: Array, T: Array) -> None:
    """Write the tip (4, 4) of the arm with its platform at a pose (4, 4) in the Stewart base.

    ``T`` may be the array ``platform`` itself.
    """
    heading = g[_CARRIED] * (q[0] + q[1])
    c, s = math.cos(heading), math.sin(heading)
    for j in range(4):
        x, y, z = platform[0, j], platform[1, j], platform[2, j]
        T[0, j], T[1, j], T[2, j] = c * x - s * y, s * x + c * y, z
        T[3, j] = platform[3, j]
    T[0, 3] += g[_L1] * math.cos(q[0]) + g[_L2] * math.cos(q[0] + q[1]) + g[_E] * T[0, 2]
    T[1, 3] += g[_L1] * math.sin(q[0]) + g[_L2] * math.sin(q[0] + q[1]) + g[_E] * T[1, 2]
    T[2, 3] += g[_H1] + q[2] + g[_E] * T[2, 2]


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip``, (4, 4), of joints (9,).

    Source:
        Kucuk and Gungor 2016, eqs. 1-13, corrected.
    """
    scara_stewart_legs.platform_pose(q[3:], geometry[_LEGS:_CARRIED], T)
    _place(q, geometry, T, T)


@kernel
def assemble(q: Array, geometry: Array, ask: Array, T: Array, out: Array) -> int:
    """Write ``T_base_tip``, (4, 4), of joints (9,); see :class:`kinematics.Kernels`.

    For similar hexagons, the rotation about the fixed centre is computed; the six leg lengths may deviate from this
    pose by :data:`AGREED`. For other layouts, all six degrees of freedom are computed, from the seed if there is one.
    """
    g, platform = geometry[_LEGS:_CARRIED], np.empty((4, 4))
    if ask[1] > 0.0:
        _platform_of(q, geometry, T, platform)
    status = scara_stewart_legs.close_platform(q[3:], g, ask, platform, out)
    _place(q, geometry, platform, T)
    return status


@kernel
def assemblies(q: Array, geometry: Array, found: Array) -> int:
    """Write all ``T_base_tip`` of joints (9,); see :class:`kinematics.Kernels`.

    With similar hexagons, whose centre is fixed, there is at most one pose.
    """
    g, joints, out = geometry[_LEGS:_CARRIED], np.empty((2, 6, 3)), np.empty(2)
    if scara_stewart_legs.is_similar(g[3], g[4]):
        return 1 if assemble(q, geometry, np.zeros(2), found[0], out) < _NOT_CLOSED else 0
    scara_stewart_legs.layout(g, joints)
    count = stewart_search.closing_poses(q[3:], joints[0], joints[1], g[1], kinematics.SEARCH_ALL, found)
    for k in range(count):
        _place(q, geometry, found[k].copy(), found[k])
    return count


@inner
def _platform_of(q: Array, g: Array, T: Array, platform: Array) -> None:
    """Write the platform's pose (4, 4) in the Stewart base for a tip pose (4, 4): the inverse of `_place`."""
    heading = g[_CARRIED] * (q[0] + q[1])
    c, s = math.cos(heading), math.sin(heading)
    dx = T[0, 3] - g[_L1] * math.cos(q[0]) - g[_L2] * math.cos(q[0] + q[1]) - g[_E] * T[0, 2]
    dy = T[1, 3] - g[_L1] * math.sin(q[0]) - g[_L2] * math.sin(q[0] + q[1]) - g[_E] * T[1, 2]
    platform[2, 3] = T[2, 3] - g[_H1] - q[2] - g[_E] * T[2, 2]
    platform[0, 3], platform[1, 3] = c * dx + s * dy, c * dy - s * dx
    for j in range(3):
        x, y = T[0, j], T[1, j]
        platform[0, j], platform[1, j], platform[2, j] = c * x + s * y, c * y - s * x, T[2, j]
        platform[3, j] = 0.0
    platform[3, 3] = 1.0


@inner
def _twists(platform: Array, g: Array, twists: Array) -> None:
    """Write the platform's twist (6, 6) in the Stewart base per leg speed.

    For similar hexagons the twist is the least-squares rotation about the fixed centre. It does not contain rotations
    that leave all leg lengths unchanged.
    """
    J = np.empty((6, 6))
    scara_stewart_legs.leg_slopes(platform, g, J)
    if not scara_stewart_legs.is_similar(g[3], g[4]):
        stewart_legs.invert(J, twists)
        return
    gram, inverse = np.empty((3, 3)), np.empty((3, 3))
    for r in range(3):
        for s in range(3):
            gram[r, s] = 1e-12 * g[1] * g[1] if r == s else 0.0
            for i in range(6):
                gram[r, s] += J[i, 3 + r] * J[i, 3 + s]
    stewart_legs.invert(gram, inverse)
    twists[:] = 0.0
    for r in range(3):
        for i in range(6):
            for s in range(3):
                twists[3 + r, i] += inverse[r, s] * J[i, 3 + s]


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the geometric Jacobian (6, 9): rows linear, then angular, in base axes."""
    platform, T, twists = np.empty((4, 4)), np.empty((4, 4)), np.empty((6, 6))
    g = geometry[_LEGS:_CARRIED]
    scara_stewart_legs.platform_pose(q[3:], g, platform)
    _place(q, geometry, platform, T)
    _twists(platform, g, twists)
    carried = geometry[_CARRIED]
    # Lever arms of joints 1 and 2: to the tip if the platform rotates with link 2, else to the SCARA tip.
    x2, y2 = geometry[_L2] * math.cos(q[0] + q[1]), geometry[_L2] * math.sin(q[0] + q[1])
    x1, y1 = x2 + geometry[_L1] * math.cos(q[0]), y2 + geometry[_L1] * math.sin(q[0])
    dx, dy = carried * (T[0, 3] - x1), carried * (T[1, 3] - y1)
    J[:] = 0.0
    J[0, 0], J[1, 0], J[5, 0] = -y1 - dy, x1 + dx, carried
    J[0, 1], J[1, 1], J[5, 1] = -y2 - dy, x2 + dx, carried
    J[2, 2] = 1.0
    heading = carried * (q[0] + q[1])
    c, s = math.cos(heading), math.sin(heading)
    for i in range(6):
        for r in range(0, 6, 3):
            x, y = twists[r, i], twists[r + 1, i]
            J[r, 3 + i], J[r + 1, 3 + i] = c * x - s * y, s * x + c * y
            J[r + 2, 3 + i] = twists[r + 2, i]
        wx, wy, wz = J[3, 3 + i], J[4, 3 + i], J[5, 3 + i]
        ex, ey, ez = geometry[_E] * T[0, 2], geometry[_E] * T[1, 2], geometry[_E] * T[2, 2]
        J[0, 3 + i] += wy * ez - wz * ey
        J[1, 3 + i] += wz * ex - wx * ez
        J[2, 3 + i] += wx * ey - wy * ex


@inner
def _arm(T: Array, g: Array, is_left: bool, seed: float, arm: Array) -> bool:
    """Write theta1 (modulo a full turn), theta2, d3 (3,) of one elbow; return whether the SCARA reaches the point.

    theta1 = atan2(y, x) - atan2(l2 sin(theta2), l1 + l2 cos(theta2)) needs no choice of sign. If the point is on the
    axis of joint 1, a folded arm reaches it with every theta1, and the seed's theta1 is kept. A straight arm keeps an
    elbow of :data:`_STRAIGHT`, so that a path through this posture keeps its side.

    Source:
        Kucuk and Gungor 2016, eqs. 14-16; eq. 15 without its sign.
    """
    l1, l2 = g[_L1], g[_L2]
    x, y = T[0, 3] - g[_E] * T[0, 2], T[1, 3] - g[_E] * T[1, 2]
    k = (x * x + y * y - l1 * l1 - l2 * l2) / (2.0 * l1 * l2)
    sine, cosine = max(math.sqrt(max(1.0 - k * k, 0.0)), _STRAIGHT), min(max(k, -1.0), 1.0)
    if not is_left:
        sine = -sine
    arm[0], arm[1] = seed, math.atan2(sine, cosine)
    if math.hypot(x, y) > 1e-12:
        arm[0] = math.atan2(y, x) - math.atan2(l2 * sine, l1 + l2 * cosine)
    arm[2] = T[2, 3] - g[_E] * T[2, 2] - g[_W] - g[_H1]
    return abs(k) <= 1.0 + 1e-12


@inner
def _cost(T: Array, seed: Array, limits: Array, g: Array, q: Array) -> float:
    """Largest joint move of an elbow branch from the seed; legs count only if their move depends on the elbow."""
    q[0] = branches.turned(q[0], seed[0], limits[0, 0], limits[1, 0], False)
    if g[_CARRIED] == 0.0:
        return branches.move_cost(q, seed, limits, 0, 3)
    platform = np.empty((4, 4))
    scara_stewart_legs.wanted_platform(T, q[0] + q[1], g[_W], platform)
    scara_stewart_legs.leg_lengths(platform, g[_LEGS:_CARRIED], q[3:])
    return branches.move_cost(q, seed, limits, 0, 9)


@inner
def _choose(T: Array, seed: Array, limits: Array, g: Array, q: Array) -> bool:
    """Write theta1, theta2, d3 of the chosen elbow; return whether the SCARA reaches the point.

    A path keeps the seed's elbow; otherwise the nearer elbow inside the limits is chosen. The two elbows always differ
    in the sign of theta2.
    """
    sine = math.sin(seed[1])
    is_reachable = _arm(T, g, sine >= 0.0, seed[0], q)
    if math.isfinite(limits[2, 0]) and abs(sine) > 1e-9:
        return is_reachable
    best = _cost(T, seed, limits, g, q)
    if abs(q[1] + seed[1]) < best:
        trial = np.empty(9)
        _arm(T, g, sine < 0.0, seed[0], trial)
        if _cost(T, seed, limits, g, trial) < best:
            q[0], q[1] = trial[0], trial[1]
    return is_reachable


@inner
def _swung(angle: float, seed: float, lower: float, upper: float, is_path: bool) -> float:
    """Joint 1 or 2 at an angle plus full turns, as near as possible to the seed.

    A path over the axis of joint 1 needs half a turn in either direction; the direction without an end stop is chosen.
    At its end stop a joint does not move until the target is at most :data:`_SWING` away.
    """
    near = branches.turned(angle, seed, lower, upper, is_path)
    if is_path and not lower <= near <= upper:
        other = near - math.copysign(2.0 * math.pi, near)
        if lower <= other <= upper and abs(other - seed) <= _SWING:
            return float(other)
    return float(near)


@inner
def _held_arm(T: Array, seed: Array, limits: Array, g: Array, q: Array) -> bool:
    """Write theta1, theta2, d3 of q within limits and step; return whether the SCARA reaches the point.

    If limits or the step stop joint 1, joint 2 points the second link at the wanted point.
    """
    is_reachable = _choose(T, seed, limits, g, q)
    is_path = math.isfinite(limits[2, 0])
    wanted = _swung(q[0], seed[0], limits[0, 0], limits[1, 0], is_path)
    q[0] = branches.bounded(wanted, seed[0], limits[0, 0], limits[1, 0], limits[2, 0])
    if abs(q[0] - wanted) > 1e-12:
        x = T[0, 3] - g[_E] * T[0, 2] - g[_L1] * math.cos(q[0])
        y = T[1, 3] - g[_E] * T[1, 2] - g[_L1] * math.sin(q[0])
        if math.hypot(x, y) > 1e-9:
            turn = math.atan2(y, x) - q[0]
            q[1] = _swung(turn, seed[1], limits[0, 1], limits[1, 1], is_path)
    for i in range(1, 3):
        branches.hold(q, i, seed, limits)
    return is_reachable


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (9,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`.

    The legs orient the tool as wanted; they are computed for the arm's position within limits and step. If a leg cannot
    move that fast, all legs are slowed by one factor.

    Source:
        Kucuk and Gungor 2016, eqs. 14-25, corrected. The heading "carried" is derived from these equations.
    """
    if not kinematics.is_askable(T, seed):
        return -1
    g = geometry[_LEGS:_CARRIED]
    is_reachable = _held_arm(T, seed, limits, geometry, q)
    platform, reached = np.empty((4, 4)), np.empty((4, 4))
    scara_stewart_legs.wanted_platform(T, geometry[_CARRIED] * (q[0] + q[1]), g[2], platform)
    turning = scara_stewart_legs.leg_lengths(platform, g, q[3:])
    is_held = not branches.is_allowed(q, seed, limits)
    if is_held and not branches.slowed(q[3:], seed[3:], limits[:, 3:], q[3:]):
        scara_stewart_legs.platform_pose(q[3:], g, platform)
    _place(q, geometry, platform, reached)
    if not kinematics.pose_residual(reached, T, residual):
        return _LIMITED if is_reachable else _UNREACHABLE
    is_near = abs(math.sin(q[1])) < _NEAR or scara_stewart_legs.is_blind(platform, turning, g)
    return _NEAR_SINGULAR if is_near else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the joints of the two elbows (2, 9), the positive elbow first; return the number of solutions, 0 to 2."""
    platform, g = np.empty((4, 4)), geometry[_LEGS:_CARRIED]
    for elbow in range(2):
        q = solutions[elbow]
        if not _arm(T, geometry, elbow == 0, 0.0, q):
            return 0
        q[0] = branches.turned(q[0], 0.0, -math.pi, math.pi, False)
        scara_stewart_legs.wanted_platform(T, geometry[_CARRIED] * (q[0] + q[1]), g[2], platform)
        scara_stewart_legs.leg_lengths(platform, g, q[3:])
    return 2 if T[2, 2] > 0.0 and math.hypot(T[2, 0], T[2, 1]) <= scara_stewart_legs.TILT else 0


def make(*, heading: str = "fixed", **geometry: float | str) -> Robot:
    """Hybrid with published lengths; ``heading`` "fixed" (published) or "carried" by link 2.

    ``l1``, ``l2`` SCARA links, ``h1`` height of joint 1, ``e_eff`` tool, ``r_b``, ``r_m`` radii,
    ``w_z`` height of the platform [m]; ``sigma_b``, ``sigma_m`` shifts of the leg joints [rad].
    """
    if heading not in HEADINGS:
        raise UnknownNameError("heading", heading, HEADINGS)
    row = geometry_of(GEOMETRY, geometry)
    _check(row)
    is_published = row == GEOMETRY and heading == "fixed"
    row["carried"] = float(heading == "carried")
    g = np.array(list(row.values()))[_LEGS:_CARRIED]
    platform, legs = np.eye(4), np.empty(6)
    platform[2, 3] = row["w_z"]
    scara_stewart_legs.leg_lengths(platform, g, legs)
    lower = np.concatenate(([-_TURN, -_TURN, 0.0], _STROKES[0] * legs))
    upper = np.concatenate(([_TURN, _TURN, 0.5], _STROKES[1] * legs))
    scara_stewart_legs.turned_and_tilted(0.0, 0.0, math.sin(HOME_TILT), platform)
    scara_stewart_legs.leg_lengths(platform, g, legs)
    return Robot(
        name="scara_stewart",
        joint_names=JOINTS,
        lower=lower,
        upper=upper,
        home=np.concatenate((HOME_JOINTS, legs)),
        start=START if is_published else None,
        geometry=row,
        kernels=kinematics.Kernels(
            fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all, assemble=assemble, assemblies=assemblies
        ),
        drives=scara_stewart_drives.DRIVES,
        describe=scara_stewart_bodies,
    )


def _check(row: dict[str, float]) -> None:
    for symbol in ("l1", "l2", "r_b", "r_m", "w_z"):
        if row[symbol] <= 0.0:
            raise ParameterError(symbol, row[symbol], "a length > 0 m")
    for symbol in ("sigma_b", "sigma_m"):
        # Up to this angle the sums of the leg kernels can be divided; at 0.52 rad the joints of two legs meet.
        if abs(row[symbol]) > 0.45:
            raise ParameterError(symbol, row[symbol], "between -0.45 and 0.45 rad")
