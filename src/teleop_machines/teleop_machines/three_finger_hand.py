"""Three-fingered hand: three R-R-R fingers that hold a triangle; contacts are ball joints.

The hand has six degrees of freedom (nine joints minus three distances between contacts). As a robot, q is all nine
joints, theta, psi, phi of each finger. ``fk`` is the object's frame at the three contact points, if the joints hold
the object to 0.1 mm. ``ik`` puts every finger on the contact point of the wanted object pose, so the returned joints
hold the object unless a finger cannot follow. :class:`Hand` computes contact points, single fingers, and the three
joints that follow from six actuated joints.

Source:
    Ghosal 2020, lectures 6 and 11, after Salisbury 1982. The hand has six freedoms, not three as said in the lecture.
"""

import math

import numpy as np

from teleop_core import kinematics
from teleop_core.base import ParameterError
from teleop_core.kernels import Array, inner, kernel
from teleop_core.robots.robot import Robot
from teleop_machines import hand_fingers, rps3_loop
from teleop_machines.bodies.hand_bodies import hand_bodies
from teleop_machines.drives import finger_motors
from teleop_machines.hand_grasp import (
    FINGERS,
    GEOMETRY,
    SIDE,
    Grasp,
    GraspResult,
    Hand,
    checked_geometry,
    contact_jacobian,
    contacts,
    links_of,
    local_point,
    wanted_contact,
)

__all__ = ["GEOMETRY", "Grasp", "GraspResult", "Hand", "make"]

