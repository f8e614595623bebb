"""Timeline: a strip at the bottom of the page that shows events over time and the time of the scene.

The answers of the timeline are small: each contains no more data than the pixels can show. All pages may see it, but
only a page that drives may change the time. A live session continues while the past is shown. So the scene shows the
past only while a page repeatedly requests it.
"""

import http
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from teleop_console.curves import bands, thinned
from teleop_console.drivers import Drivers
from teleop_console.link import SessionLink, View
from teleop_console.past import ERROR, Past, Views
from teleop_console.recorded import RecordedLink
from teleop_console.recorded_past import Recorded
from teleop_console.recordings import Recordings
from teleop_console.start import Body, Query, Told
from teleop_core.bags.reader import Bag
from teleop_core.base.errors import ParameterError, TeleopError
from teleop_core.graph.topics import TELEOP_STATE

CURVES = 6
"""Largest number of columns that are drawn together."""
PIXELS = 4000
"""Largest width of the strip [px]."""
FOUND = 40
"""Largest number of columns that a search returns."""
HELD = 2.5
"""Time after which a live scene returns to the present, unless a page requests the past again [s]."""
_LONGEST = 200  # largest number of characters of a word
_ALIGNMENTS = ("start", "following")


class Timeline:
    """Timeline of one session.

    Args:
        link: The session.
        clock: Monotonic time [s].
    """

    def __init__(self, link: SessionLink, clock: Callable[[], float] = time.monotonic) -> None:
        self._link, self._clock = link, clock
        self._past: Past
        self._replay, self._seen = None, None
        if isinstance(link, RecordedLink):
            self._replay, self._past = link, link.past
        else:
            self._seen = self._past = Views(link.arms)
        self._over: Recorded | None = None
        self._over_name, self._align = "", _ALIGNMENTS[0]
        self._wanted = (0.0, -math.inf)  # requested time [s], and clock time until which the request is valid [s]

    # -- for the page's own drawing ----------------------------------------------------------------

    def shown(self, view: View, *, is_stopped: bool = False) -> View:
        """Add the present view; returns the view that the scene must show, which is the present one or a past one."""
        if self._seen is None:
            return view
        self._seen.add(view)
        if is_stopped:  # a person who stops an arm must see the present
            self._wanted = (0.0, -math.inf)
        time, until = self._wanted
        return self._seen.view(time) if self._clock() < until else view

    @property
    def is_past(self) -> bool:
        """Whether the scene of a live session shows the past."""
        return self._clock() < self._wanted[1]

    # -- requests ----------------------------------------------------------------------------------

    def state(self, words: Mapping[str, str]) -> object:
        """The shown time.

        With ``find`` the answer also contains the columns whose name or unit contains all words of the search.
        """
        link, seen = self._replay, self._seen
        begin, end = seen.span() if seen is not None else (0.0, link.duration if link else 0.0)
        told = {
            "begin": begin,
            "end": end,
            "is_live": link is None,
            "time": link.time if link else self._wanted[0] if self.is_past else end,
            "is_past": link is not None or self.is_past,
            "is_playing": link.is_playing if link else not self.is_past,
            "speed": link.speed if link else 1.0,
            "loop": bool(link and link.loop),
            "title": self._link.title,
            "first": [name for name in tuple(self._past.columns) if name.endswith(ERROR)][:1],
            "over": self._over_name,
            "align": self._align,
        }
        if "find" in words:
            asked = words["find"].lower().split()
            units = ((name, column.unit) for name, column in tuple(self._past.columns.items()))
            found = [[name, unit] for name, unit in units if all(word in f"{name} [{unit}]".lower() for word in asked)]
            told["found"], told["count"] = found[:FOUND], len(found)
            told["others"] = self._others()
        return told

    def strip(self, words: Mapping[str, str], names: Sequence[str]) -> object:
        """Bands, ticks and curves between ``begin`` and ``end`` [s], for a strip of ``pixels`` pixels."""
        begin, end = _number(words, "begin"), _number(words, "end")
        pixels = _number(words, "pixels")
        if not begin < end:
            raise ParameterError("end", end, f"later than begin, which is {begin:g}")
        if not 1.0 <= pixels <= PIXELS:
            raise ParameterError("pixels", pixels, f"1 to {PIXELS}")
        if len(names) > CURVES:
            raise ParameterError("name", len(names), f"at most {CURVES} columns")
        shift = self._shift()
        rows, ticks = bands(self._past, begin, end)
        curves = [self._curve(name, begin, end, int(pixels), shift) for name in dict.fromkeys(names)]
        waits = shift is None or any(self._past.rows(topic) is None for topic in self._states(self._past))
        return {"begin": begin, "end": end, "bands": rows, "ticks": ticks, "curves": curves, "waits": waits}

    def _curve(self, name: str, begin: float, end: float, pixels: int, shift: float | None) -> object:
        if name not in self._past.columns:
            raise ParameterError("name", name, "a column of this session; /timeline?find= lists all columns")
        column, samples = self._past.columns[name], self._past.samples(name)
        told: dict[str, object] = {"name": name, "unit": column.unit, "is_held": column.is_held}
        told["waits"] = samples is None
        if samples is not None:
            told |= thinned(samples, begin, end, pixels, is_held=column.is_held)
        if self._over is not None and shift is not None and name in self._over.columns:
            other = self._over.samples(name)
            told["waits"] = told["waits"] or other is None
            if other is not None:
                moved = other[0] - shift, other[1]
                told["over"] = thinned(moved, begin, end, pixels, is_held=column.is_held)
        return told

    def go(self, words: Mapping[str, str]) -> object:
        """Change the shown time by words: ``seek`` [s], ``now``, ``play`` or ``loop`` (1 or 0), ``speed``."""
        link, asked = self._replay, {name: _number(words, name) for name in words}
        if unknown := asked.keys() - {"seek", "now", "play", "loop", "speed"}:
            raise ParameterError("word", min(unknown), "one of seek, now, play, loop, speed")
        if link is None:
            if "seek" in asked:
                self._wanted = (asked["seek"], self._clock() + HELD)
            elif asked.get("now"):
                self._wanted = (0.0, -math.inf)
            return self.state({})
        if "speed" in asked:
            link.speed = asked["speed"]
        if "loop" in asked:
            link.loop = bool(asked["loop"])
        if "seek" in asked:
            link.seek(asked["seek"])
        if "play" in asked:
            (link.play if asked["play"] else link.pause)()
        return self.state({})

    def lay(self, words: Mapping[str, str]) -> object:
        """Overlay the curves of the recording ``name``.

        An empty name removes them. ``align`` sets the alignment in time.
        """
        if (align := words.get("align", self._align)) not in _ALIGNMENTS:
            raise ParameterError("align", align, f"one of {', '.join(_ALIGNMENTS)}")
        name, folder = words.get("name", self._over_name), self._folder
        if name != self._over_name:
            if name and (folder is None or name not in self._others()):
                raise ParameterError("name", name, "a recording beside this one")
            self._over = Recorded(Bag(folder / name)) if name and folder is not None else None
        self._over_name, self._align = name, align
        return self.state({})

    @property
    def _folder(self) -> Path | None:
        return self._replay.recording.parent if self._replay else None

    def _others(self) -> list[str]:
        """Other recordings in the folder of the replayed one."""
        if self._folder is None:
            return []
        return [entry.name for entry in Recordings(self._folder).entries() if entry.name != self._link.title]

    def _shift(self) -> float | None:
        """Time of the overlaid recording at time 0 of the shown one [s].

        None while the overlaid one is still being read.
        """
        if self._over is None or self._align == _ALIGNMENTS[0]:
            return 0.0
        found = [_following(past) for past in (self._past, self._over)]
        if found[0] is None or found[1] is None:
            return None
        return found[1] - found[0]

    @staticmethod
    def _states(past: Past) -> list[str]:
        return [
            name
            for name in {column.topic for column in tuple(past.columns.values())}
            if name.endswith(TELEOP_STATE.name)
        ]


