"""Watch: finds the faults of an arm, plays its script of commands, and reports its state."""

from typing import Annotated

import numpy as np

from teleop_core.graph import TICK_NS
from teleop_core.graph.operation import State
from teleop_core.kernels import Array, Fields, IntegerPerJoint, Integers, PerJoint, Vector3, inner
from teleop_core.slave.operation.faults import FAULTS, Fault, Reaction
from teleop_core.slave.operation.states import Event, OperatingState, change
from teleop_core.slave.operation.thresholds import MOST_EVENTS, OperationParameters


class ServerRecord(Fields):
    """Fields of the parameter record of an arm's server, with the bounds for commands and faults."""

    operation: OperationParameters
    lower: PerJoint  # limits of the joints [rad or m]
    upper: PerJoint
    effort_limit: PerJoint  # rated efforts [N·m or N]
    speed_limit: PerJoint  # rated speeds [rad/s or m/s]
    lag: PerJoint  # largest allowed distance of a joint from its setpoint [rad or m]
    timeout_ns: int
    brakes: int
    heartbeat_ns: int
    outage_ns: int
    effort_ns: int
    silence_ns: int
    pressing_ns: int
    tip_error: float
    reported: Annotated[Integers, len(Fault)]
    event_count: int
    event: Annotated[Integers, MOST_EVENTS]
    event_ns: Annotated[Integers, MOST_EVENTS]


class ServerState(OperatingState):
    """Fields of the server's state record that are used to find faults."""

    setpoint: PerJoint  # [rad or m]; the next two fields have the same unit
    target: PerJoint
    measured: PerJoint
    speed: PerJoint  # [rad/s or m/s]
    full_ns: IntegerPerJoint  # time for which a drive has been at its effort limit [ns]
    must_brake: int
    told: int
    played: int
    first_ns: int
    heard_ns: int
    pressed_ns: int
    left_ns: int
    is_resting: int
    still_ns: int
    left_at: Vector3
    rest_time: float
    travel: float
    sampled_ns: int
    heard_of_ns: int


_REACTIONS = {Reaction.HOLD: 0, Reaction.BRAKE: 1, Reaction.PAUSE: 2, Reaction.REPORT: 3}
_REACTION = np.array([3, *(_REACTIONS[FAULTS[fault].reaction] for fault in Fault if fault)], dtype=np.int64)
_BRAKE, _PAUSE, _REPORT = 1, 2, 3
_ENABLED, _PAUSED, _FAULT = int(State.ENABLED), int(State.PAUSED), int(State.FAULT)
_DISABLED = int(State.DISABLED)
_STOP, _FAILED, _LAPSED = int(Event.STOP), int(Event.FAILED), int(Event.LAPSED)
_HEARTBEAT, _PRESSED = int(Fault.HEARTBEAT), int(Fault.STOP)
_TRACKING, _TIP, _EFFORT = int(Fault.TRACKING), int(Fault.TIP), int(Fault.EFFORT)
_OVERSPEED, _LIMIT = int(Fault.OVERSPEED), int(Fault.JOINT_LIMIT)
_FEEDBACK = int(Fault.FEEDBACK)
REST_NS = 50_000_000
"""An arm counts as at rest after this time without motion of any joint [ns]. An oscillating joint is slow at each
turning point. At the usual bandwidths of drives, 60 to 80 rad/s, a turning point takes half of :data:`REST_NS`."""
# A joint this close to its limit [rad or m] counts as at the limit.
_AT = 1e-9
# A drive whose effort is at least this share of its limit counts as saturated.
_FULL = 0.999


@inner
def fail(p: ServerRecord, s: ServerState, fault: int, joint: int, value: float, bound: float) -> None:
    """Record a fault and start its reaction; an active fault is not overwritten."""
    reaction = _REPORT if p.reported[fault] else _REACTION[fault]
    if reaction == _REPORT:
        s.told = fault
        if s.fault != 0 or s.state == _FAULT:
            return
    elif reaction == _PAUSE:
        if s.state != _ENABLED:
            return
        change(s, _LAPSED)
    else:
        if reaction == _BRAKE:
            s.must_brake = 1
        is_first = s.state != _FAULT
        change(s, _STOP if fault in (_PRESSED, _HEARTBEAT) else _FAILED)
        if not is_first:
            return
    s.fault, s.fault_joint, s.fault_value, s.fault_bound = fault, joint, value, bound


@inner
def begin_tick(p: ServerRecord, s: ServerState, now_ns: int) -> None:
    """Execute the scripted commands that are due; a stop button that sends no more messages counts as pressed."""
    if s.first_ns == 0:
        s.first_ns = now_ns
        s.heard_ns = max(s.heard_ns, now_ns)
        s.pressed_ns = now_ns - TICK_NS  # no joint was pressed before the first tick
    while s.played < p.event_count and now_ns - s.first_ns >= p.event_ns[s.played]:
        if p.event[s.played] == _STOP:
            fail(p, s, _PRESSED, -1, 0.0, 0.0)
        else:
            change(s, p.event[s.played])
        s.played += 1
    if p.heartbeat_ns > 0 and now_ns - s.heard_ns > p.heartbeat_ns:
        s.is_pressed = 1
        fail(p, s, _HEARTBEAT, -1, 1e-9 * (now_ns - s.heard_ns), 1e-9 * p.heartbeat_ns)
    if s.state != _FAULT:
        s.must_brake = 0
    if s.state == _ENABLED and s.fault != 0 and s.told == 0:
        s.fault, s.fault_joint, s.fault_value, s.fault_bound = 0, -1, 0.0, 0.0
    s.told = 0


