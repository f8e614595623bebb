"""SessionLink: the interface between the page and a session, live or recorded."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from teleop_console.picture_streams import Picture
from teleop_core.base.errors import SessionError
from teleop_core.graph.topics import Topic
from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot

Setting = bool | int | float | str | tuple[bool, ...] | tuple[int, ...] | tuple[float, ...] | tuple[str, ...]
"""Value of a parameter."""


REFUSED = "a recording accepts no commands"
"""Answer of a link to commands that it does not support."""


@dataclass(frozen=True)
class ShownArm:
    """An arm of the session: its robot, and its namespace, which is empty for the default arm."""

    name: str
    robot: Robot


@dataclass
class ArmView:
    """Newest data of one arm.

    Attributes:
        streams: Newest values of each stream by its name without the arm, such as ``slave/measured_cp``. The columns
            are those of :class:`~teleop_core.graph.topics.Kind`. Topics that have had no message are missing.
        stamp_ns: Stamps of these values [ns].
        state: Numbers of ``teleop/state`` by name; empty before the first message.
        operation: Numbers of ``slave/operation`` by name; empty before the first message.
        operation_text: Text that describes ``operation``.
    """

    streams: dict[str, Array] = field(default_factory=dict)
    stamp_ns: dict[str, int] = field(default_factory=dict)
    state: dict[str, float] = field(default_factory=dict)
    operation: dict[str, float] = field(default_factory=dict)
    operation_text: str = ""

    def get(self, topic: Topic) -> Array | None:
        """Newest values of a stream; None before the first message."""
        return self.streams.get(topic.name)


@dataclass
class View:
    """Data of a session at one time.

    Attributes:
        time: Time since the beginning of the session [s].
        arms: Views of the arms, by namespace.
        is_fresh: Whether messages of the streams arrive; false if the session is silent or has ended.
        news: Warnings of the nodes, one line for each.
        delay: Median and 99th percentile of the delay from master sample to slave command [s]; NaN if unknown.
        rate: Ticks of the slave per second; NaN if unknown.
        phases: Mean time of each phase of a tick in the process of the slave [s], by its name; empty if unknown.
        age: Time since the newest shown sample arrived [s]; NaN if unknown.
        marks: Times [s] and texts of the marks that were set since the page opened.
        display: Frames per second and delay [s] of the operator's display; NaN without a display.
        pictures: Newest picture of each camera of a live session, by the camera's name.
        recording: Path of the present recording; None if no recording is made.
        run: Number of recordings that were saved in this session.
    """

    time: float = 0.0
    arms: dict[str, ArmView] = field(default_factory=dict)
    is_fresh: bool = False
    news: tuple[str, ...] = ()
    delay: tuple[float, float] = (float("nan"), float("nan"))
    rate: float = float("nan")
    phases: Mapping[str, float] = field(default_factory=dict)
    age: float = float("nan")
    marks: tuple[tuple[float, str], ...] = ()
    display: tuple[float, float] = (float("nan"), float("nan"))
    pictures: Mapping[str, Picture] = field(default_factory=dict)
    recording: Path | None = None
    run: int = 0


@dataclass(frozen=True)
class ParameterInfo:
    """A parameter of a node: its present value and its allowed values.

    Attributes:
        node: Name of the node with its namespace, such as ``left/slave``.
        name: Dotted name.
        value: Present value.
        doc: Meaning, with its unit.
        lower: Smallest value; None without a bound.
        upper: Largest value; None without a bound.
        choices: Allowed values of a text; empty if all values are allowed.
        is_fixed: Whether only a new session can change it.
    """

    node: str
    name: str
    value: Setting
    doc: str = ""
    lower: float | None = None
    upper: float | None = None
    choices: tuple[str, ...] = ()
    is_fixed: bool = False


Parameters = Mapping[tuple[str, str], ParameterInfo]
"""Parameters by node and name."""


class SessionLink(Protocol):
    """Access of the page to a session. All methods may be called from any thread.

    A subclass that defines only ``view`` and ``parameters`` refuses all commands.

    Attributes:
        arms: Arms of the session, the default arm first.
        title: Name of the session: its scenario or its recording.
        is_live: Whether the session accepts commands; false for a recording.
    """

    arms: tuple[ShownArm, ...]
    title: str
    is_live: bool

    def view(self) -> View:
        """Newest data of the session. The method must be fast, because the page calls it in every frame."""

    def command(self, word: str, arm: str = "") -> tuple[bool, str]:
        """Send one of ``topics.STATE_COMMANDS``; returns whether it was accepted, and the reason."""
        return False, REFUSED

    def press(self, *, is_pressed: bool) -> None:
        """Press or release the emergency stop of all arms."""
        return

    def parameters(self) -> Parameters:
        """All parameters of all nodes by node and name, as they were at the last read."""

    def changes(self) -> Mapping[tuple[str, str], Setting]:
        """Parameters that any source has changed since the last call, by node and name."""
        return {}

    def change(self, node: str, name: str, value: Setting) -> str:
        """Set a parameter; returns the reason of a refusal, else an empty text."""
        return REFUSED

    def hold(self, arm: str, pose: Array) -> None:
        """Command the stylus to a pose (7,) in the master's base; silence after it releases the stylus."""
        return

    def let_go(self, arm: str) -> None:
        """Release the stylus: the slave holds its position until the stylus is held again."""
        return

    def press_button(self, arm: str, name: str) -> None:
        """Press and release the ``fixture`` or ``mode`` button of the stylus."""
        return

    def close_jaw(self, share: float) -> None:
        """Set the closed share of the jaw for all hands, 0 to 1. Closing also presses at a task's goal."""
        return

    def mark(self) -> tuple[bool, str]:
        """Set a mark at the present time; returns whether the recorder wrote it, and its text."""
        return False, REFUSED

    def save(self, name: str) -> Path:
        """Close the recording under a name and begin the next one; returns the path of the closed recording.

        Raises:
            TeleopError: The name cannot be used, or the recorder refuses.
        """
        raise SessionError(f"{name} is not saved: {REFUSED}")


def box_of(state: Mapping[str, float]) -> tuple[Array, Array] | None:
    """Centre and size [m] of the active fixture, in slave_base; None if no fixture is active."""
    if not state.get("is_fixture_on"):
        return None
    place = [[state[f"fixture_{what}_{axis}"] for axis in "xyz"] for what in ("center", "size")]
    center, size = np.array(place)
    return center, size
