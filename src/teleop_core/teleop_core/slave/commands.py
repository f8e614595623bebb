"""Commands: how the slave takes references, moves its setpoint to them or to a goal, and stops it."""

import math
from enum import IntEnum

from teleop_core.graph import Row, copy
from teleop_core.graph.operation import State
from teleop_core.kernels import Array, PerJoint, Wrench, inner
from teleop_core.kernels.filters import lag_step
from teleop_core.slave import ownership
from teleop_core.slave.arm import ArmModel
from teleop_core.slave.interpolation import WayRecord, WayState, begin_way
from teleop_core.slave.operation.faults import Fault
from teleop_core.slave.operation.watch import ServerRecord, ServerState, fail
from teleop_core.slave.parameters import SlaveParameters


class CommandStatus(IntEnum):
    """How the slave took the command of this tick."""

    FRESH = 0  # the command is new and followed
    STALE = 1  # no command came for longer than the command timeout: the last command is held
    REFUSED = 2  # a jump, of a wrong age, or of a stream beside the one that moves the arm: the last command is held
    MOVING = 3  # the arm moves to a goal, such as the start position, or at a wanted speed; servo_jp is ignored
    CLOSED = 4  # not enabled, or not homed: no command is followed
    BLIND = 5  # no recent measured position of the arm: the arm holds


class SlaveRow(Row):
    """Ports of the slave, and the status of this tick's command."""

    command_status: int


class SlaveRecord(SlaveParameters, ServerRecord, WayRecord, ownership.OwnershipRecord):
    """Parameter record of an arm's server."""

    start_jp: PerJoint  # joint position at which the arm starts to follow commands [rad or m]
    braking: PerJoint  # deceleration of the drives [rad/s² or m/s²]
    acceleration: PerJoint
    rest_speed: PerJoint
    near: PerJoint
    tool_speed: float  # [m/s]
    tool_acceleration: float  # [m/s²]


class SlaveState(ServerState, WayState, ownership.OwnershipState):
    """State record of an arm's server."""

    filtered: PerJoint
    step: PerJoint  # step of the setpoint in the last tick [rad or m]
    move_from: PerJoint
    move_to: PerJoint
    drive: PerJoint  # wanted speeds of the joints [rad/s or m/s]
    asked: PerJoint
    tool_step: float
    twist: Wrench  # wanted twist of the tip [m/s, rad/s]
    command_stamp_ns: int
    arrival_ns: int
    seen_ns: int
    refused: int
    refused_before: int
    in_row: int
    is_stream: int
    moved_ticks: int
    move_ticks: int
    motion: int
    driven_ns: int  # when the wanted speed came
    asked_ns: int  # stamp of the reference ``asked``, which came by a command; 0: none
    asked_by: int  # its Leader
    asked_seen_ns: int


_FRESH, _STALE, _REFUSED, _MOVING, _CLOSED = (
    int(CommandStatus[name]) for name in ("FRESH", "STALE", "REFUSED", "MOVING", "CLOSED")
)
# Commands farther apart than this do not count as a stream [ns].
_SLOWEST_NS = 500_000_000
AT_LIMITS, AT_ONCE, WITH_ARM = 0, 1, 2
"""How a setpoint comes to rest; see :func:`come_to_rest`."""
# Number of parts of a path in which the tip's speed is checked.
_PARTS = 32
_ENABLED, _SILENCE, _JUMP = int(State.ENABLED), int(Fault.SILENCE), int(Fault.JUMP)
_SERVO_JP = int(ownership.Leader.SERVO_JP)


