"""Thresholds of an arm: limits of its motion, and what counts as a fault."""

from dataclasses import dataclass

from teleop_core.base import ParameterError, Within, parameter
from teleop_core.slave.operation.faults import NAMES
from teleop_core.slave.operation.states import COMMANDS, Event, command_event

_STANDSTILLS = ("hold", "brake")
MOST_EVENTS = 64


@dataclass(frozen=True, kw_only=True)
class OperationParameters:
    """Limits, faults and states of an arm in operation."""

    starts_enabled: bool = parameter(
        True, fixed=True, doc="whether it enables and homes itself; false: it waits for enable and home, as hardware"
    )
    standstill: str = parameter(
        "hold",
        choices=_STANDSTILLS,
        doc="after a stop, or disabled: the drives hold the arm, or are off and brakes hold it",
    )
    heartbeat: float = parameter(
        0.0,
        Within(0.01, 10.0, "s"),
        "a stop button that says 'released' less often than this counts as pressed; 0: none is there",
        off=0.0,
    )
    longest_outage: float = parameter(
        2.0,
        Within(0.01, 60.0, "s"),
        "after a longer silence of commands it is paused and resumes on purpose only; 0: never",
        off=0.0,
        source="assumed: longer than a node takes to hiccup, shorter than a person to look away",
    )
    longest_silence: float = parameter(
        2.0,
        Within(0.01, 60.0, "s"),
        "an arm that has not said for longer where it is has a fault; it holds long before, after the command timeout",
        source="assumed: as the longest outage",
    )
    acceleration_share: float = parameter(
        20.0,
        Within(1.0, 1000.0),
        "largest acceleration of setpoints over that of the drives, effort limit over inertia",
        source="assumed: encoder steps of the stylus alone ask for up to 12 times at 1 kHz",
    )
    tool_speed: float = parameter(
        0.0,
        Within(0.0, 10.0, "m/s"),
        "largest speed of the tip; 0: what the joint that moves it fastest at home reaches",
    )
    tool_acceleration: float = parameter(
        0.0, Within(0.0, 1e5, "m/s²"), "largest rise of the tip's speed; 0: what that joint's acceleration_share gives"
    )
    longest_lag: float = parameter(
        0.2,
        Within(0.001, 10.0, "s"),
        "a joint farther from its setpoint than full speed makes up in this time is a fault",
        source="assumed: four times what the PID laws leave at full speed, 3 over their bandwidth",
    )
    tip_error: float = parameter(
        0.0,
        Within(0.0, 1.0, "m"),
        "a tip farther from its setpoint than this is a fault; 0: than tool_speed makes up in longest_lag",
    )
    effort_time: float = parameter(
        1.0,
        Within(0.01, 60.0, "s"),
        "a drive at its effort limit for longer is a fault",
        source="assumed: braking from full speed takes 0.1 s",
    )
    overspeed: float = parameter(
        1.5,
        Within(1.0, 10.0),
        "a joint faster than this share of its speed limit is a fault",
        source="assumed: motors fade out a tenth above their rated speed",
    )
    pressing_time: float = parameter(
        1.0, Within(0.01, 60.0, "s"), "commands beyond a joint's limit for longer press it into that limit"
    )
    reported: tuple[str, ...] = parameter((), choices=NAMES, doc="faults that are told only and stop nothing")
    events: tuple[str, ...] = parameter(
        (), fixed=True, doc="commands at times since the start, command@seconds: stop@2.5, reset@4, enable@4.1"
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
