"""Simulation: one tick of the arm's drives and mechanics, on records of parameters and state."""

import math

from teleop_core.graph import Row, copy, topics
from teleop_core.kernels import Array, Fields, PerJoint, call_address, inner, kernel, pose_from_transform
from teleop_core.robots.dynamics.rigid_body import write_model
from teleop_core.slave.arm import ArmParts
from teleop_core.slave.elastic import ElasticRecord, ElasticState, integrate_elastic
from teleop_core.slave.force_observer import ObserverRecord, ObserverState, estimate, forget
from teleop_core.slave.force_sensor import SensorRecord, SensorState, sense
from teleop_core.slave.friction import wander
from teleop_core.slave.joints import integrate
from teleop_core.slave.transmission import TransmissionRecord, TransmissionState, drive, follow_encoders
from teleop_core.slave.world.contact import touch

# Beyond this distance from its setpoint [rad or m] the simulation of a joint has diverged.
_ASTRAY = 10.0
SPEED_LAG = 5e-3
"""Time constant of the low-pass of measured speeds [s]."""
_BRAKED = topics.OPERATION.index("is_braked")


class MoverRecord(Fields):
    """Addresses of the kernels of a plant that moves the arm itself, and of their blocks; all 0 for our own motion."""

    see: int  # writes the arm's motion and the force on its tip before a tick
    see_block: int
    move: int  # takes the effort or the setpoint of a tick
    move_block: int
    has_servos: int  # whether the plant's own drives follow the setpoint, so that the control law has no effect


class SimulationRecord(MoverRecord, ElasticRecord, TransmissionRecord, SensorRecord, ObserverRecord):
    """Parameter record of a simulated arm."""

    encoder_step: PerJoint  # [rad or m]
    compensated: PerJoint  # share of the gravity effort that is fed forward
    braking: PerJoint  # deceleration by the brakes [rad/s² or m/s²]
    steps: int
    has_gears: int


class SimulationState(ElasticState, TransmissionState, SensorState, ObserverState):
    """State record of a simulated arm."""


@inner
def _measure(p: SimulationRecord, s: SimulationState, q: Array, dt: float) -> None:
    for i in range(q.shape[0]):
        measured = round(q[i] / p.encoder_step[i]) * p.encoder_step[i]
        # Speed from encoder differences through a 5 ms low-pass: what a real drive reports.
        s.speed[i] += ((measured - s.measured[i]) / dt - s.speed[i]) * (dt / (dt + SPEED_LAG))
        s.measured[i] = measured


@inner
def _control(p: SimulationRecord, s: SimulationState, arm: ArmParts, dt: float) -> None:
    """Write the effort that the control law demands."""
    n = arm.q.shape[0]
    copy(s.measured, arm.measured)
    arm.gravity(arm.measured, arm.model, arm.feedforward[:n])
    for i in range(n):
        arm.feedforward[i] *= p.compensated[i]
    if arm.feedforward.shape[0] > n:
        copy(s.speed, arm.joints)
        write_model(arm.acceleration, arm.model, arm.measured, arm.joints, arm.feedforward[n:])
    arm.control(arm.gains, arm.memory, arm.setpoint, arm.measured, arm.feedforward, arm.limit, dt, arm.effort)


@inner
def _brake(p: SimulationRecord, s: SimulationState, arm: ArmParts, dt: float) -> None:
    """Let brakes as strong as the drives stop the arm; this works even if its dynamics have diverged."""
    for i in range(arm.q.shape[0]):
        fastest, less = p.speed_limit[i] * 1.5, p.braking[i] * dt
        speed = min(max(arm.dq[i], -fastest), fastest)
        speed = max(0.0, speed - less) if speed > 0.0 else min(0.0, speed + less)
        arm.dq[i] = speed if math.isfinite(speed) else 0.0
        if not abs(arm.q[i] - arm.setpoint[i]) <= _ASTRAY:
            arm.q[i] = arm.setpoint[i]
        arm.q[i] += arm.dq[i] * dt
        s.speed[i] = arm.dq[i] if not math.isfinite(s.speed[i]) else s.speed[i]


