"""Windows: a recording as some seconds of all topics at a time, each with what surrounds it.

Samples of different topics belong together although they stand in different chunks. A window holds its own stretch of
log time and a second of context on both sides, so that partners are found across its ends. A span is the stretch that
is scored, all of it unless something else is wanted: samples count that were recorded within it. What they belong to
may lie before it: the command that was in force when the span began, and what teleop/state had said, hold on.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar, cast

import numpy as np

from teleop_core.bags.reader import Bag, Series
from teleop_core.bags.series import empty, in_order
from teleop_core.base.errors import ParameterError
from teleop_core.evaluation.state_history import NO_HISTORY, StateHistory, States
from teleop_core.graph.topics import Topic

CONTEXT_NS = 1_000_000_000
WINDOW_NS = 4_000_000_000
_FOREVER = 2**62
Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class Window:
    """Series of topics around the log times ``after_ns`` < t <= ``until_ns``.

    Attributes:
        series: Per topic name, in the order of log times; at least the sample before the window
            is in it, if there is one. Topics without samples are left out.
        history: What teleop/state said at any time.
        lag: By how many setpoints a measured pose comes after that which it was sampled with.
    """

    after_ns: int
    until_ns: int
    series: dict[str, Series]
    history: StateHistory = NO_HISTORY
    lag: int = 0
    _known: dict[object, object] = field(default_factory=dict, repr=False)

    def samples(self, topic: Topic) -> Series:
        """Samples of a topic inside of the window; none if the recording has no such topic."""
        return self.around(topic)[self.own(topic)]

    def around(self, topic: Topic) -> Series:
        """The same with the context; :meth:`own` says which of them are inside."""
        series = self.series.get(topic.name)
        return empty(topic.width(0)) if series is None else series

    def states(self, topic: Topic) -> States:
        """State in force at the stamp of each of a topic's samples inside of the window."""
        return self._once(("states", topic.name), lambda: self.history.at(self.samples(topic).stamp_ns))

    def once(self, compute: Callable[["Window"], Found]) -> Found:
        """Result of a function of this window; computed once, when the first metric asks."""
        return self._once(compute, lambda: compute(self))

    def _once(self, name: object, compute: Callable[[], Found]) -> Found:
        if name not in self._known:
            self._known[name] = compute()
        return cast(Found, self._known[name])

    def own(self, topic: Topic | str) -> slice:
        """Samples of a topic inside of the window; the rest is context."""
        series = self.series.get(topic if isinstance(topic, str) else topic.name)
        if series is None:
            return slice(0, 0)
        first, last = np.searchsorted(series.log_ns, (self.after_ns, self.until_ns), side="right")
        return slice(int(first), int(last))


class DisorderError(Exception):
    """Samples stand further out of order in the file than the context of a window reaches."""


def whole(
    bag: Bag, topics: Iterable[Topic | str], history: StateHistory = NO_HISTORY, lag: int = 0
) -> Iterator[Window]:
    """The recording as one window, whatever the order in its file."""
    yield Window(-_FOREVER, _FOREVER, bag.read_many(topics), history, lag)


def windows(
    bag: Bag, topics: Iterable[Topic | str], history: StateHistory = NO_HISTORY, lag: int = 0
) -> Iterator[Window]:
    """Windows of a recording in the order of time; memory does not grow with its length.

    Raises:
        DisorderError: A sample belongs to a window that was handed out already; :func:`whole` reads such a file.
    """
    pending: dict[str, Series] = {}
    waiting: list[dict[str, Series]] = []
    after_ns = bag.start_ns - 1
    newest_ns = after_ns
    for block in bag.blocks(topics):
        for series in block.values():
            if series.log_ns.min() <= after_ns:
                raise DisorderError
            newest_ns = max(newest_ns, int(series.log_ns.max()))
        waiting.append(block)
        until_ns = newest_ns - CONTEXT_NS
        if until_ns - after_ns >= WINDOW_NS:
            pending = _joined(pending, waiting)
            yield Window(after_ns, until_ns, pending, history, lag)
            pending = {name: _since(series, until_ns) for name, series in pending.items()}
            waiting, after_ns = [], until_ns
    yield Window(after_ns, _FOREVER, _joined(pending, waiting), history, lag)


def _joined(pending: dict[str, Series], waiting: list[dict[str, Series]]) -> dict[str, Series]:
    """Everything so far, each topic in the order of its log times."""
    parts = {name: [series] for name, series in pending.items()}
    for block in waiting:
        for name, series in block.items():
            parts.setdefault(name, []).append(series)
    return {name: in_order(stretches) for name, stretches in parts.items()}


def _since(series: Series, until_ns: int) -> Series:
    """What the next window needs: the context before it, and the last sample at any rate."""
    logs = series.log_ns
    first = min(
        int(np.searchsorted(logs, until_ns - CONTEXT_NS)),
        max(0, int(np.searchsorted(logs, until_ns, side="right")) - 1),
    )
    kept = slice(first, None)
    return Series(
        series.stamp_ns[kept].copy(), logs[kept].copy(), series.values[kept].copy(), series.names, series.frame_id
    )


class Span(NamedTuple):
    """First and last log time that is scored, [ns]."""

    first_ns: int
    last_ns: int

    def cut(self, windows: Iterable[Window]) -> Iterator[Window]:
        """Windows with what lies outside of the span as context only; those beyond are left out."""
        for window in windows:
            if window.after_ns >= self.last_ns:
                return
            after_ns = max(window.after_ns, self.first_ns - 1)
            until_ns = min(window.until_ns, self.last_ns)
            if until_ns > after_ns:
                yield Window(after_ns, until_ns, window.series, window.history, window.lag)


Seconds = tuple[float, float]
"""Begin and end of a span [s] since the recording began."""


def span_of(bag: Bag, seconds: Seconds | None) -> Span | None:
    """Span of a recording; None for None: all of it.

    Args:
        bag: The recording.
        seconds: Begin and end [s] since its first message; an end beyond it is its last message.

    Raises:
        ParameterError: The span is empty, not finite, or begins after the end.
    """
    if seconds is None:
        return None
    begin, end = (float(value) for value in seconds)
    length = (bag.end_ns - bag.start_ns) * 1e-9
    if math.isnan(begin) or math.isnan(end) or not 0.0 <= begin < min(end, length):
        text = f"two times [s], 0 <= FROM < TO, FROM before the end at {length:.3f} s"
        raise ParameterError("span", (begin, end), text)
    last_ns = bag.end_ns if end >= length else bag.start_ns + round(end * 1e9)
    return Span(bag.start_ns + round(begin * 1e9), last_ns)