@inner
def plan_move(p: SlaveRecord, s: SlaveState, arm: ArmModel, dt: float) -> None:
    """Begin the cubic move from the setpoint to ``move_to``, as fast as all limits allow.

    Joints stay within their share of the speed limits and within the acceleration of their drives. The tip stays
    within its speed limit, which is checked in 32 parts of the straight path through joint space.
    """
    longest = 0.0
    for i in range(s.setpoint.shape[0]):
        s.move_to[i] = min(max(s.move_to[i], p.lower[i]), p.upper[i])
        s.move_from[i] = s.setpoint[i]
        way = abs(s.move_to[i] - s.move_from[i])
        longest = max(longest, 1.5 * way / (p.start_speed * p.speed_limit[i]))
        longest = max(longest, math.sqrt(6.0 * way / p.braking[i]))
    x, y, z = 0.0, 0.0, 0.0
    for part in range(_PARTS + 1):
        for i in range(s.setpoint.shape[0]):
            arm.joints[i] = s.move_from[i] + part / _PARTS * (s.move_to[i] - s.move_from[i])
        arm.fk(arm.joints, arm.geometry, arm.T)
        if part > 0:
            dx, dy, dz = arm.T[0, 3] - x, arm.T[1, 3] - y, arm.T[2, 3] - z
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            longest = max(longest, 1.5 * _PARTS * length / p.tool_speed)
        x, y, z = arm.T[0, 3], arm.T[1, 3], arm.T[2, 3]
    s.move_ticks, s.moved_ticks, s.must_plan = math.ceil(longest / dt), 0, 0


@inner
def advance_move(s: SlaveState) -> None:
    """Advance the cubic move by one tick."""
    if s.moved_ticks >= s.move_ticks:
        return
    s.moved_ticks += 1
    share = s.moved_ticks / s.move_ticks
    share = share * share * (3.0 - 2.0 * share)
    for i in range(s.setpoint.shape[0]):
        place = (
            s.move_to[i]
            if s.moved_ticks == s.move_ticks
            else (s.move_from[i] + share * (s.move_to[i] - s.move_from[i]))
        )
        s.step[i] = place - s.setpoint[i]
        s.command[i] = s.target[i] = s.filtered[i] = s.setpoint[i] = place


@inner
def move_joint(p: SlaveRecord, s: SlaveState, i: int, step: float, dt: float) -> None:
    """Move a joint's setpoint by a step, within the speed limit of its drive and the joint limits."""
    reach, before = p.speed_limit[i] * dt, s.setpoint[i]
    step = min(max(step, -reach), reach)
    s.setpoint[i] = min(max(before + step, p.lower[i]), p.upper[i])
    s.step[i] = s.setpoint[i] - before


@inner
def forget_way(s: SlaveState) -> None:
    """Set the command to the setpoint, and drop the command that is still being interpolated."""
    for i in range(s.setpoint.shape[0]):
        s.command[i] = s.target[i] = s.filtered[i] = s.setpoint[i]
    s.span, s.ticks = 0, 1


@inner
def come_to_rest(p: SlaveRecord, s: SlaveState, how: int, dt: float) -> None:
    """Stop the setpoint: as fast as the drives can brake, at once, or where the brakes hold the arm.

    Args:
        p: Parameters.
        s: State; written.
        how: :data:`AT_LIMITS`: brake as fast as the drives can. :data:`AT_ONCE`: stand still from this tick on.
            :data:`WITH_ARM`: the drives are off, and the setpoint goes to the measured position.
        dt: Tick [s].
    """
    for i in range(s.setpoint.shape[0]):
        step = s.step[i]
        if how == WITH_ARM:
            step = s.measured[i] - s.setpoint[i]
        elif how == AT_ONCE:
            step = 0.0
        else:
            less = p.braking[i] * dt * dt
            step = max(0.0, step - less) if step > 0.0 else min(0.0, step + less)
        move_joint(p, s, i, step, dt)
    forget_way(s)


@inner
def _not_followed(s: SlaveState) -> int:
    """Status of an arm that follows no command."""
    s.arrival_ns, s.in_row, s.is_stream = 0, 0, 0
    return _MOVING if s.is_busy or s.motion != 0 else _CLOSED


