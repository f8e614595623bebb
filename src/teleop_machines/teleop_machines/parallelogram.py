"""Parallelogram: the four-bar with equal opposite sides; its coupler never rotates.

q is the crank angle theta1; the tip is the coupler point at distance ``a`` from the crank. The closure has no sign to
choose, because the rocker is always parallel to the crank. This keeps the loop in one mode at theta1 = 0 and 180°,
where all links are on one line and the two modes of a general four-bar meet.

Source:
    Ghosal 2020, lecture 11, eq. 3 with l0 = l2, l1 = l3 and phi1 = theta1.
"""

import math

import numpy as np

from teleop_core.base import ParameterError
from teleop_core.kernels import Array, kernel
from teleop_core.kinematics import REACHED, IkStatus, Kernels, is_askable, pose_residual
from teleop_core.kinematics.branches import bounded, turned
from teleop_core.robots.robot import Robot, geometry_of
from teleop_machines.bodies.planar import parallelogram_bodies
from teleop_machines.drives import geared_motors

# No lengths are published: ground (and coupler), crank (and rocker), coupler point [m].
GEOMETRY = {"l0": 0.3, "l1": 0.2, "a": 0.15}
_TURNS = 4.0 * math.pi  # assumed cable limit
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_UNREACHABLE = int(IkStatus.UNREACHABLE)


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip``, (4, 4): the tip moves on a circle of radius l1 about (a, 0), without rotation."""
    T[:] = 0.0
    T[0, 0] = T[1, 1] = T[2, 2] = T[3, 3] = 1.0
    T[0, 3] = geometry[1] * math.cos(q[0]) + geometry[2]
    T[1, 3] = geometry[1] * math.sin(q[0])


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the Jacobian (6, 1)."""
    J[:] = 0.0
    J[0, 0] = -geometry[1] * math.sin(q[0])
    J[1, 0] = geometry[1] * math.cos(q[0])


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write theta1 (1,) of the nearest point; see :class:`teleop_core.robots.robot.Kernels`.

    If T is at the centre of the circle, all points are equally near, and the seed's crank angle is kept.
    """
    if not is_askable(T, seed):
        return -1
    x, y = T[0, 3] - geometry[2], T[1, 3]
    angle = seed[0]
    if math.hypot(x, y) > REACHED:
        is_path = math.isfinite(limits[2, 0])
        angle = turned(math.atan2(y, x), seed[0], limits[0, 0], limits[1, 0], is_path)
    q[0] = bounded(angle, seed[0], limits[0, 0], limits[1, 0], limits[2, 0])
    reached = np.empty((4, 4))
    fk(q, geometry, reached)
    pose_residual(reached, T, residual)
    if math.hypot(reached[0, 3] - T[0, 3], reached[1, 3] - T[1, 3]) <= REACHED:
        return _FOLLOWED
    return _LIMITED if q[0] != angle else _UNREACHABLE


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the crank angle (1, 1) that reaches T's x and y; return the number of solutions, 0 or 1."""
    x, y = T[0, 3] - geometry[2], T[1, 3]
    solutions[0, 0] = math.atan2(y, x)
    return 1 if abs(math.hypot(x, y) - geometry[1]) <= REACHED else 0


def make(**geometry: float | str) -> Robot:
    """Parallelogram with ground ``l0``, crank ``l1`` and coupler point ``a`` [m]."""
    row = geometry_of(GEOMETRY, geometry)
    for symbol in ("l0", "l1"):
        if row[symbol] <= 0.0:
            raise ParameterError(symbol, row[symbol], "a length > 0 m")
    drives = geared_motors(1)
    return Robot(
        name="parallelogram",
        joint_names=("theta1",),
        lower=np.array([-_TURNS]),
        upper=np.array([_TURNS]),
        home=np.array([0.5 * math.pi]),
        geometry=row,
        kernels=Kernels(fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all),
        drives=drives,
        task_mask=(True, True, False, False, False, False),
        describe=parallelogram_bodies,
    )
