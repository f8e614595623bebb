"""Force observer: the force on the tip without a sensor, from drive efforts and joint motion.

Drives, weight, friction and external forces change the generalised momentum of the arm. All except the external forces
are known, so the remaining change gives the external forces. They are as accurate as the friction model.
"""

import math
from typing import Annotated

import numpy as np

from teleop_core.graph import copy
from teleop_core.kernels import Array, Fields, PerJoint, inner, kernel
from teleop_core.kernels.room import room
from teleop_core.robots.dynamics.rigid_body import invert_positive, write_model
from teleop_core.slave.arm import ArmParts
from teleop_core.slave.friction import FrictionRecord

_DAMPING = 1e-4
"""Damping of the map from efforts to force, divided by its mean square gain.

In a direction whose sensitivity is a hundredth of that of the other directions, the estimate is half of the true force.
"""


class ObserverRecord(FrictionRecord):
    """Fields of a parameter record with the observer's model of the arm."""

    effort_limit: PerJoint
    is_estimated: int
    observer_gain: float


class ObserverState(Fields):
    """Fields of a state record with the observer's memory."""

    measured: PerJoint
    speed: PerJoint
    residual: PerJoint
    last_effort: PerJoint
    lagged: PerJoint
    last_speed: PerJoint
    momentum: PerJoint
    last_inertia: Annotated[Array, "joints", "joints"]
    is_observed: int


@inner
def _lag(s: ObserverState, effort: Array, model: Array, share: float) -> None:
    """Low-pass the drive efforts minus the efforts of the arm's model, so that they lag as much as the measured speeds.

    Speeds are differences of positions, so they belong to the middles of ticks. Between the middles of two ticks, the
    mean of the two efforts acts on the arm. The weight of the arm is taken at the time between these ticks.
    """
    for i in range(effort.shape[0]):
        mean = 0.5 * (s.last_effort[i] + effort[i]) - model[i]
        s.lagged[i] += (mean - s.lagged[i]) * share
        s.last_effort[i] = effort[i]


@inner
def _known_effort(p: ObserverRecord, s: ObserverState, i: int) -> float:
    """Effort of joint ``i`` that is explained by drives, the arm itself and friction [N·m or N]."""
    speed, scale = s.speed[i], p.friction_speed[i]
    dry = p.coulomb[i] * (speed / math.sqrt(speed * speed + scale * scale))
    return s.lagged[i] - p.viscous[i] * speed - dry


@inner
def _observe(p: ObserverRecord, s: ObserverState, model: Array, dt: float) -> None:
    """Update the residual (n,) [N·m or N] to the present tick, and store the values that the next tick needs.

    Args:
        p: Parameter record.
        s: State record; written.
        model: Bias and inertia (n + n²,) of the known model of the arm.
        dt: Tick [s].

    Source:
        De Luca and Mattone 2003; De Luca, Albu-Schäffer, Haddadin and Hirzinger 2006: r = K (p - ∫(τ + Cᵀ dq - g + r)
        dt), with Cᵀ dq = dM/dt dq - C dq. Steps use the new r (implicit), so that every gain is stable.
    """
    n = s.speed.shape[0]
    for i in range(n):
        momentum = turned = 0.0
        for j in range(n):
            inertia = model[n + n * i + j]
            momentum += inertia * s.speed[j]
            turned += (inertia - s.last_inertia[i, j]) * 0.5 * (s.speed[j] + s.last_speed[j])
            s.last_inertia[i, j] = inertia
        if s.is_observed:
            missing = momentum - s.momentum[i] - turned - dt * _known_effort(p, s, i)
            found = (s.residual[i] + p.observer_gain * missing) / (1.0 + p.observer_gain * dt)
            s.residual[i] = found if math.isfinite(found) else 0.0
        s.momentum[i] = momentum
    copy(s.speed, s.last_speed)


@kernel
def force_of_efforts(J: Array, efforts: Array, scale: Array, force: Array) -> None:
    """Write the force (3,) [N] on the tip that best explains the joint efforts (n,).

    Minimises Σ ((Jᵀ f - efforts)ᵢ / scaleᵢ)² + damping |f|². In a direction in which a force causes no joint effort, as
    in a singular arm, the estimated force is zero. If the Jacobian is not finite, the whole force is zero.

    Args:
        J: Jacobian (6, n) of the tip; only its linear rows are used, because the force acts at the tip without torque.
        efforts: Joint efforts caused by the force [N·m or N].
        scale: Scale of each joint's effort, > 0: its largest effort.
        force: Resulting force; written.
    """
    A, b = np.zeros((3, 3)), np.zeros(3)
    for k in range(3):
        for i in range(efforts.shape[0]):
            share = J[k, i] / (scale[i] * scale[i])
            b[k] += share * efforts[i]
            for m in range(3):
                A[k, m] += share * J[m, i]
    size = A[0, 0] + A[1, 1] + A[2, 2]
    for k in range(3):
        A[k, k] += _DAMPING * size / 3.0
        force[k] = 0.0
    if not (math.isfinite(size) and size > 0.0):
        return
    invert_positive(A)
    for k in range(3):
        for m in range(3):
            force[k] += A[k, m] * b[m]


@inner
def forget(s: ObserverState, wrench: Array) -> None:
    """Restart the observer at the next estimate; until then there is no estimate, so the wrench (6,) is zero."""
    s.is_observed = 0
    for i in range(s.residual.shape[0]):
        s.residual[i] = s.lagged[i] = 0.0
    for k in range(6):
        wrench[k] = 0.0


@inner
def estimate(p: ObserverRecord, s: ObserverState, arm: ArmParts, lag: float, dt: float, wrench: Array) -> None:
    """Write the estimated force on the tip in axes of the slave's base, with a torque of zero.

    The estimate uses encoder positions, amplifier efforts, the control law's model and the plant's mean friction. The
    residual of the previous tick is used.

    Args:
        p: Parameters.
        s: State; written.
        arm: Arm; its scratch arrays ``measured``, ``joints`` and ``J`` are written.
        lag: Time constant of the measured speeds [s].
        dt: Tick [s].
        wrench: Written (6,) [N, N·m].
    """
    n = arm.q.shape[0]
    model, residual, scale, force = np.empty(n + n * n), np.empty(n), np.empty(n), room(3)
    copy(s.measured, arm.measured)
    copy(s.speed, arm.joints)
    write_model(arm.acceleration, arm.model, arm.measured, arm.joints, model)
    if not s.is_observed:  # until this tick the arm was held at rest or by its brakes
        copy(model[:n], s.last_effort)
        copy(s.speed, s.last_speed)
    _observe(p, s, model, dt)
    _lag(s, arm.effort, model, dt / (dt + lag))
    s.is_observed = 1
    copy(s.residual, residual)
    copy(p.effort_limit, scale)
    arm.jacobian(arm.measured, arm.tip_geometry, arm.J)
    force_of_efforts(arm.J, residual, scale, force)
    for k in range(3):
        wrench[k] = force[k]
