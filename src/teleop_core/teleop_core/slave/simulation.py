"""Simulation: one tick of the arm's drives and mechanics, on records of parameters and state."""

import math
from typing import Any, NamedTuple

from teleop_core.graph.signals import Field, copy
from teleop_core.graph.topics import OPERATION
from teleop_core.kernels import inner, kernel, records
from teleop_core.kernels.geometry import Array, pose_from_transform
from teleop_core.robots.rigid_body import write_model
from teleop_core.slave.elastic import integrate_elastic
from teleop_core.slave.force_observer import (
    OBSERVER_PARAMETERS,
    estimate,
    forget,
    observer_state,
)
from teleop_core.slave.force_sensor import SENSOR_PARAMETERS, SENSOR_STATE, sense
from teleop_core.slave.friction import wander
from teleop_core.slave.joints import integrate
from teleop_core.slave.plants import PER_JOINT
from teleop_core.slave.transmission import LONGEST_DELAY, drive, follow_encoders
from teleop_core.slave.world.contact import WORLD_PARAMETERS, touch, world_state

# A joint that is farther from its setpoint [rad or m] is no joint of a simulation in its senses.
_ASTRAY = 10.0
SPEED_LAG = 5e-3
"""Time constant of the low-pass of measured speeds [s]."""
_BRAKED = OPERATION.index("is_braked")


def simulation_records(n: int) -> tuple[Any, Any]:
    """Parameter and state record of a simulated arm with ``n`` joints."""
    joints = (*PER_JOINT, "bristle_damping", "gear_damping", "effort_limit", "speed_limit",
              "compensated", "braking")  # fmt: skip
    rows: list[Field] = [(name, "f8", (n,)) for name in joints]
    rows += [(name, "i8") for name in ("steps", "delay_ticks", "has_gears")]
    rows += [*WORLD_PARAMETERS, *SENSOR_PARAMETERS, *OBSERVER_PARAMETERS]
    plant = ("measured", "speed", "bent", "grip", "astray", "slipped", "carried", "link",
             "link_speed")  # fmt: skip
    state: list[Field] = [(name, "f8", (n,)) for name in plant]
    state += [("noise", "i8", (n,)), ("driven", "i8"), ("late", "f8", (LONGEST_DELAY + 1, n))]
    state += [*world_state(n), *SENSOR_STATE, *observer_state(n)]
    return records(rows)[0], records(state)[0]


class Arm(NamedTuple):
    """Model, control law and motion of the arm: pointers and plain arrays, which kernels take."""

    tip_fk: Any  # of the links as they were made
    jacobian: Any  # of the same
    distance: Any  # of the object that the tip can touch
    acceleration: Any
    gravity: Any
    control: Any
    tip_geometry: Array
    coupling: Array
    dynamics: Array
    model: Array  # the dynamics that the control law knows
    gains: Array
    memory: Array  # of the control law
    q: Array  # joint positions (n,) at the encoders, unrounded
    dq: Array
    effort: Array
    setpoint: Array
    measured: Array
    feedforward: Array  # (n,); (2 n + n²,) for laws that take the model
    limit: Array
    joints: Array  # room for joints
    tip: Array  # true joint positions (n,), behind the transmission
    T: Array
    shape: Array  # numbers of the object
    offset: Array  # rooms for what the tip feels: (3,), (3,) and (6, n)
    normal: Array
    J: Array
    noises: Array  # of the force sensor in the coming ticks (N, 6)


@inner
def _measure(p: Any, s: Any, q: Array, dt: float) -> None:
    """Read the encoders."""
    for i in range(q.shape[0]):
        measured = round(q[i] / p.encoder_step[i]) * p.encoder_step[i]
        # Speed from encoder differences through a 5 ms low-pass: what a real drive reports.
        s.speed[i] += ((measured - s.measured[i]) / dt - s.speed[i]) * (dt / (dt + SPEED_LAG))
        s.measured[i] = measured


@inner
def _control(p: Any, s: Any, arm: Any, dt: float) -> None:
    """Write the effort that the control law asks for."""
    n = arm.q.shape[0]
    copy(s.measured, arm.measured)
    arm.gravity(arm.measured, arm.model, arm.feedforward[:n])
    for i in range(n):
        arm.feedforward[i] *= p.compensated[i]
    if arm.feedforward.shape[0] > n:
        copy(s.speed, arm.joints)
        write_model(arm.acceleration, arm.model, arm.measured, arm.joints, arm.feedforward[n:])
    arm.control(
        arm.gains, arm.memory, arm.setpoint, arm.measured, arm.feedforward, arm.limit, dt,
        arm.effort,
    )  # fmt: skip


@inner
def _brake(p: Any, s: Any, arm: Any, dt: float) -> None:
    """Let brakes as strong as the drives stop the arm, whatever its dynamics have become."""
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
def _see_joints(p: Any, s: Any, arm: Any) -> None:
    """Write where the joints truly are, behind gears that bend and tendons with play."""
    if p.has_gears:
        copy(s.link, arm.joints)
        follow_encoders(p, s, arm.joints, arm.coupling, arm.tip)
    else:
        follow_encoders(p, s, arm.q, arm.coupling, arm.tip)


@inner
def _touch(p: Any, s: Any, arm: Any, row: Any) -> None:
    """Let the tip feel the object, at the links that move it."""
    if p.has_gears:
        touch(p, s, arm, s.link, s.link_speed, row.slave_true_cf)
    else:
        touch(p, s, arm, arm.q, arm.dq, row.slave_true_cf)


@inner
def _estimate(p: Any, s: Any, arm: Any, row: Any, dt: float) -> None:
    """Write what joints and drives tell of the force on the tip; brakes tell nothing."""
    if p.is_estimated and not row.slave_operation[_BRAKED] > 0.0:
        estimate(p, s, arm, SPEED_LAG, dt, row.slave_estimated_cf)
    else:
        forget(s, row.slave_estimated_cf)


@inner
def _move_on(p: Any, s: Any, arm: Any, braked: bool, dt: float) -> None:
    """Move the arm by a tick: by its brakes, or under the effort of its drives."""
    if braked:
        _brake(p, s, arm, dt)
        for i in range(arm.q.shape[0]):
            s.link[i] += arm.dq[i] * dt
            s.link_speed[i] = arm.dq[i]
    elif p.has_gears:
        integrate_elastic(
            arm.acceleration, arm.dynamics, p, s, p.steps, arm.effort, arm.q, arm.dq, dt
        )
    else:
        integrate(arm.acceleration, arm.dynamics, p, s, p.steps, arm.effort, arm.q, arm.dq, dt)


@kernel
def simulation_step(p: Any, s: Any, arm: Any, row: Any, dt: float) -> None:
    """One control tick of a simulated arm: write what its encoders say, and where its tip is.

    What is measured is sampled at the start of the tick, together with the setpoint it is held
    against; then the arm moves on under constant effort. With brakes on, its drives are off.

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
    _measure(p, s, arm.q, dt)
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
