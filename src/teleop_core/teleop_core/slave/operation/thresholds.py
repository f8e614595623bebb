"""Thresholds of an arm: limits of its motion, and what counts as a fault."""

from dataclasses import dataclass

from teleop_core.base import ParameterError, Within, fixed, parameter
from teleop_core.slave.operation.faults import NAMES
from teleop_core.slave.operation.states import COMMANDS, Event, command_event

_STANDSTILLS = ("hold", "brake")
MOST_EVENTS = 64


@dataclass(frozen=True, kw_only=True)
class OperationParameters:
    """Thresholds at which an arm in operation is limited, reports a fault or changes its state."""

    starts_enabled: bool = fixed(
        True,
        doc="true: the arm enables and homes itself; false: it waits for the commands enable and "
        "home, as hardware does",
    )
    standstill: str = parameter(
        "hold",
        choices=_STANDSTILLS,
        doc="a stopped or disabled arm is held by its drives, or by its brakes with the drives off",
    )
    heartbeat: float = parameter(
        0.0,
        Within(0.01, 10.0, "s"),
        "longest time between two messages of a stop button; after a longer time the button counts "
        "as pressed; 0: there is no stop button",
        off=0.0,
    )
    longest_outage: float = parameter(
        2.0,
        Within(0.01, 60.0, "s"),
        "if no command arrives for this time, the arm pauses, and needs the command resume to go on; 0: never",
        off=0.0,
        source="assumed: longer than short interruptions of a node, and shorter than a person looks away",
    )
    oldest_command: float = parameter(
        5.0,
        Within(0.01, 3600.0, "s"),
        "a command whose stamp is older than this is refused; 0: never, for a sender with another clock",
        off=0.0,
        source="assumed: longer than the delays over which people steer an arm, 3 s (Ferrell 1965)",
    )
    longest_silence: float = parameter(
        2.0,
        Within(0.01, 60.0, "s"),
        "if the arm reports no position for this time, that is a fault; the arm holds much earlier, "
        "after the command timeout",
        source="assumed: the same as longest_outage",
    )
    acceleration_share: float = parameter(
        20.0,
        Within(1.0, 1000.0),
        "largest acceleration of setpoints, divided by the acceleration of the drives, which is "
        "effort limit over inertia",
        source="assumed: at 1 kHz, encoder steps of the stylus alone need up to 12 times the "
        "acceleration of the drives",
    )
    tool_speed: float = parameter(
        0.0,
        Within(0.0, 10.0, "m/s"),
        "largest speed of the tip; 0: the tip speed of the joint that moves the tip fastest at home",
    )
    tool_acceleration: float = parameter(
        0.0,
        Within(0.0, 1e5, "m/s²"),
        "largest acceleration of the tip's speed; 0: derived from acceleration_share for the "
        "joint that moves the tip fastest at home",
    )
    longest_lag: float = parameter(
        0.2,
        Within(0.001, 10.0, "s"),
        "if a joint is farther from its setpoint than it moves at full speed in this time, that is a fault",
        source="assumed: four times the lag of the PID laws at full speed, which is 3 over their bandwidth",
    )
    tip_error: float = parameter(
        0.0,
        Within(0.0, 1.0, "m"),
        "if the tip is farther from its setpoint than this, that is a fault; 0: tool_speed times longest_lag",
    )
    effort_time: float = parameter(
        1.0,
        Within(0.01, 60.0, "s"),
        "if a drive is at its effort limit for longer than this, that is a fault",
        source="assumed: to brake from full speed takes 0.1 s",
    )
    overspeed: float = parameter(
        1.5,
        Within(1.0, 10.0),
        "if the speed of a joint divided by its speed limit exceeds this, that is a fault",
        source="assumed: motors have no more torque at a tenth above their rated speed",
    )
    pressing_time: float = parameter(
        1.0,
        Within(0.01, 60.0, "s"),
        "if commands are beyond a joint's limit for longer than this, the joint counts as pressed into the limit",
    )
    reported: tuple[str, ...] = parameter((), choices=NAMES, doc="faults that are reported, but do not stop the arm")
    events: tuple[str, ...] = fixed(
        (), doc="state commands and their times since the start, as command@seconds: stop@2.5, reset@4, enable@4.1"
    )

    def __post_init__(self) -> None:
        if len(self.events) > MOST_EVENTS:
            needed = f"at most {MOST_EVENTS} commands"
            raise ParameterError("operation.events", f"{len(self.events)} commands", needed)
        self.script()

    def script(self) -> list[tuple[float, Event]]:
        """Times [s] since the first tick with their scripted events, in order of time.

        Raises:
            ParameterError: An entry has the wrong form.
        """
        found = []
        for text in self.events:
            name, at, time = text.strip().partition("@")
            try:
                seconds = float(time)
            except ValueError:
                seconds = -1.0
            if not at or not 0.0 <= seconds <= 1e6 or name not in COMMANDS:
                form = f"command@seconds, the command one of {', '.join(COMMANDS)}: stop@2.5"
                raise ParameterError("operation.events", text, form)
            found.append((seconds, command_event(name)))
        return sorted(found, key=lambda entry: entry[0])
