"""Commands: how the slave takes references, moves its setpoint and comes to where it starts."""

from enum import IntEnum
from typing import Any

from teleop_core.geometry import Array
from teleop_core.kernels import inner
from teleop_core.mapping.filters import lag_step
from teleop_core.slave.interpolation import begin_way


class CommandStatus(IntEnum):
    """How the slave took the command of this tick."""

    FRESH = 0  # followed
    STALE = 1  # none came for longer than the command timeout: the last one is held
    REFUSED = 2  # too far from the one in force to be the same motion: the last one is held
    MOVING = 3  # on the way to where the slave starts: nothing is followed yet


# Stamps this far ahead of the slave's clock are an error, not a clock that is a little ahead.
_FUTURE_NS = 1_000_000_000
# Commands that are further apart than this are no stream [ns].
_SLOWEST_NS = 500_000_000


@inner
def move_to_start(p: Any, s: Any) -> None:
    """Make a tick of the cubic move from home to where the slave starts."""
    s.moved_ticks += 1
    share = s.moved_ticks / p.start_ticks
    share = share * share * (3.0 - 2.0 * share)
    for i in range(p.home.shape[0]):
        place = p.start[i] if s.moved_ticks == p.start_ticks else (
            p.home[i] + share * (p.start[i] - p.home[i])
        )  # fmt: skip
        s.command[i] = s.target[i] = s.filtered[i] = s.setpoint[i] = place


@inner
def take_command(p: Any, s: Any, row: Any, dt: float) -> int:
    """Accept a new servo_jp unless it is a jump; returns the :class:`CommandStatus`.

    A jump is farther from the command in force than full speed reaches in the command timeout, or
    in the time since the message before: no stream can be that far.
    """
    stamp, now_ns = row.slave_servo_jp_ns, row.now_ns
    if stamp > now_ns + _FUTURE_NS:  # taken, it would make every later command an old one
        s.refused += 1
        return 2
    if s.moved_ticks < p.start_ticks:
        s.seen_ns = max(s.seen_ns, stamp)
        return 3
    if stamp > s.seen_ns:
        period_ns = min(stamp - s.seen_ns, _SLOWEST_NS) if s.seen_ns > 0 else 0
        s.seen_ns = stamp
        far = max(p.timeout_ns, period_ns) * 1e-9
        for i in range(s.command.shape[0]):
            near = abs(row.slave_servo_jp[i] - s.target[i]) <= p.speed_limit[i] * far
            if not near:  # NaN is not near either
                s.refused += 1
                return 2
        # Commands whose stamps run ahead of the clock that they come by are as near as they come.
        begin_way(p, s, row.slave_servo_jp, min(period_ns, now_ns - s.arrival_ns), dt)
        s.command_stamp_ns, s.arrival_ns = stamp, now_ns
    return 1 if now_ns - s.arrival_ns > p.timeout_ns else 0


@inner
def advance_setpoint(p: Any, s: Any, before: Array, dt: float) -> None:
    """Filter the command and move the setpoint there, never faster than the drive can."""
    for i in range(before.shape[0]):
        if p.is_filtered:
            s.filtered[i] = lag_step(
                s.command[i], before[i], s.filtered[i], p.filter_gain, p.filter_zero,
                p.filter_pole, dt,
            )  # fmt: skip
        else:
            s.filtered[i] = s.command[i]
        reach = p.speed_limit[i] * dt
        step = min(max(s.filtered[i] - s.setpoint[i], -reach), reach)
        s.setpoint[i] = min(max(s.setpoint[i] + step, p.lower[i]), p.upper[i])
