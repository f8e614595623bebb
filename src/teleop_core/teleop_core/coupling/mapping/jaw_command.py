"""Jaw command: the jaw angle that the master's side commands.

The closing of the hand's handle, or a button of the stylus, determines the angle.
"""

from dataclasses import dataclass

from teleop_core.base import ParameterError, Within, parameter
from teleop_core.graph import Row, Stage, topics
from teleop_core.kernels import Fields, kernel

SOURCES = ("hand", "clutch", "fixture", "mode")
"""Sources that can close the jaw: the hand's handle, or a button, in the order of ``master/buttons``."""
_HAND = SOURCES.index("hand")
_PRESSED = 0.5


@dataclass(frozen=True, kw_only=True)
class JawCommandParameters:
    """Source that closes the jaw, and the angles of the jaw."""

    source: str = parameter(
        "hand",
        choices=SOURCES,
        doc="signal that closes the jaw: hand/jaw in proportion, or a button, which also keeps its own function",
    )
    toggles: bool = parameter(
        False,
        doc="true: each press of the button closes or opens the jaw; false: the jaw is closed while the button is held",
    )
    open_angle: float = parameter(
        0.8, Within(0.0, 3.0, "rad"), "angle between the fingers of the open jaw", source="assumed"
    )
    closed_angle: float = parameter(
        0.0,
        Within(-0.5, 3.0, "rad"),
        "commanded angle of the closed jaw; a smaller angle presses harder on thin objects",
        source="assumed",
    )

    def __post_init__(self) -> None:
        if not self.closed_angle < self.open_angle:
            text = f"less than open_angle ({self.open_angle:g} rad)"
            raise ParameterError("jaw_command.closed_angle", self.closed_angle, text)


class JawCommandState(Fields):
    """State record of the jaw's command."""

    was_pressed: int
    is_closed: int


@kernel
def jaw_command_step(p: JawCommandParameters, s: JawCommandState, row: Row, dt: float) -> None:
    """Write slave_jaw_servo_jp for a sample of the master.

    Args:
        p: Parameter record.
        s: State record; written.
        row: Signals.
        dt: Tick [s].
    """
    source = int(p.source)  # a choice among texts is stored as its index
    closing = row.hand_jaw[0] if source == _HAND else row.master_buttons[source - 1]
    closing = min(max(closing, 0.0), 1.0)
    if p.toggles:
        is_pressed = 1 if closing > _PRESSED else 0
        if is_pressed > s.was_pressed:
            s.is_closed = 1 - s.is_closed
        s.was_pressed = is_pressed
        closing = float(s.is_closed)
    row.slave_jaw_servo_jp[0] = p.open_angle + closing * (p.closed_angle - p.open_angle)


JAW_COMMAND = Stage(
    "jaw_command",
    JawCommandParameters,
    reads=(topics.MASTER_MEASURED_CP, topics.MASTER_BUTTONS, topics.HAND_JAW),
    writes=(topics.SLAVE_JAW_SERVO_JP,),
    step=jaw_command_step,
    state=JawCommandState,
    trigger=topics.MASTER_MEASURED_CP,
)
