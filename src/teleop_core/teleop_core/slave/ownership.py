"""Ownership: which stream of commands moves the arm, and how old a command may be.

Among streams the first one moves the arm until it has been silent for the command timeout, or for twice its period. A
command of another stream is refused meanwhile. A command whose stamp is too old, or ahead of the slave's clock, is
refused in any case. These two rules apply to every command of :mod:`teleop_core.slave.motion_commands` and to the
topic ``slave/servo_jp``.
"""

from enum import IntEnum

from teleop_core.kernels import Fields, kernel


class Leader(IntEnum):
    """Stream that moves the arm, by its CRTK command."""

    NOBODY = 0
    SERVO_JP = 1  # servo_cp too, which inverse kinematics converts to servo_jp
    INTERPOLATE_JP = 2
    INTERPOLATE_CP = 3
    SERVO_JR = 4
    SERVO_JV = 5
    SERVO_CV = 6

    @property
    def command(self) -> str:
        """Name of the command."""
        return self.name.lower()


class OwnershipRecord(Fields):
    """Fields of a parameter record with the bounds of silence and age."""

    timeout_ns: int
    oldest_ns: int  # 0: a command may have any age


class OwnershipState(Fields):
    """Fields of a state record with the stream that moves the arm."""

    leader: int  # a Leader
    led_ns: int  # time of its last accepted command
    gap_ns: int  # time between its last two commands, as far as it is measured
    ahead_ns: int  # lead of the ticks' clock over the system's, which may have been stepped since the start [ns]


AHEAD_NS = 1_000_000_000
"""Stamps this far ahead of the slave's clock are refused [ns]; smaller leads are a usual difference of clocks."""


@kernel
def has_wrong_age(p: OwnershipRecord, stamp_ns: int, now_ns: int) -> bool:
    """Whether a command's stamp is too old, or too far ahead of the slave's clock."""
    return stamp_ns > now_ns + AHEAD_NS or (p.oldest_ns > 0 and stamp_ns < now_ns - p.oldest_ns)


@kernel
def longest_gap(p: OwnershipRecord, s: OwnershipState) -> int:
    """Silence [ns] after which a stream counts as broken; for a slow stream twice its period."""
    return max(p.timeout_ns, 2 * s.gap_ns)


@kernel
def is_led_by_another(p: OwnershipRecord, s: OwnershipState, leader: int, now_ns: int) -> bool:
    """Whether a stream other than ``leader`` moves the arm."""
    if s.leader in (0, leader):
        return False
    return now_ns - s.led_ns <= longest_gap(p, s)


@kernel
def lead(s: OwnershipState, leader: int, now_ns: int) -> None:
    """Record that a command of a stream was accepted."""
    if s.leader != leader:
        s.gap_ns = 0
    s.leader, s.led_ns = leader, now_ns
