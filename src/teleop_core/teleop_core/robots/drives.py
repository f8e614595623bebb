"""Drives and dynamics of slaves; the motors at the end are assumed, for sources that name none."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from teleop_core.geometry import Array
from teleop_core.kernels import kernel

_ROW = types.float64[::1]
# Signatures that let one compiled slave move any robot: see Dynamics for the arguments.
ACCELERATION = types.void(_ROW, _ROW, _ROW, _ROW, _ROW)
GRAVITY = types.void(_ROW, _ROW, _ROW)


@dataclass(frozen=True, kw_only=True, eq=False)
class Drives:
    """Drive table of a slave, one entry per joint [N·m or N, rad or m].

    ``bandwidth`` is the triple closed-loop pole of the default PID gains [rad/s];
    ``friction_speed`` is where Coulomb friction reaches 70 % of its value [rad/s or m/s];
    ``inertia`` is the reflected motor inertia plus, at home, that of the links.
    """

    inertia: Array
    viscous: Array
    coulomb: Array
    friction_speed: Array
    effort_limit: Array
    speed_limit: Array
    encoder_step: Array
    bandwidth: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Dynamics:
    """Rigid-body model of a slave over its ``parameters`` row.

    ``acceleration(q, dq, effort, parameters, ddq)`` and ``gravity(q, parameters, effort)`` write
    their last argument (n,). ``compensated`` (n,) names the axes whose gravity the published
    controller feeds forward.
    """

    acceleration: Any
    gravity: Any
    parameters: Array
    compensated: NDArray[np.bool_]


@kernel
def independent_acceleration(
    q: Array, dq: Array, effort: Array, inertia: Array, ddq: Array
) -> None:
    """Write accelerations of axes that are dominated by their motors."""
    for i in range(ddq.shape[0]):
        ddq[i] = effort[i] / inertia[i]


@kernel
def no_gravity(q: Array, inertia: Array, effort: Array) -> None:
    """Write zeros: balanced axes."""
    for i in range(effort.shape[0]):
        effort[i] = 0.0


def independent_axes(inertia: Array) -> Dynamics:
    """Model of axes that do not act on each other, with these inertias (n,) [kg·m² or kg]."""
    return Dynamics(
        acceleration=independent_acceleration,
        gravity=no_gravity,
        parameters=inertia,
        compensated=np.zeros(len(inertia), np.bool_),
    )


def _alike(
    count: int,
    inertia: float,
    viscous: float,
    coulomb: float,
    friction_speed: float,
    effort_limit: float,
    speed_limit: float,
    encoder_step: float,
    bandwidth: float,
) -> Drives:
    return Drives(
        inertia=np.full(count, inertia),
        viscous=np.full(count, viscous),
        coulomb=np.full(count, coulomb),
        friction_speed=np.full(count, friction_speed),
        effort_limit=np.full(count, effort_limit),
        speed_limit=np.full(count, speed_limit),
        encoder_step=np.full(count, encoder_step),
        bandwidth=np.full(count, bandwidth),
    )


def electric_cylinders(count: int, speed_limit: float = 0.3) -> Drives:
    """Legs of a parallel robot, each with 2 kg of motor and load to move [N, m, s]."""
    return _alike(count, 2.0, 20.0, 0.8, 5e-4, 80.0, speed_limit, 1e-6, 80.0)


def geared_motors(count: int) -> Drives:
    """Cranks of a bench mechanism of a few hundred millimetres [N·m, rad, s]."""
    return _alike(count, 0.02, 0.05, 0.01, 2e-3, 2.0, 3.0, 1e-5, 60.0)


def finger_motors(count: int) -> Drives:
    """Joints of a small hand, all nine driven [N·m, rad, s]."""
    return _alike(count, 2e-4, 1e-3, 5e-4, 1e-2, 0.05, 6.0, 1e-4, 80.0)