@inner
def _age_of_command(p: SlaveRecord, s: SlaveState, now_ns: int) -> int:
    """Status FRESH or STALE; the arm changes to PAUSED if no command of the stream came for too long."""
    silence_ns = now_ns - s.arrival_ns
    if silence_ns <= p.timeout_ns:
        return _FRESH
    if s.is_stream and 0 < p.outage_ns < silence_ns:
        fault = _JUMP if s.refused > s.refused_before else _SILENCE
        fail(p, s, fault, -1, 1e-9 * silence_ns, 1e-9 * p.outage_ns)
    return _STALE


@inner
def take_command(p: SlaveRecord, s: SlaveState, row: SlaveRow, dt: float) -> int:
    """Accept a new servo_jp, or a reference that came by another command; return the :class:`CommandStatus`."""
    stamp_ns, asked_ns = row.slave_servo_jp_ns, s.asked_ns
    if stamp_ns < s.seen_ns - ownership.AHEAD_NS:  # stamps of another clock after a silence: a new stream
        s.seen_ns = 0
    is_new, last_ns = stamp_ns > s.seen_ns, s.seen_ns
    if stamp_ns <= row.now_ns + max(0, -s.ahead_ns) + ownership.AHEAD_NS:  # otherwise later commands would count as old
        s.seen_ns = max(s.seen_ns, stamp_ns)
    s.asked_ns = 0
    if s.state != _ENABLED or s.is_busy or s.motion != 0 or not s.is_homed:
        return _not_followed(s)
    status = _FRESH
    if is_new:
        status = _take_reference(p, s, row.slave_servo_jp, stamp_ns, last_ns, _SERVO_JP, row.now_ns, dt)
    if asked_ns != 0:
        status = _take_reference(p, s, s.asked, asked_ns, s.asked_seen_ns, s.asked_by, row.now_ns, dt)
        s.asked_seen_ns = asked_ns
    age = _age_of_command(p, s, row.now_ns)
    return status if status == _REFUSED else age


@inner
def _take_reference(
    p: SlaveRecord, s: SlaveState, wanted: Array, stamp_ns: int, last_ns: int, leader: int, now_ns: int, dt: float
) -> int:
    """Accept a joint reference, unless it is a jump, of a wrong age, or of a stream that may not move the arm.

    A jump is a reference farther from the present command than a joint moves at full speed during a time T. T is the
    command timeout or the time since the previous message, whichever is longer. The time since the previous message
    counts as half a second at most; for the first message it counts as half a second.

    Args:
        p: Parameters.
        s: State; written.
        wanted: Joints (n,) [rad or m].
        stamp_ns: Its stamp [ns].
        last_ns: Stamp of the previous reference of this stream [ns]; 0 for the first.
        leader: The stream, a :class:`~teleop_core.slave.ownership.Leader`.
        now_ns: Time of the tick [ns].
        dt: Tick [s].

    Returns:
        FRESH or REFUSED.
    """
    is_first, period_ns = last_ns == 0, min(stamp_ns - last_ns, _SLOWEST_NS)
    is_wrong = ownership.is_led_by_another(p, s, leader, now_ns)
    if ownership.has_wrong_age(p, stamp_ns, now_ns):  # also by the system's clock, if it was stepped since the start
        is_wrong = is_wrong or ownership.has_wrong_age(p, stamp_ns, now_ns - s.ahead_ns)
    far = max(p.timeout_ns, _SLOWEST_NS if is_first else period_ns) * 1e-9
    for i in range(s.command.shape[0]):
        near = abs(wanted[i] - s.target[i]) <= p.speed_limit[i] * far
        if not near:  # also for NaN
            is_wrong = True
    if is_wrong:
        s.refused += 1
        return _REFUSED
    # If stamps advance faster than our clock, the time between arrivals counts as the period.
    period_ns = 0 if is_first else min(period_ns, now_ns - s.arrival_ns)
    begin_way(p, s, wanted, period_ns, dt)
    is_next = s.arrival_ns > 0 and now_ns - s.arrival_ns <= ownership.longest_gap(p, s)
    ownership.lead(s, leader, now_ns)
    s.gap_ns = period_ns
    s.in_row = s.in_row + 1 if is_next else 0
    s.is_stream = max(s.is_stream, s.in_row)  # a gap does not turn a stream into single commands
    s.command_stamp_ns, s.arrival_ns, s.refused_before = stamp_ns, now_ns, s.refused
    return _FRESH