@inner
def is_braked(p: ServerRecord, s: ServerState) -> bool:
    """Whether the drives are off and brakes hold the arm."""
    return bool(s.must_brake or (p.brakes and s.state in (_DISABLED, _FAULT)))


@inner
def watch_joints(p: ServerRecord, s: ServerState, effort: Array, passed_ns: int) -> None:
    """Find joints that are too far from their setpoint, too fast, or at the effort limit of their drives.

    Args:
        p: Parameters.
        s: State; written.
        effort: Efforts that the drives gave (n,) [N·m or N].
        passed_ns: Time since the last call [ns].
    """
    for i in range(effort.shape[0]):
        off = abs(s.setpoint[i] - s.measured[i])
        if not off <= p.lag[i]:  # also for NaN
            fail(p, s, _TRACKING, i, off, p.lag[i])
        fast = p.operation.overspeed * p.speed_limit[i]
        if not abs(s.speed[i]) <= fast:
            fail(p, s, _OVERSPEED, i, abs(s.speed[i]), fast)
        is_full = abs(effort[i]) >= _FULL * p.effort_limit[i]
        s.full_ns[i] = s.full_ns[i] + passed_ns if is_full else 0
        if s.full_ns[i] > p.effort_ns:
            fail(p, s, _EFFORT, i, 1e-9 * s.full_ns[i], 1e-9 * p.effort_ns)


@inner
def watch_tip(p: ServerRecord, s: ServerState, setpoint: Array, measured: Array) -> None:
    """Find a tip that is too far from its setpoint; both are poses (7,)."""
    square = 0.0
    for i in range(3):
        square += (setpoint[i] - measured[i]) ** 2
    if not square <= p.tip_error * p.tip_error:
        fail(p, s, _TIP, -1, square**0.5, p.tip_error)


@inner
def watch_limits(p: ServerRecord, s: ServerState, now_ns: int) -> None:
    """Find commands that push a joint against its limit."""
    pressed = -1
    for i in range(s.target.shape[0]):
        if s.target[i] <= p.lower[i] + _AT or s.target[i] >= p.upper[i] - _AT:
            pressed = i
    if pressed < 0 or s.state != _ENABLED or s.is_busy:
        s.pressed_ns = now_ns
    elif now_ns - s.pressed_ns > p.pressing_ns:
        bound = 1e-9 * p.pressing_ns
        fail(p, s, _LIMIT, pressed, bound, bound)


@inner
def measure_rest(s: ServerState, place: Array, now_ns: int) -> None:
    """Measure the time and the distance for which the tip, at ``place`` (7,), still moves after the arm had to stop."""
    if s.state == _ENABLED:
        s.left_ns, s.is_resting = 0, 0
        return
    if s.left_ns == 0:
        s.left_ns, s.travel, s.is_resting = now_ns, 0.0, 0
        for i in range(3):
            s.left_at[i] = place[i]
    if s.is_resting:
        return
    square = 0.0
    for i in range(3):
        square += (place[i] - s.left_at[i]) ** 2
    s.travel = max(s.travel, square**0.5)
    if not s.is_moving:
        s.is_resting, s.rest_time = 1, 1e-9 * max(s.still_ns - s.left_ns, TICK_NS)


@inner
def find_rest(s: ServerState, moves: bool, now_ns: int) -> None:
    """Record whether the arm moves; it is at rest after :data:`REST_NS` without motion.

    The waiting time is needed because an oscillating joint has a speed of zero at each turning point.
    """
    if moves:
        s.still_ns, s.is_moving = 0, 1
        return
    if s.still_ns == 0:
        s.still_ns = now_ns
    s.is_moving = s.is_moving and now_ns - s.still_ns < REST_NS


@inner
def watch_feedback(p: ServerRecord, s: ServerState, now_ns: int) -> None:
    """Find an arm whose position has been unknown for too long."""
    silence_ns = now_ns - s.heard_of_ns
    if silence_ns > p.silence_ns:
        fail(p, s, _FEEDBACK, -1, 1e-9 * silence_ns, 1e-9 * p.silence_ns)


@inner
def is_blind(p: ServerRecord, s: ServerState, now_ns: int) -> bool:
    """Whether no measured position of the arm came within the command timeout."""
    return bool(now_ns - s.heard_of_ns > p.timeout_ns)


@inner
def tell(p: ServerRecord, s: ServerState, row: Array) -> None:
    """Write the numbers of :data:`~teleop_core.graph.topics.OPERATION`."""
    row[0], row[1], row[2], row[3] = s.state, s.is_homed, s.is_busy, s.is_stopped
    row[4], row[5], row[6], row[7] = s.fault, s.fault_joint, s.fault_value, s.fault_bound
    row[8] = s.rest_time if s.is_resting else 0.0
    row[9] = s.travel if s.is_resting else 0.0
    row[10], row[11] = is_braked(p, s), s.is_pressed
