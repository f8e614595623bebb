"""Step of the slave: one control tick as a kernel, on records of parameters, state and signals."""

import math
from typing import Any, NamedTuple

from teleop_core.geometry import Array, pose_from_transform
from teleop_core.kernels import inner, kernel, records
from teleop_core.operation.states import Event, State, change
from teleop_core.operation.watch import (
    OPERATION_PARAMETERS,
    OPERATION_STATE,
    begin_tick,
    find_rest,
    is_braked,
    measure_rest,
    tell,
    watch_joints,
    watch_limits,
    watch_tip,
)
from teleop_core.plants import PER_JOINT
from teleop_core.robots.rigid_body import write_model
from teleop_core.signals import Field, copy
from teleop_core.slave.commands import (
    AT_LIMITS,
    AT_ONCE,
    WITH_ARM,
    advance_move,
    advance_setpoint,
    come_to_rest,
    follows,
    limit_tool,
    plan_move,
    take_command,
)
from teleop_core.slave.elastic import integrate_elastic
from teleop_core.slave.friction import wander
from teleop_core.slave.interpolation import WAY_FIELDS, advance_on_way
from teleop_core.slave.joints import integrate
from teleop_core.slave.transmission import LONGEST_DELAY, drive, follow_encoders
from teleop_core.slave.velocity import advance_velocity
from teleop_core.topics import NO_COMMAND_NS

_ENABLED, _FAULT, _ARRIVED = int(State.ENABLED), int(State.FAULT), int(Event.ARRIVED)
# A joint that is farther from its setpoint [rad or m] is no joint of a simulation in its senses.
_ASTRAY = 10.0
SPEED_LAG = 5e-3
"""Time constant of the low-pass of measured speeds [s]."""


def slave_records(n: int) -> tuple[Any, Any]:
    """Parameter and state record of an arm with ``n`` joints."""
    joints = (*PER_JOINT, "bristle_damping", "gear_damping", "lower", "upper", "effort_limit",
              "speed_limit", "compensated", "start", "braking", "acceleration", "lag",
              "rest_speed")  # fmt: skip
    scalars = ("filter_gain", "filter_zero", "filter_pole", "start_speed",
               "tool_speed", "tool_acceleration")  # fmt: skip
    counts = ("is_filtered", "steps", "timeout_ns", "interpolation", "delay_ticks", "has_gears")
    rows = [(name, "f8", (n,)) for name in joints]
    numbers = [(name, "f8") for name in scalars] + [(name, "i8") for name in counts]
    moved = ("command", "filtered", "setpoint", "target", *WAY_FIELDS, "step", "move_from",
             "move_to", "drive", "asked")  # fmt: skip
    plant = ("measured", "speed", "bent", "grip", "astray", "slipped", "carried", "link",
             "link_speed")  # fmt: skip
    state: list[Field] = [(name, "f8", (n,)) for name in (*moved, *plant)]
    state += [(name, "i8", (n,)) for name in ("noise", "full_ticks")] + [("tool_step", "f8")]
    state += [("late", "f8", (LONGEST_DELAY + 1, n))]
    state += [("twist", "f8", (6,))]
    stamps = (
        "command_stamp_ns", "arrival_ns", "seen_ns", "refused", "refused_before", "in_row",
        "is_stream", "gap_ns", "moved_ticks", "move_ticks", "ticks", "span", "motion", "driven_ns",
        "asked_ns", "driven",
    )  # fmt: skip
    whole = [*state, *((name, "i8") for name in stamps), *OPERATION_STATE]
    return records([*rows, *numbers, *OPERATION_PARAMETERS])[0], records(whole)[0]


class Arm(NamedTuple):
    """Model, control law and motion of the arm: pointers and plain arrays, which kernels take."""

    fk: Any
    tip_fk: Any  # of the links as they were made
    jacobian: Any
    acceleration: Any
    gravity: Any
    control: Any
    geometry: Array
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
    speeds: Array  # room for what follows a twist: joint speeds (n,), and so on
    is_free: Array
    twist: Array
    J: Array
    A: Array
    b: Array


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
    copy(s.setpoint, arm.setpoint)
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
def _go_on(p: Any, s: Any, arm: Any, row: Any, before: Array, dt: float) -> None:
    """Move the setpoint: to a goal, at a speed, after the command, or to rest."""
    if s.state == _ENABLED and s.is_busy and not s.must_plan:
        advance_move(s)
    elif s.state == _ENABLED and s.is_busy:  # a way to a goal begins at rest
        come_to_rest(p, s, AT_LIMITS, dt)
    elif s.state == _ENABLED and s.motion != 0:
        advance_velocity(p, s, arm, row.now_ns, dt)
    elif follows(p, s, row.now_ns):
        advance_on_way(p, s)
        advance_setpoint(p, s, before, dt)
    elif is_braked(p, s):
        come_to_rest(p, s, WITH_ARM, dt)
    else:
        come_to_rest(p, s, AT_ONCE if s.state == _FAULT else AT_LIMITS, dt)