@inner
def _see_joints(p: SimulationRecord, s: SimulationState, arm: ArmParts) -> None:
    """Write the true joint positions, behind gears that bend and tendons with play."""
    if p.has_gears:
        copy(s.link, arm.joints)
        follow_encoders(p, s, arm.joints, arm.coupling, arm.tip)
    else:
        follow_encoders(p, s, arm.q, arm.coupling, arm.tip)


@inner
def _touch(p: SimulationRecord, s: SimulationState, arm: ArmParts, row: Row) -> None:
    """Compute the contact between tool and object, at the true positions of the links."""
    if p.has_gears:
        touch(p, arm.contacts, arm, s.link, s.link_speed, row.slave_true_cf)
    else:
        touch(p, arm.contacts, arm, arm.q, arm.dq, row.slave_true_cf)


@inner
def _estimate(p: SimulationRecord, s: SimulationState, arm: ArmParts, row: Row, dt: float) -> None:
    """Write the tip force estimated from joints and drives; with brakes on there is no estimate."""
    if p.is_estimated and not row.slave_operation[_BRAKED] > 0.0:
        estimate(p, s, arm, SPEED_LAG, dt, row.slave_estimated_cf)
    else:
        forget(s, row.slave_estimated_cf)


@inner
def _move_on(p: SimulationRecord, s: SimulationState, arm: ArmParts, braked: bool, dt: float) -> None:
    """Advance the arm by a tick, decelerated by its brakes or driven by its drives."""
    if p.move != 0:
        call_address(p.move, p.move_block)
    elif braked:
        _brake(p, s, arm, dt)
        for i in range(arm.q.shape[0]):
            s.link[i] += arm.dq[i] * dt
            s.link_speed[i] = arm.dq[i]
    elif p.has_gears:
        integrate_elastic(arm.acceleration, arm.dynamics, p, s, arm.contacts, p.steps, arm.effort, arm.q, arm.dq, dt)
    else:
        integrate(arm.acceleration, arm.dynamics, p, s, arm.contacts, p.steps, arm.effort, arm.q, arm.dq, dt)


@kernel
def simulation_step(p: SimulationRecord, s: SimulationState, arm: ArmParts, row: Row, dt: float) -> None:
    """One control tick of a simulated arm: write its encoder positions and the pose of its tip.

    Measured values are sampled at the start of the tick, together with the setpoint with which they are compared. Then
    the arm moves for a tick under constant effort. While the brakes are on, the drives are off.

    Args:
        p: Parameter record.
        s: State record; written.
        arm: :class:`Arm`; its motion is written.
        row: Signals.
        dt: Tick [s].
    """
    n = arm.q.shape[0]
    braked = row.slave_operation[_BRAKED] > 0.0
    copy(row.slave_setpoint_js, arm.setpoint)
    if p.see != 0:
        call_address(p.see, p.see_block)
    _measure(p, s, arm.q, dt)
    if p.has_servos == 0:
        _control(p, s, arm, dt)
        drive(p, s, arm)
    for i in range(n):
        if braked:
            arm.effort[i] = 0.0
        row.slave_measured_js[i] = s.measured[i]
        row.slave_measured_js[n + i] = s.speed[i]
        row.slave_measured_js[2 * n + i] = arm.effort[i]
    _see_joints(p, s, arm)
    arm.tip_fk(arm.tip, arm.tip_geometry, arm.T)
    pose_from_transform(arm.T, row.slave_true_cp)
    if p.has_world:
        _touch(p, s, arm, row)
    sense(p, s, arm, row)
    _estimate(p, s, arm, row, dt)
    wander(p, s)
    _move_on(p, s, arm, braked, dt)