@inner
def follows(p: SlaveRecord, s: SlaveState, now_ns: int) -> bool:
    """Whether to follow the command.

    A fresh command is followed. An old command is followed if it is a single command, but not if it is the last command
    of a broken stream.
    """
    if s.state != _ENABLED or s.is_busy or not s.is_homed:
        return False
    return bool(now_ns - s.arrival_ns <= ownership.longest_gap(p, s) or s.in_row == 0)


@inner
def advance_setpoint(p: SlaveRecord, s: SlaveState, before: Array, dt: float) -> None:
    """Filter the command and move the setpoint to it, within the limits of speed and acceleration.

    Args:
        p: Parameters.
        s: State; written.
        before: Command (n,) of the last tick [rad or m].
        dt: Tick [s].
    """
    for i in range(before.shape[0]):
        lagged = s.filtered[i]
        if p.reference_filter.is_on:
            lag = p.reference_filter
            s.filtered[i] = lag_step(s.command[i], before[i], s.filtered[i], lag.gain, lag.zero, lag.pole, dt)
        else:
            s.filtered[i] = s.command[i]
        reach = p.speed_limit[i] * dt
        step = min(max(s.filtered[i] - s.setpoint[i], -reach), reach)
        most = p.acceleration[i] * dt * dt
        if abs(step - s.step[i]) > most:
            step = _eased(s.filtered[i] - s.setpoint[i], s.filtered[i] - lagged, s.step[i], most)
        move_joint(p, s, i, step, dt)


@inner
def stoppable(room: float, most: float) -> float:
    """Largest step from which a setpoint can stop within the distance ``room`` if each step is smaller by ``most``.

    A step r that shrinks by ``most`` each tick needs the distance r (r + most) / (2 most) to come to rest.
    """
    return 0.5 * (math.sqrt(most * (most + 8.0 * max(room, 0.0))) - most)


@inner
def _eased(ahead: float, flow: float, step: float, most: float) -> float:
    """Next step of a setpoint towards a moving target; the step may change by ``most`` a tick.

    The distance to the target is ``ahead``; the target moves by ``flow`` per tick. The speed relative to the target is
    never so high that the setpoint could not stop at the target.
    """
    relative = min(stoppable(abs(ahead), most), abs(ahead))
    wanted = flow + (relative if ahead > 0.0 else -relative)
    return min(max(wanted, step - most), step + most)


@inner
def limit_tool(p: SlaveRecord, s: SlaveState, arm: ArmModel, last: Array, dt: float) -> None:
    """Shorten the step of all joints if the tip would be too fast; write the setpoint's pose.

    Args:
        p: Parameters with ``tool_speed`` [m/s] and ``tool_acceleration`` [m/s²].
        s: State with ``setpoint`` and its last ``step`` (n,); written.
        arm: Arm model; its ``setpoint`` and ``T``, the pose of the setpoint, are written.
        last: Pose (7,) of the setpoint one tick ago.
        dt: Tick [s].
    """
    copy(s.setpoint, arm.setpoint)
    arm.fk(arm.setpoint, arm.geometry, arm.T)
    most = min(p.tool_speed * dt, s.tool_step + p.tool_acceleration * dt * dt)
    step = _distance(arm.T, last)
    if step > most:
        share = most / step
        for i in range(s.setpoint.shape[0]):
            s.setpoint[i] -= (1.0 - share) * s.step[i]
            s.step[i] *= share
        if s.is_busy:
            s.moved_ticks -= 1  # the move takes longer
        copy(s.setpoint, arm.setpoint)
        arm.fk(arm.setpoint, arm.geometry, arm.T)
        step = _distance(arm.T, last)
    s.tool_step = step


@inner
def _distance(T: Array, pose: Array) -> float:
    dx, dy, dz = T[0, 3] - pose[0], T[1, 3] - pose[1], T[2, 3] - pose[2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)
