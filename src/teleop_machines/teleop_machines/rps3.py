"""3-RPS: a platform on three legs; each leg has a hinge, an actuated slide and a ball joint.

Hinges R_i are at distance ``b`` from the base centre, ball joints S_i at distance ``a`` from the
platform centre, both at 0, 120 and 240°; theta_i is the leg's angle above the base, measured from
the direction to the centre. The tip is the platform centre, with x towards S1.

The three slides set the height and the direction of the platform's normal. Each leg stays in its plane, so there is no
rotation about the normal (zero torsion), and the centre moves sideways: with R12 = R21, x = a/2 (R11 - R22) and y = -a
R21. Therefore ``task_mask`` is z and two tilts, and ``ik`` leaves the rest as residual.

Direct kinematics has up to 16 assembly modes, in pairs above and below the base. :func:`assembly_modes` and
:meth:`Robot.fk_all` find all modes. ``fk`` uses the mode that is found from legs that lean in towards the platform.
Half of the legal leg triples have this mode, with tilts up to 70 degrees. Of 20 000 tested triples, all others have
modes only on the other side of the singular poses, with tilts of 64 degrees and more. For these triples,
:meth:`Robot.fk` searches the mode nearest to home.

Source:
    Lee and Shah 1988; Ghosal 2020, lectures 6 and 11. Inverse kinematics and modes are derived from these sources.
"""

import math

import numpy as np

from teleop_core import kinematics
from teleop_core.base import ParameterError
from teleop_core.kernels import Array, inner, kernel
from teleop_core.kinematics import branches
from teleop_core.robots.robot import Robot, geometry_of
from teleop_machines.bodies.parallel import rps3_bodies
from teleop_machines.drives import electric_cylinders
from teleop_machines.rps3_loop import COSINES, SINES, constraints, frame, points, settle
from teleop_machines.rps3_modes import Assembly, AssemblyModes, assembly_modes, joint_points, leg_coordinates
from teleop_machines.rps3_search import angles_of, assemble, assemblies, is_near_singular, lean
from teleop_machines.stewart_legs import invert

__all__ = ["GEOMETRY", "Assembly", "AssemblyModes", "assembly_modes", "joint_points", "leg_coordinates", "make"]

