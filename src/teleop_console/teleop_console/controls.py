"""Controls: buttons of the page, by which the person who drives commands the session.

One that is no command of the arm, such as a set of gentle limits, is one file like any other part.
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
"""What became of each thing that was asked: whether it was done, and a line about it."""
_PATIENCE = 3.0  # for an arm that must be at rest first [s]
_PAUSE = 0.2  # until it is asked again [s]


@dataclass(frozen=True)
class Control:
    """A button of the page.

    Attributes:
        name: What stands on it.
        hint: What it does, shown when one points at it.
        act: ``act(link, arm)`` does it for the arm of a name, empty for the default one, and says
            what became of it, as :data:`Answers`. It runs in a thread of its own. The link sends
            commands (``link.command``), sets parameters (``link.change``), and more. If the last
            answer is no, the person who pressed is told.
        folder: ``stylus`` for buttons of the hand's device; empty for the others.
        text: ``text(arm)`` is what is so now, behind the name; None where nothing is shown.
        is_alive: ``is_alive(view)`` is whether it can do anything now; None: always.
    """

    name: str
    hint: str
    act: Callable[[SessionLink, str], Answers]
    folder: str = ""
    text: Callable[[ArmView], str] | None = None
    is_alive: Callable[[View], bool] | None = None


def commands(*words: str) -> Callable[[SessionLink, str], Answers]:
    """Action of a control that sends the arm commands, one after the other.

    Args:
        words: Of :data:`~teleop_core.graph.topics.STATE_COMMANDS`; a reset lets the stop go first.
    """

    def act(link: SessionLink, arm: str) -> Answers:
        if "reset" in words:
            link.press(is_pressed=False)
        return [_insist(link, word, arm) for word in words]

    return act


def _insist(link: SessionLink, word: str, arm: str) -> tuple[bool, str]:
    """Send a command; an arm that is coming to rest is asked again for a while."""
    until = time.monotonic() + _PATIENCE
    while True:
        is_taken, text = link.command(word, arm)
        is_passing = AT_REST_ONLY in text or STILL_PRESSED in text  # a release may be on its way
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
RELEASE = _built_in("Release", "lets the emergency stop go; then Initialize", _release)
MODE = _built_in("mode", "the mode button of the stylus", _pressed("mode"), mode_text)
FIXTURE = _built_in("fixture", "the fixture button of the stylus", _pressed("fixture"), fixture_text)


def _checked(name: str, part: object) -> Control:
    if not isinstance(part, Control):
        raise PartError("control", name, f"a Control, not a {type(part).__name__}")
    for field in ("act", "text", "is_alive"):
        if not (callable(found := getattr(part, field)) or (found is None and field != "act")):
            raise PartError("control", name, f"one whose {field} can be called")
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
    """Add a control under its own name for the rest of the program; see :meth:`Registry.add`."""
    return CONTROLS.add(control.name, control, replace=replace)
