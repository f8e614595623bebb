"""Faults of an arm in operation: how the arm reacts to each, and how it reports it."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum


class Fault(IntEnum):
    """Kind of fault; 0 for no fault."""

    NONE = 0
    STOP = 1
    HEARTBEAT = 2
    TRACKING = 3
    TIP = 4
    EFFORT = 5
    OVERSPEED = 6
    SILENCE = 7
    JUMP = 8
    JOINT_LIMIT = 9
    CLOCK = 10
    PUBLISHERS = 11
    FLOOD = 12
    STALL = 13
    FEEDBACK = 14
    SETPOINT = 15

    @property
    def word(self) -> str:
        """Name of the fault in parameters and reports: ``"joint_limit"``."""
        return self.name.lower()


class Reaction(Enum):
    """Reaction of the arm to a fault."""

    HOLD = "FAULT; the setpoint stops at once, and the drives hold the arm there"
    BRAKE = "FAULT; drives off, brakes on, because control is not reliable"
    PAUSE = "PAUSED; the arm brakes at its limits, and goes on after the command resume"
    REPORT = "reported only; the arm goes on"


@dataclass(frozen=True)
class FaultKind:
    """Reaction, unit of the bound, and text of a fault."""

    reaction: Reaction
    text: str
    unit: str = ""


FAULTS: Mapping[Fault, FaultKind] = {
    Fault.STOP: FaultKind(Reaction.HOLD, "emergency stop"),
    Fault.HEARTBEAT: FaultKind(Reaction.HOLD, "no heartbeat of the emergency stop", "s"),
    Fault.TRACKING: FaultKind(Reaction.BRAKE, "joint too far from its setpoint", "rad or m"),
    Fault.TIP: FaultKind(Reaction.BRAKE, "tip too far from its setpoint", "m"),
    Fault.EFFORT: FaultKind(Reaction.BRAKE, "drive at its effort limit for too long", "s"),
    Fault.OVERSPEED: FaultKind(Reaction.BRAKE, "joint faster than its drive", "rad/s or m/s"),
    Fault.SILENCE: FaultKind(Reaction.PAUSE, "no command for too long", "s"),
    Fault.JUMP: FaultKind(Reaction.PAUSE, "commands too far from the present one", "s"),
    Fault.JOINT_LIMIT: FaultKind(Reaction.REPORT, "commands press a joint into its limit", "s"),
    Fault.CLOCK: FaultKind(Reaction.PAUSE, "this machine's clock was stepped", "s"),
    Fault.PUBLISHERS: FaultKind(Reaction.PAUSE, "two publishers on a command topic"),
    Fault.FLOOD: FaultKind(Reaction.REPORT, "more messages per second than flood_rate"),
    Fault.STALL: FaultKind(Reaction.PAUSE, "the slave's own loop stood still", "s"),
    Fault.FEEDBACK: FaultKind(
        Reaction.HOLD, "no slave/measured_js; its sender, such as arm_bridge, says why in its log", "s"
    ),
    Fault.SETPOINT: FaultKind(Reaction.HOLD, "a command led to a setpoint that is no number; the last one is held"),
}
"""All faults with their reactions; faults that a session lists in ``reported`` are only reported."""
ALWAYS = (Fault.STOP, Fault.HEARTBEAT, Fault.SETPOINT)
"""Faults that always stop the arm; ``reported`` cannot demote them to a message."""
NAMES = tuple(fault.word for fault in Fault if fault and fault not in ALWAYS)
"""Names of the faults that a session can list in ``reported``."""
