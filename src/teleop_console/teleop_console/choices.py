"""Choices: the options of a new session, contradictions between options, and the command line of a choice.

A choice is a word for each of :data:`FIELDS`; an empty word stands for the value of the scenario. The configuration
itself decides whether words contradict each other. So the form offers and refuses parts of your own like all other
parts.

A word may name a file. Before Start, only files of the console's own folders are read
(:func:`~teleop_console.folders.is_own`), and none is evaluated.
"""

import math
import re
import shlex
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from teleop_console.choice_configurations import is_robot_file, made, robot_refusal, stages_of
from teleop_console.folders import is_own
from teleop_core.base.errors import ParameterError, TeleopError, UnknownNameError
from teleop_core.base.parameters import specs
from teleop_core.graph.layers import SESSION, declared_groups, list_scenarios
from teleop_core.hand.operators import OPERATORS
from teleop_core.hand.tasks import TASKS
from teleop_core.robots import ROBOTS
from teleop_core.robots.files.urdf_tree import elements_of, root_of
from teleop_core.session.configuration import Configuration
from teleop_core.slave.controllers import CONTROLLERS
from teleop_core.slave.plants import PLANTS

Chosen = Mapping[str, str]
"""Words by the names of their fields; the word of a missing field is empty."""
PERSON = "remote"
"""Operator that is a person at the page."""
_PERSON = f"operator={PERSON}"
_FOR_EVER = f"{SESSION}.duration=86400.0"
OWN = (_PERSON, _FOR_EVER)
"""Settings of the page's sessions in addition to the scenario: a person is the hand, and the session may last a day."""


@dataclass(frozen=True)
class Field:
    """One option of a new session.

    Attributes:
        name: Name of the field.
        label: Label of the field on the page.
        unsaid: Text that is shown for an empty word.
        key: Parameter that a word sets; empty for the scenario, which is a file.
        options: Words that may be chosen, each with its meaning; any other word may be the name of a file.
        stage: Stage that a word needs; empty if it needs none.
    """

    name: str
    label: str
    unsaid: str
    key: str
    options: Callable[[], Mapping[str, str]]
    stage: str = ""


def _named(names: Iterable[str]) -> Callable[[], Mapping[str, str]]:
    return lambda: dict.fromkeys(names, "")


def _declared(stage: str, name: str) -> Callable[[], Mapping[str, str]]:
    """Allowed values of a parameter, as words."""

    def found() -> Mapping[str, str]:
        spec = next(one for one in specs(declared_groups()[stage]) if one.name == name)
        return dict.fromkeys(spec.choices, "")

    return found


def _operators() -> Mapping[str, str]:
    told = {PERSON: "you, with the mouse on this page", "human": "a simulated person"}
    return {**told, **{name: told.get(name, "") for name in OPERATORS}}


_OF_SCENARIO = "as in the scenario"
FIELDS = (
    Field("scenario", "Scenario", "none: the defaults", "", list_scenarios),
    Field("operator", "Operator", "the scenario's own, simulated", "operator", _operators),
    Field("robot", "Robot", _OF_SCENARIO, "robot", _named(ROBOTS)),
    Field("task", "Task", _OF_SCENARIO, "task.kind", _named(TASKS), "task"),
    Field("network", "Network", _OF_SCENARIO, "network.preset", _declared("network", "preset"), "network"),
    Field(
        "passivity",
        "Passivity",
        _OF_SCENARIO,
        "reflection.passivity",
        _declared("motion_scaling", "reflection.passivity"),
        "passivity",
    ),
    Field("controller", "Control law", _OF_SCENARIO, "controller.kind", _named(CONTROLLERS)),
    Field("plant", "Plant", _OF_SCENARIO, "plant.kind", _named(PLANTS)),
)
"""All fields, in the order of the page."""
FOLLOWED = "followed"
"""Name of a further word: the file that an operator ``bag`` or ``file`` follows."""
TIP = "tip"
"""Name of a further word: the link of a URDF that is the tip."""
_PATHS = {"bag": "operator.bag", "file": "operator.file.path"}  # parameter with the path
START: Chosen = {"operator": PERSON}
"""Choice when the form is opened."""
_LINK = re.compile(r"[\w./:-]*")  # characters of a link's name; others could add a setting
_LONGEST = 500  # largest number of characters of a word
_TASK_TIME = 60.0  # shortest time for which a simulated operator works at a task [s]
_NOTHING = "none"  # word with which a field does not need its stage


def checked(words: Chosen) -> dict[str, str]:
    """Return the words that are not empty, after a check of all words.

    Raises:
        ParameterError: A field is unknown, a word is too long, or the form does not offer it. The robot may be a file.
    """
    known = {field.name: field for field in FIELDS}
    for name, word in words.items():
        if name not in {*known, FOLLOWED, TIP}:
            raise ParameterError("field", name, f"one of {', '.join(sorted((*known, FOLLOWED, TIP)))}")
        if len(word) > _LONGEST or not word.isprintable():
            raise ParameterError(name, word, f"one line of at most {_LONGEST} characters")
        if name == TIP and not _LINK.fullmatch(word):
            raise ParameterError(name, word, "the name of a link: letters, digits and . / : _ -")
        if name in known and not _is_offered(known[name], word):
            raise UnknownNameError(name, word, known[name].options())
    return {name: word for name, word in words.items() if word}


def _is_offered(field: Field, word: str) -> bool:
    return not word or word in field.options() or (field.name == "robot" and is_robot_file(word))