# No lengths are published: hinges, ball joints, legs at home [m].
GEOMETRY = {"b": 1.0, "a": 0.5, "l_home": 1.2}
_FOLLOWED, _LIMITED = int(kinematics.IkStatus.FOLLOWED), int(kinematics.IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = (int(kinematics.IkStatus.NEAR_SINGULAR), int(kinematics.IkStatus.UNREACHABLE))


@inner
def _close(q: Array, geometry: Array, theta: Array) -> None:
    """Write leg angles (3,) of the assembly that is found from legs that lean in by b - a."""
    lean(q, geometry, theta)
    settle(q, geometry[0], geometry[1], theta)


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip`` (4, 4) of leg lengths (3,) [m], found from equally leaning legs.

    The loop closes for half of the legal leg triples, and for all triples within 30 % of the strokes around home. The
    other triples have only distant modes. For these, the result is the frame of the ball joints at the smallest error;
    :func:`assemble` reports this.
    """
    theta, S = np.empty(3), np.empty((3, 3))
    _close(q, geometry, theta)
    points(q, theta, geometry[0], S)
    frame(S, T)


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the Jacobian (6, 3) at the pose of :func:`assemble` with a search.

    Leg angles follow from the loop equations G dθ + H dl = 0.
    """
    theta, S, T = np.empty(3), np.empty((3, 3)), np.empty((4, 4))
    gap, G, H, inverse = np.empty(3), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    b, a = geometry[0], geometry[1]
    assemble(q, geometry, np.array((float(kinematics.SEARCH), 0.0)), T, np.empty(2))
    angles_of(T, b, a, gap, theta)
    constraints(q, theta, b, a, gap, G, H)
    invert(G, inverse)
    points(q, theta, b, S)
    J[:] = 0.0
    for k in range(3):
        for i in range(3):
            turn = 0.0
            for j in range(3):
                turn -= inverse[i, j] * H[j, k]
            c, s = math.cos(theta[i]), math.sin(theta[i])
            along = (-c if i == k else 0.0) + q[i] * s * turn
            x, y = along * COSINES[i], along * SINES[i]
            z = (s if i == k else 0.0) + q[i] * c * turn
            px, py, pz = S[i, 0] - T[0, 3], S[i, 1] - T[1, 3], S[i, 2] - T[2, 3]
            J[0, k] += x / 3.0
            J[1, k] += y / 3.0
            J[2, k] += z / 3.0
            # For unit masses at the three ball joints, the sum of p × v is I ω, with I = 3/2 a² (1 + n nᵀ).
            J[3, k] += (py * z - pz * y) * 2.0 / (3.0 * a * a)
            J[4, k] += (pz * x - px * z) * 2.0 / (3.0 * a * a)
            J[5, k] += (px * y - py * x) * 2.0 / (3.0 * a * a)
        normal = 0.5 * (J[3, k] * T[0, 2] + J[4, k] * T[1, 2] + J[5, k] * T[2, 2])
        for r in range(3):
            J[3 + r, k] -= normal * T[r, 2]


@inner
def _legs(T: Array, geometry: Array, q: Array) -> None:
    """Write leg lengths (3,) of the pose with T's height and normal, without torsion."""
    b, a = geometry[0], geometry[1]
    x, y, z = T[0, 2], T[1, 2], T[2, 2]
    share = 1.0 / max(1.0 + z, 1e-9)
    r11, r12, r22 = 1.0 - x * x * share, -x * y * share, 1.0 - y * y * share
    px, py = 0.5 * a * (r11 - r22), -a * r12
    for i in range(3):
        c, s = COSINES[i], SINES[i]
        dx = px + a * (r11 * c + r12 * s) - b * c
        dy = py + a * (r12 * c + r22 * s) - b * s
        dz = T[2, 3] - a * (x * c + y * s)
        q[i] = math.sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write leg lengths (3,) [m]; see :class:`teleop_core.robots.robot.Kernels`."""
    if not kinematics.is_askable(T, seed):
        return -1
    _legs(T, geometry, q)
    is_there = branches.slowed(q, seed, limits, q)
    theta, S, reached = np.empty(3), np.empty((3, 3)), np.empty((4, 4))
    _close(q, geometry, theta)
    points(q, theta, geometry[0], S)
    frame(S, reached)
    kinematics.pose_residual(reached, T, residual)
    tilt = math.sqrt((reached[0, 2] - T[0, 2]) ** 2 + (reached[1, 2] - T[1, 2]) ** 2)
    is_up = reached[2, 2] * T[2, 2] >= 0.0
    if abs(reached[2, 3] - T[2, 3]) > kinematics.REACHED or tilt > kinematics.REACHED or not is_up:
        return _UNREACHABLE if is_there else _LIMITED
    is_near = is_near_singular(q, theta, geometry[0], geometry[1])
    return _NEAR_SINGULAR if is_near else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the leg lengths (1, 3) for T's height and normal; return the number of solutions, 1."""
    _legs(T, geometry, solutions[0])
    return 1


def make(**geometry: float | str) -> Robot:
    """3-RPS with hinges at ``b``, ball joints at ``a`` and legs ``l_home`` at home [m]."""
    row = geometry_of(GEOMETRY, geometry)
    for symbol in ("b", "a"):
        if row[symbol] <= 0.0:
            raise ParameterError(symbol, row[symbol], "a length > 0 m")
    if row["l_home"] <= abs(row["b"] - row["a"]):
        raise ParameterError("l_home", row["l_home"], "more than |b - a|, so that legs meet")
    home = np.full(3, row["l_home"])
    drives = electric_cylinders(3, speed_limit=2.0)  # assumed for a platform of a metre
    return Robot(
        name="rps3",
        joint_names=("l1", "l2", "l3"),
        lower=home / 1.5,  # assumed strokes
        upper=home * 1.5,
        home=home,
        geometry=row,
        kernels=kinematics.Kernels(
            fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all, assemble=assemble, assemblies=assemblies
        ),
        drives=drives,
        task_mask=(False, False, True, True, True, False),
        describe=rps3_bodies,
    )
