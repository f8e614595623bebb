"""Step of the slave: one tick of the arm's server, on records of parameters, state and signals."""

import math

from teleop_core.graph import copy, topics
from teleop_core.graph.operation import State
from teleop_core.kernels import Array, inner, kernel, pose_from_transform
from teleop_core.slave import commands, interpolation, velocity
from teleop_core.slave.arm import ArmModel
from teleop_core.slave.operation import watch
from teleop_core.slave.operation.faults import Fault
from teleop_core.slave.operation.states import AFTER_RESET, Event, change

_ENABLED, _FAULT = int(State.ENABLED), int(State.FAULT)
_PAUSED, _SETPOINT = int(State.PAUSED), int(Fault.SETPOINT)
_ASKED, _JOINING, _JOINED = 1, 2, 3  # values of must_join: until the setpoint is at the measured position
_ARRIVED, _HOME, _BLIND = int(Event.ARRIVED), int(Event.HOME), int(commands.CommandStatus.BLIND)


@inner
def _moves(p: commands.SlaveRecord, s: commands.SlaveState) -> bool:
    """Whether the setpoint or the arm moves in this tick."""
    moving = 0
    for i in range(s.setpoint.shape[0]):
        moving += s.step[i] != 0.0 or not abs(s.speed[i]) <= p.rest_speed[i]
    return moving > 0


@inner
def _is_still(s: commands.SlaveState) -> bool:
    moves = 0
    for i in range(s.step.shape[0]):
        moves += s.step[i] != 0.0
    return moves == 0


@inner
def _is_near(p: commands.SlaveRecord, s: commands.SlaveState) -> bool:
    """Whether the arm is at its setpoint."""
    off = 0
    for i in range(s.setpoint.shape[0]):
        off += not abs(s.measured[i] - s.setpoint[i]) <= p.near[i]
    return off == 0


@inner
def _begin_where_it_is(p: commands.SlaveRecord, s: commands.SlaveState, arm: ArmModel, row: commands.SlaveRow) -> None:
    """Set the setpoint of an arm that is not at home to its measured position; homing starts from there."""
    if _is_near(p, s):
        return
    for i in range(s.setpoint.shape[0]):
        s.setpoint[i] = min(max(s.measured[i], p.lower[i]), p.upper[i])
        s.command[i] = s.target[i] = s.filtered[i] = s.setpoint[i]
    copy(s.setpoint, arm.setpoint)
    arm.fk(arm.setpoint, arm.geometry, arm.T)
    pose_from_transform(arm.T, row.slave_setpoint_cp)
    if s.state == _ENABLED:
        change(s, _HOME)


@inner
def _take_measured(p: commands.SlaveRecord, s: commands.SlaveState, arm: ArmModel, row: commands.SlaveRow) -> None:
    """Take a new sample of the arm, and look for faults in it.

    The sample was measured at the time of the present setpoint.
    """
    stamp_ns, n = row.slave_measured_js_ns, s.setpoint.shape[0]
    if stamp_ns == s.sampled_ns:
        return
    is_lost = row.now_ns - s.heard_of_ns > p.silence_ns
    before_ns, s.sampled_ns, s.heard_of_ns = s.sampled_ns, stamp_ns, row.now_ns
    for i in range(n):
        arm.joints[i] = s.measured[i] = row.slave_measured_js[i]
        s.speed[i] = row.slave_measured_js[n + i]
        arm.effort[i] = row.slave_measured_js[2 * n + i]
    arm.fk(arm.joints, arm.geometry, arm.T)
    pose_from_transform(arm.T, row.slave_measured_cp)
    if before_ns == 0:
        _begin_where_it_is(p, s, arm, row)
        return
    if is_lost:  # the arm may have been moved, or may have received no setpoint
        s.must_join = 1
    if watch.is_braked(p, s):
        for i in range(n):
            s.full_ns[i] = 0
    else:
        # The motion of the arm in a longer gap is unknown.
        watch.watch_joints(p, s, arm.effort, min(stamp_ns - before_ns, p.timeout_ns))
        watch.watch_tip(p, s, row.slave_setpoint_cp, row.slave_measured_cp)
    watch.find_rest(s, _moves(p, s), stamp_ns)
    watch.measure_rest(s, row.slave_measured_cp, stamp_ns)


