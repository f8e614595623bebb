"""Sometimes: events that random schedules must meet now and then; a search that never does has not looked there."""

from collections import Counter
from collections.abc import Iterable

from teleop_core.graph.operation import State
from teleop_core.slave.commands import CommandStatus
from teleop_core.slave.operation.faults import Fault
from teleop_core.slave.operation.states import COMMANDS

NO_STATE = "none"
"""State of an arm that has reported none yet."""
RELEASE = "release"
"""Service that gives a stream's command of the arm back."""
STATES = (*(state.name for state in State), NO_STATE)
_IMPOSSIBLE = {(State.DISABLED, State.PAUSED), (State.FAULT, State.ENABLED), (State.FAULT, State.PAUSED)}
"""Changes of the state that no command and no fault makes: see :mod:`teleop_core.slave.operation.states`."""
WHILE_HOMING = "a stop is pressed while the arm moves home"
WHILE_BRAKING = "a stop is pressed while the arm brakes"
BOTH_STOPS = "both stop buttons are held"
UNKNOWN_STOP = "a stop is pressed before the slave has discovered the button"
AGAIN = "a process is killed for the second time"
LOST = "a message is lost on a line or for a full socket"
GAVE_WAY = "a loop gives way to other programs"
DISK_ENDS = "a recorder ends because its disk failed"
DISK_STAYS = "a recorder outlives a failed disk"
SEVERAL_BAGS = "a session has several recordings"
TAPPED = "a stop button is released as soon as it is pressed"
BESIDE = "a second client drives the arm beside the hand"
BEYOND = "a client asks for a speed that no arm has"
OLD = "a command is a minute old when it comes"
AHEAD = "a command is a minute ahead of the clock"
MOMENTS = (
    WHILE_HOMING, WHILE_BRAKING, BOTH_STOPS, UNKNOWN_STOP, AGAIN, LOST, GAVE_WAY, DISK_ENDS, DISK_STAYS, SEVERAL_BAGS,
    TAPPED, BESIDE, BEYOND, OLD, AHEAD,
)  # fmt: skip
"""Events of the list above."""


def met(kind: str, state: str) -> str:
    """Name of the event that a fault begins in a state of the arm."""
    return f"{kind} in {state}"


def together(kind: str) -> str:
    """Name of the event that a fault begins during another fault."""
    return f"{kind} during another fault"


def recovered(kind: str) -> str:
    """Name of the event that the arm follows again after a schedule with a fault."""
    return f"recovery after {kind}"


def change(before: State, after: State) -> str:
    """Name of the event that an arm goes from one state to another."""
    return f"{before.name} becomes {after.name}"


def asked(command: str, state: str) -> str:
    """Name of the event that a command is sent to an arm in a state."""
    return f"{command} asked in {state}"


def catalogue(kinds: Iterable[str]) -> tuple[str, ...]:
    """Names of all events, for the kinds of faults that schedules have."""
    kinds = sorted(kinds)
    pairs = [(a, b) for a in State for b in State if a is not b and (a, b) not in _IMPOSSIBLE]
    return (
        *(met(kind, state) for kind in kinds for state in STATES),
        *(make(kind) for make in (together, recovered) for kind in kinds),
        *(change(before, after) for before, after in pairs),
        *(asked(command, state) for command in (*COMMANDS, RELEASE) for state in STATES),
        *(f"fault {fault.word}" for fault in Fault if fault not in OUT_OF_REACH),
        *(f"a command is {status.name}" for status in CommandStatus),
        *MOMENTS,
    )


OUT_OF_REACH = {
    Fault.NONE: "is no fault",
    Fault.EFFORT: "the simulated drives have no failure of their own",
    Fault.OVERSPEED: "the simulated drives have no failure of their own",
    Fault.STALL: "the simulated drives have no failure of their own",
    Fault.FEEDBACK: "no schedule damages a measured position",
    Fault.JOINT_LIMIT: "the setpoint never leaves the range, which is a law of other tests",
    Fault.SETPOINT: "the setpoint is always finite, which is a law of other tests",
}
"""Faults of an arm that no schedule can cause, with the reason."""


def never(seen: Counter[str], kinds: Iterable[str]) -> list[str]:
    """Events of the catalogue that were never met."""
    return [name for name in catalogue(kinds) if not seen[name]]
