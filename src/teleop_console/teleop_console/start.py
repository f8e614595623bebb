"""Start page: a form to choose, begin and end a session, and to replay and score recordings.

The form is our own. It can send only the few requests of this module, whose words are checked here. A separate thread
answers these requests, so they do not delay the stop.
"""

import http
import queue
import re
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Protocol

from teleop_console.drivers import Drivers
from teleop_console.folders import BAGS, ROBOTS
from teleop_console.recordings import Recordings
from teleop_core.base.errors import ParameterError, TeleopError
from teleop_core.base.texts import printable

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}\.urdf")
_LARGEST = 4 * 1024 * 1024  # largest number of bytes of a robot's file
_TRY = 0.25  # time for which options are checked before the page is answered [s]
_LOOK = 0.2  # time between two checks for new verdicts [s]
Query = Mapping[str, Sequence[str]]
Body = Callable[[int], bytes]
Told = tuple[http.HTTPStatus, object]
"""Status of an answer, and its content for JSON."""


@dataclass(frozen=True)
class Wish:
    """Next action that a person at the page requests.

    Attributes:
        chosen: Words of a session, see :mod:`~teleop_console.choices`.
        recording: Recording to replay; None for a session.
    """

    chosen: Mapping[str, str] = field(default_factory=dict)
    recording: Path | None = None


class Form(Protocol):
    """The form that covers the page while no session runs, and its requests."""

    @property
    def script(self) -> Path:
        """Script of the form."""

    @property
    def style(self) -> Path | None:
        """Style sheet of this form, in addition to the common one; None for none."""

    @property
    def documents(self) -> Mapping[str, bytes]:
        """Further pages of the form, by path."""

    @property
    def paths(self) -> frozenset[str]:
        """Paths of the addresses to which the form sends its requests."""

    def answer(self, path: str, query: Query, page: int, body: Body = bytes) -> Told:
        """Answer to a request; ``page`` is the number of the page, or -1 if the page is not open."""


