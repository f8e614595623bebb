"""Windows: divides a recording into windows of some seconds with all topics; each has context on both sides.

Samples of different topics may belong together although they are in different chunks. A window contains its own
interval of log time and one second of context on both sides, so that partners are found across its ends. A span is the
scored part, by default the whole recording: only samples that were recorded within the span count. Their partners may
be before the span: the command in force at its begin and the last values of teleop/state remain valid.
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
        series: Series by topic name, sorted by log time. They contain at least the last sample before the window, if
            there is one. Topics without samples are left out.
        history: Values of teleop/state over time.
        lag: Number of setpoints between a measured pose and the setpoint with which it was sampled.
    """

    after_ns: int
    until_ns: int
    series: dict[str, Series]
    history: StateHistory = NO_HISTORY
    lag: int = 0
    _known: dict[object, object] = field(default_factory=dict, repr=False)

    def samples(self, topic: Topic) -> Series:
        """Samples of a topic inside the window; empty if the recording has no such topic."""
        return self.around(topic)[self.own(topic)]

    def around(self, topic: Topic) -> Series:
        """Samples of a topic with the context; :meth:`own` returns which of them are inside the window."""
        series = self.series.get(topic.name)
        return empty(topic.width(0)) if series is None else series

    def states(self, topic: Topic) -> States:
        """State in force at the stamp of each of a topic's samples inside of the window."""
        return self._once(("states", topic.name), lambda: self.history.at(self.samples(topic).stamp_ns))

    def once(self, compute: Callable[["Window"], Found]) -> Found:
        """Result of a function of this window; computed once, when the first metric requests it."""
        return self._once(compute, lambda: compute(self))

    def _once(self, name: object, compute: Callable[[], Found]) -> Found:
        if name not in self._known:
            self._known[name] = compute()
        return cast(Found, self._known[name])

    def own(self, topic: Topic | str) -> slice:
        """Slice of the samples of a topic that are inside the window; the other samples are context."""
        series = self.series.get(topic if isinstance(topic, str) else topic.name)
        if series is None:
            return slice(0, 0)
        first, last = np.searchsorted(series.log_ns, (self.after_ns, self.until_ns), side="right")
        return slice(int(first), int(last))


class DisorderError(Exception):
    """Samples in the file are so far out of order that the context of a window is too short."""


def whole(
    bag: Bag, topics: Iterable[Topic | str], history: StateHistory = NO_HISTORY, lag: int = 0
) -> Iterator[Window]:
    """The whole recording as one window, for any order of samples in its file."""
    yield Window(-_FOREVER, _FOREVER, bag.read_many(topics), history, lag)


def windows(
    bag: Bag, topics: Iterable[Topic | str], history: StateHistory = NO_HISTORY, lag: int = 0
) -> Iterator[Window]:
    """Windows of a recording in the order of time; the memory use does not grow with the recording's length.

    Raises:
        DisorderError: A sample belongs to a window that was already yielded; :func:`whole` can read such a file.
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
    """All samples so far, each topic sorted by log time."""
    parts = {name: [series] for name, series in pending.items()}
    for block in waiting:
        for name, series in block.items():
            parts.setdefault(name, []).append(series)
    return {name: in_order(stretches) for name, stretches in parts.items()}


def _since(series: Series, until_ns: int) -> Series:
    """Samples that the next window needs: the context before it, and always the last sample."""
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
        """Windows of this span. Samples outside of the span are context only; windows beyond the span are left out."""
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
    """Span of a recording; None, for the whole recording, if ``seconds`` is None.

    Args:
        bag: The recording.
        seconds: Begin and end [s] since the first message; an end after the last message is reduced to the time of
            that message.

    Raises:
        ParameterError: The span is empty, is not a number, or begins after the recording ends.
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
