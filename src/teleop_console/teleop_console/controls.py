"""Controls: buttons of the page with which the driving person commands the session.

A control of your own, such as one that sets gentle limits, is one file, like any other part.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from teleop_console.link import ArmView, SessionLink, View
from teleop_console.status import alive, fixture_text, mode_text
from teleop_core.base.errors import PartError
from teleop_core.base.registry import Registry
from teleop_core.slave.operation.states import AT_REST_ONLY, STILL_PRESSED

Answers = Sequence[tuple[bool, str]]
"""Result of each requested action: whether it was done, and a line with the details."""
_PATIENCE = 3.0  # longest wait for an arm that must come to rest first [s]
_PAUSE = 0.2  # pause before the command is sent again [s]


@dataclass(frozen=True)
class Control:
    """A button of the page.

    Attributes:
        name: Label of the button.
        hint: Effect of the button, shown when the pointer is over it.
        act: Function ``act(link, arm)`` that does the action for the arm with this name (empty for the default arm) and
            returns :data:`Answers`. It runs in a separate thread. ``link.command`` sends commands, and ``link.change``
            sets parameters. If the last action was not done, the page shows its line to the person who pressed.
        folder: ``stylus`` for buttons of the hand's device; empty for the others.
        text: Function ``text(arm)`` that returns the present state, which is shown after the name; None to show
            nothing.
        is_alive: Function ``is_alive(view)`` that returns whether the button has an effect now; None if the button
            always has an effect.
    """

    name: str
    hint: str
    act: Callable[[SessionLink, str], Answers]
    folder: str = ""
    text: Callable[[ArmView], str] | None = None
    is_alive: Callable[[View], bool] | None = None


def commands(*words: str) -> Callable[[SessionLink, str], Answers]:
    """Return an action that sends commands to the arm, one after the other.

    Args:
        words: Commands from :data:`~teleop_core.graph.topics.STATE_COMMANDS`. The action releases the stop before a
            reset.
    """

    def act(link: SessionLink, arm: str) -> Answers:
        if "reset" in words:
            link.press(is_pressed=False)
        return [_insist(link, word, arm) for word in words]

    return act


def _insist(link: SessionLink, word: str, arm: str) -> tuple[bool, str]:
    """Send a command. If the arm is still coming to rest, the command is repeated for some time."""
    until = time.monotonic() + _PATIENCE
    while True:
        is_taken, text = link.command(word, arm)
        is_passing = AT_REST_ONLY in text or STILL_PRESSED in text  # a release may have been sent but not received
        # yet
        if is_taken or not is_passing or time.monotonic() > until:
            return is_taken, text
        time.sleep(_PAUSE)


def _release(link: SessionLink, arm: str) -> Answers:
    link.press(is_pressed=False)
    return ()


def _pressed(name: str) -> Callable[[SessionLink, str], Answers]:
    def act(link: SessionLink, arm: str) -> Answers:
        link.press_button(arm, name)
        return ()

    return act


def _is_alive(name: str, view: View) -> bool:
    return alive(view)[name]


def _built_in(
    name: str, hint: str, act: Callable[[SessionLink, str], Answers], text: Callable[[ArmView], str] | None = None
) -> Control:
    known = None if name == "Initialize" else partial(_is_alive, name)
    return Control(name, hint, act, "stylus" if text else "", text, known)


INITIALIZE = _built_in("Initialize", "release, reset, enable and home", commands("reset", "enable", "home"))
START = _built_in("Start", "follow the stylus", commands("enable"))
PAUSE = _built_in("Pause", "hold still until Start", commands("pause"))
HOME = _built_in("Home", "move smoothly to the home posture", commands("home"))
RELEASE = _built_in("Release", "releases the emergency stop; then press Initialize", _release)
MODE = _built_in("mode", "the mode button of the stylus", _pressed("mode"), mode_text)
FIXTURE = _built_in("fixture", "the fixture button of the stylus", _pressed("fixture"), fixture_text)


def _checked(name: str, part: object) -> Control:
    if not isinstance(part, Control):
        raise PartError("control", name, f"a Control, not a {type(part).__name__}")
    for field in ("act", "text", "is_alive"):
        if not (callable(found := getattr(part, field)) or (found is None and field != "act")):
            raise PartError("control", name, f"one with a callable {field}")
    return part


_HERE = "teleop_console.controls"
CONTROLS: Registry[Control] = Registry(
    "control",
    "controls",
    {
        "Initialize": f"{_HERE}:INITIALIZE",
        "Start": f"{_HERE}:START",
        "Pause": f"{_HERE}:PAUSE",
        "Home": f"{_HERE}:HOME",
        "Release": f"{_HERE}:RELEASE",
        "mode": f"{_HERE}:MODE",
        "fixture": f"{_HERE}:FIXTURE",
    },
    _checked,
)
"""All controls by name, in the order of the page."""


def register_control(control: Control, *, replace: bool = False) -> Control:
    """Add a control under its own name until the program ends; see :meth:`Registry.add`."""
    return CONTROLS.add(control.name, control, replace=replace)