def texts(chosen: Chosen, *, opens: bool = True) -> tuple[str, ...]:
    """Settings ``key=value`` of a choice; they must be applied after the scenario and :data:`OWN`.

    Args:
        chosen: Words of the session.
        opens: Whether any file that a word names may be read, to learn how long the session lasts.

    Raises:
        TeleopError: The scenario is unknown.
    """
    said = _said(chosen)
    if _PERSON in said:
        return tuple(text for text in said if text != _PERSON)
    try:
        found = _made(chosen, opens=opens)
    except TeleopError:
        return said
    known = () if chosen.get("operator") else (f"operator={found.groups['operator'].kind.kind}",)
    duration = found.session.duration
    if chosen.get("task", _NOTHING) != _NOTHING:
        duration = max(duration, _TASK_TIME)
    return (*said, *known, f"{SESSION}.duration={duration!r}")


def _made(chosen: Chosen, *, opens: bool) -> Configuration:
    followed = chosen.get(FOLLOWED, "") if chosen.get("operator", "") in _PATHS else ""
    return made(chosen.get("scenario", ""), _said(chosen), followed, opens=opens)


def _said(chosen: Chosen) -> tuple[str, ...]:
    """Settings of a choice without :data:`OWN`; they are applied after the scenario."""
    said = [f"{f.key}={word}" for f in FIELDS if f.key and (word := chosen.get(f.name))]
    stages = before = stages_of(chosen.get("scenario", ""))
    for field in FIELDS:
        word = chosen.get(field.name, "")
        if field.stage and word not in {"", _NOTHING} and field.stage not in stages:
            stages = (*stages, field.stage)
    if stages != before:
        said.insert(0, f"{SESSION}.stages=[{','.join(stages)}]")
    if (path := _PATHS.get(chosen.get("operator", ""))) and (followed := chosen.get(FOLLOWED)):
        said.append(f"{path}={followed}")
    if is_robot_file(chosen.get("robot", "")) and (tip := chosen.get(TIP)):
        said.append(f"geometry=[tip={tip}]")
    return tuple(said)


def command_line(chosen: Chosen) -> str:
    """Command line that starts the session of a choice."""
    scenario, said = chosen.get("scenario"), texts(chosen, opens=False)
    words = ["teleop", "console", *(("--scenario", scenario) if scenario else ())]
    words += ["--set", *said] if said else [] if scenario else ["--set", _PERSON]
    return shlex.join(words)


def refusal(chosen: Chosen, *, opens: bool = True) -> str:
    """Reason why the session of a choice cannot start; empty if it can.

    Args:
        chosen: Words of the session.
        opens: Whether any file that a word names is read, and a xacro evaluated. If not, the console's own files are
            checked alone.
    """
    key = tuple(sorted((name, word) for name, word in chosen.items() if word))
    has_file = is_robot_file(chosen.get("robot", "")) or bool(chosen.get(FOLLOWED))
    if has_file:  # a file may change
        return _reason(chosen, opens=opens)
    if key not in _REFUSALS:
        if len(_REFUSALS) >= _MOST:
            _REFUSALS.clear()
        _REFUSALS[key] = _reason(chosen, opens=opens)
    return _REFUSALS[key]


def _reason(chosen: Chosen, *, opens: bool) -> str:
    for name in ("robot", FOLLOWED):
        file = Path(chosen.get(name, ""))
        if file.exists() and not file.is_file() and not file.is_dir():  # reading a pipe or a device may never end
            return f"{name} is {str(file)!r}, must be a file or a folder"
    try:
        slave = _made(chosen, opens=opens).groups["slave"]
        return robot_refusal(slave.robot, slave.geometry, opens=opens)
    except (TeleopError, OSError) as error:
        return str(error)


def tips(chosen: Chosen) -> tuple[str, ...]:
    """Links of a URDF without a child link; one of them must be the tip. Empty if no valid URDF was dropped."""
    file = Path(chosen.get("robot", ""))
    with suppress(TeleopError, OSError):
        if file.suffix == ".urdf" and is_own(str(file)):
            root = root_of(file, file.read_bytes())
            parents = {one.get("link") for one in root.findall("joint/parent")}
            return tuple(link for link in elements_of(root, "link") if link not in parents)
    return ()


_REFUSALS: dict[tuple[tuple[str, str], ...], str] = {}
_MOST = 4096  # number of choices whose refusals are cached


@dataclass(frozen=True)
class Option:
    """A word that may be chosen.

    Attributes:
        word: The word.
        text: Its meaning; empty if the word alone is clear.
        reason: Reason why the word may not be chosen now. It is empty if the word may be chosen, and None if this is
            unknown.
    """

    word: str
    text: str
    reason: str | None


def options(field: Field, chosen: Chosen, until: float = math.inf) -> tuple[Option, ...]:
    """All words of a field, each with the reason why it contradicts the other chosen words.

    A reason for which the present choice itself is refused does not count.

    Args:
        field: The field.
        chosen: Words of all fields.
        until: Monotonic time [s] after which no further word is tested; the reasons of the remaining words are unknown.
    """
    now = refusal(chosen, opens=False)
    known = {"": field.unsaid, **field.options()}
    if (own := chosen.get(field.name, "")) not in known:
        known[own] = "a file"
    found = []
    for word, text in known.items():
        reason = None
        if time.monotonic() < until:
            reason = refusal({**chosen, field.name: word}, opens=False)
        found.append(Option(word, text, "" if reason == now else reason))
    return tuple(found)