class StartPage:
    """Content of the form, and the actions that people requested; methods may be called from any thread.

    Args:
        drivers: Object that knows which page may begin and end a session.
        folder: Folder of the recordings.

    Attributes:
        is_open: Whether the form is shown, because no session runs.
        told: Text for the person at the page: the reason why the last session ended, or the output of a command.
    """

    script, style = Path(__file__).with_name("start.js"), None
    documents: Mapping[str, bytes] = MappingProxyType({})

    def __init__(self, drivers: Drivers, folder: Path = BAGS) -> None:
        self.is_open, self.told = False, ""
        self.recordings = Recordings(folder)
        self._folder, self._drivers = folder, drivers
        self._wishes: queue.SimpleQueue[Wish] = queue.SimpleQueue()
        self._ends = threading.Event()
        self._runs = threading.Lock()
        self._last: Mapping[str, str] | None = None
        self._acts: Mapping[str, Callable[[Query], str]] = {
            "/begin": self._begin,
            "/show": self._show,
            "/run": self._run,
            "/end": self._end,
        }

    @property
    def paths(self) -> frozenset[str]:
        """Paths of the addresses to which the form sends its requests."""
        return frozenset({"/start", "/take", "/robot", *self._acts})

    def wait(self) -> Wish:
        """Show the form until a person at the page makes a request."""
        self._ends.clear()
        self.is_open = True
        try:
            self._shown({})  # compute the first answer, which is the slowest, before any page requests it
            while True:
                try:
                    return self._wishes.get(timeout=_LOOK)
                except queue.Empty:
                    self.recordings.judge()
        finally:
            self.is_open = False
            self.recordings.rest()

    @property
    def is_ended(self) -> bool:
        """Whether the session or replay must end, so that the form is shown again."""
        return self._ends.is_set()

    def answer(self, path: str, query: Query, page: int, body: Body = bytes) -> Told:
        """Answer to a request.

        Args:
            path: One of :attr:`paths`.
            query: Query parameters of the request.
            page: Number of the page that sent the request.
            body: Function that reads the request's body, with at most the given number of bytes. It is called only if
                the page may send a body.
        """
        try:
            if path == "/start":
                return http.HTTPStatus.OK, self._shown(query if self._drivers.may_drive(page) else {})
            if path == "/take":
                self._drivers.take(page)
                return http.HTTPStatus.OK, ""
            if not self._drivers.may_drive(page):
                return http.HTTPStatus.CONFLICT, "You watch. Take control first."
            if path == "/robot":
                return http.HTTPStatus.OK, self._keep(_words(query).get("name", ""), body)
            return http.HTTPStatus.OK, self._acts[path](query)
        except (TeleopError, OSError) as error:
            return http.HTTPStatus.CONFLICT, str(error)

    def _shown(self, query: Query) -> Mapping[str, object]:
        """All data that the form shows for a choice; pages that may not begin a session see the default choice.

        Empty while a session or replay runs, because they are slow to compute.
        """
        from teleop_console import choices

        if not self.is_open:
            return {}
        chosen = choices.checked(_words(query)) or dict(self._last or choices.START)
        until = time.monotonic() + _TRY
        fields = [
            {
                "name": f.name,
                "label": f.label,
                "options": [asdict(option) for option in choices.options(f, chosen, until)],
            }
            for f in choices.FIELDS
        ]
        return {
            "chosen": chosen,
            "fields": fields,
            "tips": choices.tips(chosen),
            "refusal": choices.refusal(chosen, opens=False),
            "command": choices.command_line(chosen),
            "is_repeat": chosen == self._last,
            "recordings": [asdict(entry) for entry in self.recordings.entries()],
            "folder": str(self._folder),
            "told": self.told,
            "is_busy": self._runs.locked(),
        }

    def _begin(self, query: Query) -> str:
        from teleop_console import choices

        self._insist_open()
        chosen = choices.checked(_words(query))
        if reason := choices.refusal(chosen, opens=False) or _unread(choices.refusal(chosen)):
            raise ParameterError("choice", choices.command_line(chosen), f"another choice: {reason}")
        self._last, self.told = chosen, ""
        self._wishes.put(Wish(chosen))
        return ""

    def _show(self, query: Query) -> str:
        self._insist_open()
        self.told = ""
        self._wishes.put(Wish(recording=self.recordings.path(_words(query).get("name", ""))))
        return ""

    def _run(self, query: Query) -> str:
        """Score, compare or export recordings in a thread; the form then shows the result."""
        self._insist_open()
        kind, names = _words(query).get("kind", ""), tuple(query.get("name", ()))
        words = self.recordings.words(kind, names)
        if not self._runs.acquire(blocking=False):
            raise ParameterError("action", kind, "sent after the previous action has ended")
        self.told = "$ teleop " + " ".join(words) + "\n…"
        threading.Thread(target=self._do, args=(kind, names), daemon=True).start()
        return ""

    def _do(self, kind: str, names: Sequence[str]) -> None:
        try:
            said = self.recordings.run(kind, names)
            self.told = self.told.removesuffix("…") + said
        finally:
            self._runs.release()

    def _keep(self, name: str, body: Body) -> str:
        """Save the file of a robot under its name; an existing file is not replaced."""
        self._insist_open()
        if not _NAME.fullmatch(name):
            raise ParameterError("name", name, "letters, digits, '.', '_' and '-', then .urdf")
        data, file = body(_LARGEST), ROBOTS / name
        if ROBOTS.is_symlink() or file.is_symlink():
            raise ParameterError("name", name, f"a name in {ROBOTS} that is no symbolic link")
        if file.exists() and file.read_bytes() != data:
            raise ParameterError("name", name, f"a new name: {file} is another robot")
        ROBOTS.mkdir(exist_ok=True)
        with suppress(FileExistsError), file.open("xb") as new:  # "x" does not follow a link that is made meanwhile
            new.write(data)
        return str(file)

    def _end(self, query: Query) -> str:
        del query
        self._ends.set()
        return ""

    def _insist_open(self) -> None:
        if not self.is_open:
            raise ParameterError("session", "one that runs", "ended before another session begins")


def _unread(reason: str) -> str:
    """Text for the page about a file that is not the console's own; only the terminal shows what the file contains."""
    if not reason:
        return ""
    print(f"the choice was refused: {printable(reason)}", flush=True)
    return "a file of this choice cannot be used; the terminal of the console says why"


def _words(query: Query) -> dict[str, str]:
    """First value of each query parameter."""
    return {name: values[0] for name, values in query.items() if values}