@inner
def _go_on(
    p: commands.SlaveRecord, s: commands.SlaveState, arm: ArmModel, row: commands.SlaveRow, before: Array, dt: float
) -> None:
    """Move the setpoint: to a goal, at a speed, after the command, or to rest."""
    if s.state in (_ENABLED, _PAUSED):
        s.must_join = 0
    elif s.must_join == AFTER_RESET:
        s.must_join = 0 if _is_near(p, s) else _ASKED
    if s.state == _ENABLED and s.is_busy and not s.must_plan:
        commands.advance_move(s)
    elif s.state == _ENABLED and s.is_busy:  # a move to a goal begins at rest
        commands.come_to_rest(p, s, commands.AT_LIMITS, dt)
    elif s.state == _ENABLED and s.motion != 0:
        velocity.advance_velocity(p, s, arm, row.now_ns, dt)
    elif row.command_status != _BLIND and commands.follows(p, s, row.now_ns):
        interpolation.advance_on_way(p, s)
        commands.advance_setpoint(p, s, before, dt)
    elif watch.is_braked(p, s) or s.must_join in (_ASKED, _JOINING):
        commands.come_to_rest(p, s, commands.WITH_ARM, dt)
        s.must_join = _JOINING if s.must_join else 0
    else:
        has_joined = s.must_join == _JOINED  # the last step was no motion that could be continued
        commands.come_to_rest(p, s, commands.AT_ONCE if s.state == _FAULT or has_joined else commands.AT_LIMITS, dt)
        s.must_join = 0


@inner
def _insist_on_numbers(p: commands.SlaveRecord, s: commands.SlaveState, arm: ArmModel, row: commands.SlaveRow) -> None:
    """Hold the last setpoint, and report the fault, if the new setpoint is not finite."""
    for i in range(s.setpoint.shape[0]):
        if not math.isfinite(s.setpoint[i]):
            break
    else:
        return
    for i in range(s.setpoint.shape[0]):
        s.setpoint[i], s.step[i], s.drive[i] = row.slave_setpoint_js[i], 0.0, 0.0
    commands.forget_way(s)
    s.motion, s.tool_step = 0, 0.0
    copy(s.setpoint, arm.setpoint)
    arm.fk(arm.setpoint, arm.geometry, arm.T)
    watch.fail(p, s, _SETPOINT, -1, 0.0, 0.0)


@kernel
def slave_step(
    p: commands.SlaveRecord, s: commands.SlaveState, arm: ArmModel, row: commands.SlaveRow, dt: float
) -> None:
    """One tick of the arm's server: write the slave's setpoint, measured pose and operation.

    Measured values are those of the last tick, and are compared with the setpoint of that tick.

    Args:
        p: Parameter record.
        s: State record; written.
        arm: :class:`ArmModel`; its scratch arrays are written.
        row: Signals.
        dt: Tick [s].
    """
    joints = arm.joints
    _take_measured(p, s, arm, row)
    watch.begin_tick(p, s, row.now_ns)
    row.command_status = commands.take_command(p, s, row, dt)
    if s.state != _ENABLED:
        s.motion = 0
    elif watch.is_blind(p, s, row.now_ns):  # a later move begins from the arm's position at that time
        row.command_status, s.motion, s.must_plan = _BLIND, 0, s.is_busy
    if s.must_plan and row.command_status != _BLIND and _is_still(s):
        if s.is_homing:
            copy(p.start_jp, s.move_to)
        commands.plan_move(p, s, arm, dt)
        s.command_stamp_ns, s.motion = topics.NO_COMMAND_NS, 0
    copy(s.command, joints)
    _go_on(p, s, arm, row, joints, dt)
    commands.limit_tool(p, s, arm, row.slave_setpoint_cp, dt)
    _insist_on_numbers(p, s, arm, row)
    if s.must_join == _JOINING and (_is_near(p, s) or _is_still(s)):  # after the limit of the tool
        s.must_join = _JOINED
    if s.is_busy and not s.must_plan and s.moved_ticks >= s.move_ticks:
        change(s, _ARRIVED)
    pose_from_transform(arm.T, row.slave_setpoint_cp)
    copy(s.setpoint, row.slave_setpoint_js)
    row.slave_setpoint_js_ns = row.slave_setpoint_cp_ns = s.command_stamp_ns
    watch.watch_limits(p, s, row.now_ns)
    watch.watch_feedback(p, s, row.now_ns)
    watch.tell(p, s, row.slave_operation)