def _following(past: Past) -> float | None:
    """Time at which an arm first followed the hand [s]; 0 if none did, None while the recording is still being read."""
    first = math.inf
    for name in tuple(past.columns):
        if not name.endswith(f"{TELEOP_STATE.name} is_following"):
            continue
        if (samples := past.samples(name)) is None:
            return None
        begun = samples[0][samples[1] > 0.0]
        first = min(first, float(begun[0])) if len(begun) else first
    return first if math.isfinite(first) else 0.0


def _number(words: Mapping[str, str], name: str) -> float:
    """Return a word as a finite number.

    Raises:
        ParameterError: The word is missing, or is not a finite number.
    """
    try:
        value = float(words.get(name, ""))
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or abs(value) > 1e9:
        raise ParameterError(name, words.get(name), "a number")
    return value


class StripPage:
    """Answers the requests of a page's strip; methods may be called from any thread.

    Args:
        drivers: Object that knows which page may change the shown time.

    Attributes:
        shown: Timeline of the shown session or recording; None while none is shown.
    """

    paths = frozenset({"/timeline", "/strip", "/time", "/over"})
    """Paths of the strip's requests."""

    def __init__(self, drivers: Drivers) -> None:
        self.shown: Timeline | None = None
        self._drivers = drivers

    def answer(self, path: str, query: Query, page: int, body: Body = bytes) -> Told:
        """Answer to a request.

        Args:
            path: One of :attr:`paths`.
            query: Query parameters of the request; except for ``name``, only the first value of a parameter counts.
            page: Number of the page that sent the request.
            body: Not used.
        """
        del body
        shown, names = self.shown, query.get("name", ())
        if shown is None:
            return http.HTTPStatus.OK, {}
        words = {name: values[0] for name, values in query.items() if values}
        if any(len(text) > _LONGEST for text in (*words.values(), *names)):
            return http.HTTPStatus.CONFLICT, f"a word has at most {_LONGEST} characters"
        is_look = path in {"/timeline", "/strip"}
        if not is_look and not self._drivers.may_drive(page):
            return http.HTTPStatus.CONFLICT, "You watch. Take control first."
        try:
            if path == "/strip":
                return http.HTTPStatus.OK, shown.strip(words, names)
            act = {"/timeline": shown.state, "/time": shown.go, "/over": shown.lay}[path]
            return http.HTTPStatus.OK, act(words)
        except (TeleopError, OSError) as error:
            return http.HTTPStatus.CONFLICT, str(error)