@inner
def _brake(p: Any, s: Any, arm: Any, dt: float) -> None:
    """Let brakes as strong as the drives stop the arm, whatever its dynamics have become."""
    for i in range(arm.q.shape[0]):
        fastest, less = p.speed_limit[i] * 1.5, p.braking[i] * dt
        s.full_ticks[i] = 0  # what an effort of before was, says nothing of that after a reset
        speed = min(max(arm.dq[i], -fastest), fastest)
        speed = max(0.0, speed - less) if speed > 0.0 else min(0.0, speed + less)
        arm.dq[i] = speed if math.isfinite(speed) else 0.0
        if not abs(arm.q[i] - s.setpoint[i]) <= _ASTRAY:
            arm.q[i] = s.setpoint[i]
        arm.q[i] += arm.dq[i] * dt
        s.speed[i] = arm.dq[i] if not math.isfinite(s.speed[i]) else s.speed[i]


@inner
def _is_still(s: Any) -> bool:
    """Whether the setpoint stands still."""
    moves = 0
    for i in range(s.step.shape[0]):
        moves += s.step[i] != 0.0
    return moves == 0


@inner
def _moves(p: Any, s: Any) -> bool:
    """Whether setpoint or arm move in this tick."""
    moving = 0
    for i in range(s.setpoint.shape[0]):
        moving += s.step[i] != 0.0 or not abs(s.speed[i]) <= p.rest_speed[i]
    return moving > 0


@inner
def _see_joints(p: Any, s: Any, arm: Any) -> None:
    """Write where the joints truly are, behind gears that bend and tendons with play."""
    if p.has_gears:
        copy(s.link, arm.joints)
        follow_encoders(p, s, arm.joints, arm.coupling, arm.tip)
    else:
        follow_encoders(p, s, arm.q, arm.coupling, arm.tip)


@inner
def _move_on(p: Any, s: Any, arm: Any, dt: float) -> None:
    """Move the arm by a tick: by its brakes, or under the effort of its drives."""
    if is_braked(p, s):
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
def slave_step(p: Any, s: Any, arm: Any, row: Any, dt: float) -> None:
    """One control tick: write the slave's setpoint, measured and true topics and its operation.

    What is measured is sampled at the start of the tick, together with the setpoint it is held
    against; then the arm moves on under constant effort.

    Args:
        p: Parameter record.
        s: State record; written.
        arm: :class:`Arm`; its motion is written.
        row: Signals.
        dt: Tick [s].
    """
    joints, n = arm.joints, arm.q.shape[0]
    begin_tick(p, s, row.now_ns)
    if s.asked_ns != 0:  # as a message of servo_jp would
        copy(s.asked, row.slave_servo_jp)
        row.slave_servo_jp_ns, s.asked_ns = s.asked_ns, 0
    row.command_status = take_command(p, s, row, dt)
    if s.state != _ENABLED:
        s.motion = 0
    if s.must_plan and _is_still(s):
        if s.is_homing:
            copy(p.start, s.move_to)
        plan_move(p, s, arm, dt)
        s.command_stamp_ns, s.motion = NO_COMMAND_NS, 0
    copy(s.command, joints)
    _go_on(p, s, arm, row, joints, dt)
    limit_tool(p, s, arm, row.slave_setpoint_cp, dt)
    if s.is_busy and not s.must_plan and s.moved_ticks >= s.move_ticks:
        change(s, _ARRIVED)
    pose_from_transform(arm.T, row.slave_setpoint_cp)
    _measure(p, s, arm.q, dt)
    _control(p, s, arm, dt)
    drive(p, s, arm)
    braked = is_braked(p, s)
    for i in range(n):
        if braked:
            arm.effort[i] = 0.0
        row.slave_setpoint_js[i] = s.setpoint[i]
        row.slave_measured_js[i] = s.measured[i]
        row.slave_measured_js[n + i] = s.speed[i]
        row.slave_measured_js[2 * n + i] = arm.effort[i]
    arm.fk(arm.measured, arm.geometry, arm.T)
    pose_from_transform(arm.T, row.slave_measured_cp)
    _see_joints(p, s, arm)
    arm.tip_fk(arm.tip, arm.tip_geometry, arm.T)
    pose_from_transform(arm.T, row.slave_true_cp)
    row.slave_setpoint_js_ns = row.slave_setpoint_cp_ns = s.command_stamp_ns
    if not braked:
        watch_joints(p, s, arm.effort, dt)
        watch_tip(p, s, row.slave_setpoint_cp, row.slave_measured_cp)
    watch_limits(p, s, row.now_ns)
    find_rest(s, _moves(p, s), row.now_ns)
    measure_rest(s, row.slave_measured_cp, row.now_ns)
    tell(s, row.slave_operation)
    wander(p, s)
    _move_on(p, s, arm, dt)
