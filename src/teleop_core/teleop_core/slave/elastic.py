"""Elastic joints: motors that move links through gears that bend.

Encoders sit on the motors. So the control law acts on one side of a spring, and the load is on the other side. Friction
acts on the motor. An arm may also have joints with rigid gears; these move as in the rigid model.
"""

from typing import Any

import numpy as np

from teleop_core.kernels import Array, PerJoint, inner, kernel
from teleop_core.robots.dynamics.rigid_body import invert_positive, write_model
from teleop_core.slave.friction import FrictionState, bend, friction
from teleop_core.slave.joints import LoadRecord
from teleop_core.slave.world.contact import add_push

_DAMPING = 0.02  # damping of a gear, divided by the critical damping of motor and spring; assumed


class ElasticRecord(LoadRecord):
    """Fields of a parameter record with gears that bend."""

    gear_stiffness: PerJoint  # [N·m/rad or N/m]; 0 for a joint that does not bend
    gear_damping: PerJoint
    motor_inertia: PerJoint  # [kg·m² or kg]


class ElasticState(FrictionState):
    """Fields of a state record with the links behind the gears that bend."""

    link: PerJoint  # [rad or m]
    link_speed: PerJoint


@inner
def _accelerate_links(
    acceleration: Any, dynamics: Array, p: ElasticRecord, q: Array, dq: Array, effort: Array, ddq: Array
) -> None:
    """Write link accelerations (n,): the rigid model without the motors of elastic joints."""
    n = q.shape[0]
    model, inertia = np.empty(n + n * n), np.empty((n, n))
    write_model(acceleration, dynamics, q, dq, model)
    for i in range(n):
        for j in range(n):
            inertia[i, j] = model[n + n * i + j]
        if p.gear_stiffness[i] > 0.0:
            inertia[i, i] -= p.motor_inertia[i]
    invert_positive(inertia)
    for i in range(n):
        ddq[i] = 0.0
        for j in range(n):
            ddq[i] += inertia[i, j] * (effort[j] - model[j])


@inner
def _derivative(
    acceleration: Any,
    dynamics: Array,
    p: ElasticRecord,
    s: ElasticState,
    contacts: Any,
    effort: Array,
    start: Array,
    place: Array,
    speed: Array,
    net: Array,
    found: Array,
) -> None:
    """Write accelerations (2, n) of motors and links at positions (2, n) and speeds (2, n)."""
    n = start.shape[0]
    for i in range(n):
        own = effort[i] - friction(p, s, i, place[0, i] - start[i], speed[0, i])
        net[i] = own
        if p.gear_stiffness[i] > 0.0:
            net[i] = p.gear_stiffness[i] * (place[0, i] - place[1, i])
            net[i] += p.gear_damping[i] * (speed[0, i] - speed[1, i])
            found[0, i] = (own - net[i]) / p.motor_inertia[i]
    add_push(p, contacts, place[1], speed[1], net)
    _accelerate_links(acceleration, dynamics, p, place[1], speed[1], net, found[1])
    for i in range(n):
        if p.gear_stiffness[i] == 0.0:
            found[0, i] = found[1, i]


@kernel
def integrate_elastic(
    acceleration: Any,
    dynamics: Array,
    p: ElasticRecord,
    s: ElasticState,
    contacts: Any,
    steps: int,
    effort: Array,
    q: Array,
    dq: Array,
    dt: float,
) -> None:
    """Advance motors ``q``, ``dq`` and links ``s.link``, ``s.link_speed`` by one tick.

    Args:
        acceleration: Pointer to the robot's rigid-body model, motors included.
        dynamics: Parameter row of the model.
        p: Parameters.
        s: State; written.
        contacts: :class:`~teleop_core.slave.world.contact.ContactState` of each point (N,).
        steps: Number of equal Runge-Kutta steps, >= 1.
        effort: Drive effort (n,) [N·m or N].
        q: Motor positions behind their gears (n,) [rad or m]; written.
        dq: Motor speeds behind their gears (n,) [rad/s or m/s]; written.
        dt: Tick [s].

    Source:
        Spong 1987, the flexible-joint model with motors of pure inertia.
    """
    n = q.shape[0]
    h = dt / steps
    place, speed = np.empty((2, n)), np.empty((2, n))
    at, net, start = np.empty((2, n)), np.empty(n), np.empty(n)
    going, push = np.zeros((4, 2, n)), np.zeros((4, 2, n))
    for i in range(n):
        place[0, i], place[1, i], speed[0, i], speed[1, i] = q[i], s.link[i], dq[i], s.link_speed[i]
    for _ in range(steps):
        for i in range(n):
            start[i] = place[0, i]
        for stage in range(4):
            last, share = max(stage - 1, 0), 0.5 * h * (stage > 0) * (1.0 + (stage == 3))
            for side in range(2):
                for i in range(n):
                    at[side, i] = place[side, i] + share * going[last, side, i]
                    going[stage, side, i] = speed[side, i] + share * push[last, side, i]
            _derivative(acceleration, dynamics, p, s, contacts, effort, start, at, going[stage], net, push[stage])
        _sum_up(place, going, h)
        _sum_up(speed, push, h)
        for i in range(n):
            bend(p, s, i, place[0, i] - start[i])
    for i in range(n):
        side = 1 if p.gear_stiffness[i] > 0.0 else 0
        q[i], dq[i] = place[0, i], speed[0, i]
        s.link[i], s.link_speed[i] = place[side, i], speed[side, i]


@inner
def _sum_up(total: Array, slopes: Array, h: float) -> None:
    """Add a classical Runge-Kutta step with the slopes (4, 2, n) to ``total`` (2, n)."""
    for side in range(2):
        for i in range(total.shape[1]):
            middle = slopes[1, side, i] + slopes[2, side, i]
            total[side, i] += h / 6.0 * (slopes[0, side, i] + 2.0 * middle + slopes[3, side, i])


def gear_damping(stiffness: Any, motor_inertia: Any) -> Any:
    """Damping of gears on their springs [N·m·s/rad or N·s/m]."""
    return 2.0 * _DAMPING * (stiffness * motor_inertia) ** 0.5
