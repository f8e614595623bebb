"""Following: whether the slave follows the hand, and what is sent while it does not.

Values from the slave may be old because of a network. The slave reports the stamp of the command that it follows. While
these stamps increase, the slave counts as following. When they stop, the last command is held for the time of an
answer, because the slave may still follow it. After that time the slave counts as moving by itself, and the command is
set to the slave's position.
"""

from teleop_core.graph import Row, topics
from teleop_core.kernels import Fields, inner


class FollowingRecord(Fields):
    """Fields of a parameter record with waiting times."""

    timeout_ns: int
    pause_ns: int


class FollowingState(Fields):
    """Fields of a state record with the last values from the slave."""

    last_ns: int  # stamp of the last command
    is_engaged: int
    in_force_ns: int  # stamp of the command that the slave follows
    rose_ns: int  # time at which ``in_force_ns`` last increased
    lag_ns: int  # lag of the setpoint behind the last command at the time ``rose_ns``
    lost_ns: int  # time since which the slave does not follow
    felt_ns: int  # stamp of the slave's force
    felt_at_ns: int  # time at which ``felt_ns`` last increased
    seen_ns: int  # stamp of the measured pose
    seen_at_ns: int  # time at which ``seen_ns`` last increased


@inner
def hear(s: FollowingState, row: Row) -> None:
    """Record the times at which values from the slave last arrived.

    Args:
        s: State; written.
        row: Signals.
    """
    now_ns, stamp_ns = row.master_measured_cp_ns, row.slave_setpoint_cp_ns
    if stamp_ns > s.in_force_ns > topics.NO_COMMAND_NS:
        # Compared with the last command, so that a pause of the master does not count as a lag of the slave.
        s.rose_ns, s.lag_ns = now_ns, s.last_ns - stamp_ns
    if row.slave_measured_cf_ns > s.felt_ns:
        s.felt_at_ns = now_ns
    if row.slave_measured_cp_ns > s.seen_ns:
        s.seen_at_ns = now_ns
    s.in_force_ns, s.felt_ns, s.seen_ns = (stamp_ns, row.slave_measured_cf_ns, row.slave_measured_cp_ns)


@inner
def is_felt(p: FollowingRecord, s: FollowingState, row: Row) -> bool:
    """Whether a force of the slave arrived recently; a constant force is sent rarely."""
    return bool(row.master_measured_cp_ns - s.felt_at_ns <= p.timeout_ns + topics.SELDOM_NS)


@inner
def is_seen(p: FollowingRecord, s: FollowingState, row: Row) -> bool:
    """Whether a measured pose of the slave arrived recently."""
    return bool(row.master_measured_cp_ns - s.seen_at_ns <= p.timeout_ns)


@inner
def follows(p: FollowingRecord, s: FollowingState, row: Row) -> bool:
    """Whether the slave follows the last command, or continues to report newer commands.

    After a pause of the master the slave does not follow.
    """
    pause_ns = row.master_measured_cp_ns - s.last_ns
    is_known = row.slave_setpoint_cp_ns > topics.NO_COMMAND_NS and s.last_ns != 0
    lag_ns = s.last_ns - max(row.slave_setpoint_cp_ns, s.rose_ns)
    return is_known and pause_ns <= p.pause_ns and lag_ns <= max(p.timeout_ns, 2 * pause_ns)


@inner
def is_in_doubt(p: FollowingRecord, s: FollowingState, is_following: bool, row: Row) -> bool:
    """Whether the position of a slave that does not follow is unknown, because its values are delayed or missing."""
    now_ns = row.master_measured_cp_ns
    if is_following:
        s.lost_ns = 0
        return False
    if s.lost_ns == 0:
        s.lost_ns = now_ns
    is_far = s.is_engaged != 0 and s.lag_ns > p.timeout_ns
    is_unheard = s.felt_ns > 0 and not is_felt(p, s, row)
    return is_far and (now_ns - s.lost_ns <= s.lag_ns or is_unheard)
