"""Answers: the server's responses that do not come from viser: signs of life, the stop, style and script.

The emergency stop does not use viser. The stop button is our own and visible as soon as the page begins to load. A
press of the button is a separate request, which is answered when the stop has been sent. So the stop works while the
page's connection is lost, flooded or being opened again, and the page knows whether the press was received.
"""

import gzip
import http
import json
import secrets
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Response

from teleop_console.drivers import Drivers
from teleop_console.guard import Request
from teleop_console.look import style
from teleop_console.start import Form, StartPage
from teleop_console.timeline import StripPage

OWN_PAGE = "Teleop-Page"
"""Header of our page's requests; browsers do not allow a page of another origin to send it."""
PRESS = "Teleop-Press"
"""Header with the name of a press. If no answer came, the page repeats the press with the same name."""
_SCRIPTS = tuple(Path(__file__).with_name(name) for name in ("page.js", "strip.js"))
_FIELDS = 100  # largest number of query parameters in an address
_FURNITURE = b'<head><link rel="stylesheet" href="teleop.css"><script src="teleop.js"></script>'


@dataclass(frozen=True)
class Situation:
    """Data that every page shows in addition to viser's elements.

    Attributes:
        can_stop: Whether a stop has any effect; false while a recording is shown.
        is_stopped: Whether an emergency stop is in force.
        text: Text about the last event and the next action; empty if there was no event.
        doing: Text about the progress before a session can be shown; empty while a session is shown.
        chooses: Whether the page shows the form on which a session is chosen.
        can_end: Whether the page can end the session or replay, which returns to the form.
        state: State of all arms in words, for screen readers.
        can_press: Whether a person at the page moves a hand that can press or close. This is so in a task with
            pressing, or if the arm has a jaw.
    """

    can_stop: bool = True
    is_stopped: bool = False
    text: str = ""
    doing: str = ""
    chooses: bool = False
    can_end: bool = False
    can_press: bool = False
    state: str = ""


class Answers:
    """Answers to our own requests, and our additions to viser's page.

    Args:
        drivers: Receives the signs of life of pages.
        form: Form that is shown while no session runs; None for the form that chooses a session.

    Attributes:
        situation: Data that pages show; the shown session or replay writes these data.
        stop: Function that presses the emergency stop; it must not block.
        jaw: Function that closes the hand by a share, 0 to 1; it must not block.
        start: The form on which sessions are chosen.
        strip: The timeline below the scene.
        form: Form that is shown while no session runs.
    """

    def __init__(self, drivers: Drivers, form: Form | None = None) -> None:
        self.situation = Situation()
        self.stop: Callable[[], None] | None = None
        self.jaw: Callable[[float], None] | None = None
        self._drivers = drivers
        self._pages: dict[str, int] = {}  # numbers of pages by random names, which no other page can guess
        self._heard: deque[str | None] = deque(maxlen=100)  # names of the last presses
        self.start, self.strip = StartPage(drivers), StripPage(drivers)
        self.form: Form = form or self.start
        self._paths: dict[str, Callable[[Request], Response]] = {
            "/alive": self._alive,
            "/stop": self._stop,
            "/jaw": self._jaw,
            **dict.fromkeys(self.slow_paths, self._later),
        }
        self._files: dict[str, Callable[[Request], Response]] = {
            "/teleop.js": self._script,
            "/teleop.css": self._style,
            **dict.fromkeys(self.form.documents, self._document),
        }

    def name(self, page: int) -> str:
        """Return a new name with which a page sends its signs of life."""
        name = secrets.token_urlsafe(12)
        self._pages[name] = page
        return name

    def forget(self, page: int) -> None:
        """Delete the name of a page that was closed."""
        self._pages = {name: known for name, known in self._pages.items() if known != page}

    @property
    def paths(self) -> frozenset[str]:
        """Paths of the requests that this object answers."""
        return frozenset({*self._paths, *self._files})

    @property
    def slow_paths(self) -> frozenset[str]:
        """The :attr:`paths` whose answers may take long."""
        return self.form.paths | self.strip.paths

    def to(self, request: Request) -> Response:
        """Answer a request for one of :attr:`paths`; may be called from any thread.

        Files are given to anyone. Every other path is answered only if the request comes from a page of this server.
        """
        path = urlsplit(request.path).path
        if len(request.header(OWN_PAGE)) != 1 and path not in self._files:
            return answer_of(http.HTTPStatus.FORBIDDEN)
        return (self._files.get(path) or self._paths[path])(request)

    def furnish(self, request: Request, response: Response) -> None:
        """Add our style and script to viser's page."""
        if urlsplit(request.path).path not in {"/", "/index.html"}:
            return
        is_packed = response.headers.get("Content-Encoding") == "gzip"
        page = gzip.decompress(response.body) if is_packed else bytes(response.body)
        page = page.replace(b"<head>", _FURNITURE, 1)  # insert before viser's own script, which is long
        page = page.replace(b"<title>Viser</title>", b"<title>Teleoperation console</title>", 1)
        response.body = gzip.compress(page, 1) if is_packed else page
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))

    def _page(self, request: Request) -> int:
        """Number of the page that sent the request; -1 if this page is not open."""
        return self._pages.get(request.header(OWN_PAGE)[0], -1)

    def _alive(self, request: Request) -> Response:
        page = self._page(request)
        self._drivers.heard(page)
        told = {**asdict(self.situation), "drives": self._drivers.may_drive(page)}
        return answer_of(http.HTTPStatus.OK, json.dumps(told).encode(), "application/json")

    def _later(self, request: Request) -> Response:
        address = urlsplit(request.path)
        asked = self.strip if address.path in self.strip.paths else self.form
        query = parse_qs(address.query, keep_blank_values=True, max_num_fields=_FIELDS)
        status, told = asked.answer(address.path, query, self._page(request), request.body)
        return answer_of(status, json.dumps(told).encode(), "application/json")

    def _stop(self, request: Request) -> Response:
        if self.stop is None:
            return answer_of(http.HTTPStatus.CONFLICT)
        press = next(iter(request.header(PRESS)), None)
        if press is None or press not in self._heard:
            self.stop()
            self._heard.append(press)
        return answer_of(http.HTTPStatus.NO_CONTENT)

    def _jaw(self, request: Request) -> Response:
        closed = parse_qs(urlsplit(request.path).query, max_num_fields=_FIELDS).get("closed")
        if not self._drivers.may_drive(self._page(request)):
            return answer_of(http.HTTPStatus.FORBIDDEN)
        if self.jaw is None or closed not in (["0"], ["1"]):
            return answer_of(http.HTTPStatus.CONFLICT)
        self.jaw(float(closed[0]))
        return answer_of(http.HTTPStatus.NO_CONTENT)

    def _script(self, _: Request) -> Response:
        script = b"\n".join(file.read_bytes() for file in (*_SCRIPTS, self.form.script))
        return answer_of(http.HTTPStatus.OK, script, "text/javascript; charset=utf-8")

    def _style(self, _: Request) -> Response:
        return answer_of(http.HTTPStatus.OK, style(self.form.style).encode(), "text/css; charset=utf-8")

    def _document(self, request: Request) -> Response:
        page = self.form.documents[urlsplit(request.path).path]
        return answer_of(http.HTTPStatus.OK, page, "text/html; charset=utf-8")


def answer_of(status: http.HTTPStatus, body: bytes = b"", kind: str = "text/plain") -> Response:
    """A response with its headers."""
    headers = Headers({"Content-Type": kind, "Content-Length": str(len(body))})
    return Response(status.value, status.phrase, headers, body)