_LIMITS = np.radians([80.0, 110.0, 150.0])  # limits of theta, psi, phi in both directions; assumed
_NEAR = 0.02  # a finger with a smaller sine of phi, or a smaller share of its full reach, is near-singular
_CLOSED, _NOT_CLOSED = int(kinematics.FkStatus.CLOSED), int(kinematics.FkStatus.NOT_CLOSED)
_FOLLOWED, _LIMITED = int(kinematics.IkStatus.FOLLOWED), int(kinematics.IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = (int(kinematics.IkStatus.NEAR_SINGULAR), int(kinematics.IkStatus.UNREACHABLE))


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_object`` (4, 4) of nine joints."""
    points = np.empty((3, 3))
    contacts(q, geometry, points)
    rps3_loop.frame(points, T)


@kernel
def assemble(q: Array, geometry: Array, ask: Array, T: Array, out: Array) -> int:
    """Write ``T_base_object`` of nine joints; see :class:`kinematics.Kernels`.

    The object's pose is computed from the contact points; it does not depend on the seed. The residual is the largest
    slip between two contact points, at most :data:`AGREED`.
    """
    points = np.empty((3, 3))
    contacts(q, geometry, points)
    rps3_loop.frame(points, T)
    out[0], out[1] = 0.0, 1.0
    for i in range(FINGERS):
        j = (i + 1) % FINGERS
        square = 0.0
        for r in range(3):
            square += (points[i, r] - points[j, r]) ** 2
        out[0] = max(out[0], abs(math.sqrt(square) - geometry[SIDE]))
    return _CLOSED if out[0] <= kinematics.AGREED else _NOT_CLOSED


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the Jacobian (6, 9) of the object's frame, for joints that hold the object."""
    T, slopes = np.empty((4, 4)), np.empty((9, 9))
    fk(q, geometry, T)
    contact_jacobian(q, geometry, slopes)
    side, radius = geometry[SIDE], geometry[SIDE] / math.sqrt(3.0)
    for j in range(9):
        along_y = along_z = across_z = 0.0
        for r in range(3):
            J[r, j] = (slopes[r, j] + slopes[3 + r, j] + slopes[6 + r, j]) / 3.0
            along_y += T[r, 1] * (slopes[r, j] - J[r, j])
            along_z += T[r, 2] * (slopes[r, j] - J[r, j])
            across_z += T[r, 2] * (slopes[3 + r, j] - slopes[6 + r, j])
        for r in range(3):
            J[3 + r, j] = T[r, 0] * across_z / side
            J[3 + r, j] += (T[r, 2] * along_y - T[r, 1] * along_z) / radius


@inner
def _is_near_singular(p: hand_fingers.Triple, phi: float, links: hand_fingers.Triple) -> bool:
    """Whether a finger is straight, folded, or touches its own axis."""
    reach = math.sqrt(p[0] * p[0] + p[1] * p[1])
    return bool(abs(math.sin(phi)) < _NEAR or reach < _NEAR * (links[0] + links[1] + links[2]))


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write nine joints for ``T_base_object``; see :class:`teleop_core.robots.robot.Kernels`."""
    if not kinematics.is_askable(T, seed):
        return -1
    is_reachable, is_touching, is_near = True, True, False
    points, reached = np.empty((3, 3)), np.empty((4, 4))
    for i in range(FINGERS):
        links, p = links_of(i, geometry), local_point(i, geometry, wanted_contact(i, T, geometry))
        is_finger = hand_fingers.finger_joints(p, links, seed, limits, 3 * i, q)
        is_reachable = is_reachable and is_finger
        is_near = is_near or _is_near_singular(p, q[3 * i + 2], links)
    contacts(q, geometry, points)
    for i in range(FINGERS):
        x, y, z = wanted_contact(i, T, geometry)
        off = max(abs(points[i, 0] - x), abs(points[i, 1] - y), abs(points[i, 2] - z))
        is_touching = is_touching and off <= kinematics.REACHED
    rps3_loop.frame(points, reached)
    kinematics.pose_residual(reached, T, residual)
    if not is_touching:
        return _LIMITED if is_reachable else _UNREACHABLE
    return _NEAR_SINGULAR if is_near else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write up to 64 joint vectors (k, 9), with four branches for each finger; return the number of joint vectors."""
    counts, fingers = np.zeros(3, np.int64), np.empty((FINGERS, 4, 3))
    for i in range(FINGERS):
        links, p = links_of(i, geometry), local_point(i, geometry, wanted_contact(i, T, geometry))
        for branch in range(4):
            theta, psi, phi, is_reachable = hand_fingers.finger_branch(p, links, branch, 0.0)
            if is_reachable:
                joints = fingers[i, counts[i]]
                joints[0], joints[1], joints[2] = theta, psi, phi
                counts[i] += 1
    count = 0
    for a in range(counts[0]):
        for b in range(counts[1]):
            for c in range(counts[2]):
                for j in range(3):
                    solutions[count, j] = fingers[0, a, j]
                    solutions[count, 3 + j] = fingers[1, b, j]
                    solutions[count, 6 + j] = fingers[2, c, j]
                count += 1
    return count


def make(**geometry: float | str) -> Robot:
    """Hand with links l11 ... l33, fingers ``d`` beside and ``h`` above the thumb, object of side ``side`` [m].

    ``gamma`` rotates the thumb about y [rad]. At home the hand holds the object upright in front of the palm, with the
    fingers bent down and the thumb bent up.
    """
    row = checked_geometry(geometry)
    home, T, side = np.empty(9), np.empty((4, 4)), row["side"]
    reach = row["l11"] + 2.0 / 3.0 * (row["l12"] + row["l13"])
    corners = np.array([[0.0, -0.5, 0.5 / 3**0.5], [0.0, 0.5, 0.5 / 3**0.5], [0.0, 0.0, -1 / 3**0.5]])
    rps3_loop.frame(side * corners + [reach, 0.0, 0.5 * row["h"]], T)
    hand = Hand(row)
    for i, point in enumerate(hand.contacts_of(T)):
        bent = 1 if i < FINGERS - 1 else 0
        solutions = hand.finger_solutions(i + 1, point)
        if len(solutions) < 2 or (np.abs(solutions[bent]) > _LIMITS).any():
            raise ParameterError("side", side, "an object that the fingers reach before the palm")
        home[3 * i : 3 * i + 3] = solutions[bent]
    drives = finger_motors(9)
    return Robot(
        name="three_finger_hand",
        joint_names=tuple(f"{joint}{i}" for i in (1, 2, 3) for joint in ("theta", "psi", "phi")),
        lower=-np.tile(_LIMITS, FINGERS),
        upper=np.tile(_LIMITS, FINGERS),
        home=home,
        geometry=row,
        kernels=kinematics.Kernels(fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all, assemble=assemble),
        drives=drives,
        describe=hand_bodies,
    )
