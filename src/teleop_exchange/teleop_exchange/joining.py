"""Joining: combines the streams of a recording to rows over time, in successive time intervals."""

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from teleop_core.bags import memory, reader
from teleop_core.bags.series import Series, kind_of
from teleop_core.base.errors import TeleopWarning, UnknownNameError
from teleop_core.evaluation.windows import CONTEXT_NS, whole, windows
from teleop_core.graph.topics import BY_NAME, Kind
from teleop_core.kernels.geometry import Array
from teleop_core.session.recording import Recording, Stream
from teleop_core.session.replayed_span import LONGEST_GAP_NS
from teleop_exchange.times import SECOND_NS, Stamps


@dataclass(frozen=True, eq=False)
class Joined:
    """Rows of some topics.

    Attributes:
        time_ns: Times of recording (n,) [ns], rising.
        values: Columns of each topic (n, width); NaN in rows without a message of the topic.
    """

    time_ns: Stamps
    values: dict[str, Array]


class Streams:
    """Some topics of a recording, whose messages are combined to rows.

    Args:
        recording: Recording that contains the topics.
        topics: Names of the topics; empty for all topics with numbers.

    Attributes:
        columns: Names of the columns by topic.
        start_ns: Start time of the recording [ns].

    Raises:
        UnknownNameError: A topic does not exist.
        RecordingError: A topic cannot be read as numbers.
    """

    def __init__(self, recording: Recording, topics: Iterable[str] = ()) -> None:
        self._recording, self._bag = recording, recording.bag
        wanted = [name.removeprefix("/") for name in topics] or numeric(recording)
        if unknown := [name for name in wanted if name not in recording.topics]:
            raise UnknownNameError("topic", unknown[0], recording.topics)
        self._reports = {name: recording[name] for name in wanted if is_report(self._bag, name)}
        self._names = [name for name in wanted if name not in self._reports]
        first = self._first()
        self.columns = {name: self._reports[name].columns if name in self._reports else first[name] for name in wanted}
        self.start_ns = self._bag.start_ns

    def _first(self) -> dict[str, tuple[str, ...]]:
        """Columns of the streams, determined from the first messages of each stream."""
        found: dict[str, tuple[str, ...]] = {}
        for block in self._bag.blocks(self._names) if self._names else ():
            for name, series in block.items():
                if name not in found:
                    found[name] = columns_of(self._bag, name, series)
            if len(found) == len(self._names):
                break
        return found

    def joined(self) -> Iterator[Joined]:
        """Yield one row for each time at which a stream has a message.

        Reports keep their values until the next report.
        """
        for piece in self._pieces():
            logs = [series.log_ns for series in piece.values()]
            times: Stamps = np.unique(np.concatenate(logs))
            values = {name: self._spread(name, times, piece) for name in self.columns}
            yield Joined(times, values)

    def _spread(self, name: str, times: Stamps, piece: Mapping[str, Series]) -> Array:
        if name in self._reports:
            return self._held_report(name, times)
        rows = np.full((len(times), len(self.columns[name])), np.nan)
        if name in piece:  # if times are equal, the last message is used
            rows[np.searchsorted(times, piece[name].log_ns)] = piece[name].values
        return rows

    def _held_report(self, name: str, times: Stamps) -> Array:
        stream = self._reports[name]
        return newest(times, stream.log_ns, stream.values)

    def sampled(self, rate: float) -> Iterator[Joined]:
        """Yield rows at a rate [Hz] from the start of the recording, each with the newest message of every topic.

        A gap of more than :data:`LONGEST_GAP_NS` without any message has no rows.
        """
        step, before = SECOND_NS / rate, np.array([self.start_ns])
        last: dict[str, Series] = {}
        number = 0
        for piece in self._pieces():
            logs = np.unique(np.concatenate([series.log_ns for series in piece.values()]))
            numbers = _numbers(np.append(before, logs) - self.start_ns, step, number)
            times = self.start_ns + np.rint(numbers * step).astype(np.int64)
            number = max(number, int((int(logs[-1]) - self.start_ns) // step) + 1)
            before = logs[-1:]
            values = {}
            for name in self.columns:
                if name in self._reports:
                    values[name] = self._held_report(name, times)
                    continue
                known = [s for s in (last.get(name), piece.get(name)) if s is not None]
                values[name] = self._newest(name, times, known)
                if known:
                    last[name] = known[-1][-1:]
            if len(times):
                yield Joined(times, values)

    def _newest(self, name: str, times: Stamps, known: list[Series]) -> Array:
        if not known:
            return np.full((len(times), len(self.columns[name])), np.nan)
        logs = np.concatenate([series.log_ns for series in known])
        return newest(times, logs, np.concatenate([series.values for series in known]))

    def _pieces(self) -> Iterator[dict[str, Series]]:
        """Yield successive time intervals, each with the streams that have messages in this interval."""
        if not self._names:
            yield {name: _series(stream) for name, stream in self._reports.items()}
            return
        read = windows if self._is_in_order() else whole
        for window in read(self._bag, self._names):
            piece = {name: series[window.own(name)] for name, series in window.series.items()}
            if piece := {name: series for name, series in piece.items() if len(series)}:
                yield piece

    def _is_in_order(self) -> bool:
        """Whether each chunk of the file begins after the end of the previous chunk, or shortly before this end."""
        newest = -(2**62)
        for block in () if isinstance(self._bag, memory.MemoryBag) else self._bag.blocks(self._names):
            logs = [series.log_ns for series in block.values() if len(series)]
            if logs and min(int(log.min()) for log in logs) <= newest - CONTEXT_NS:
                return False
            newest = max([newest, *(int(log.max()) for log in logs)])
        return not isinstance(self._bag, memory.MemoryBag)


def _numbers(since_ns: Stamps, step: float, first: int) -> Stamps:
    """Numbers of the rows from ``first`` to the last message, without rows in a gap.

    Args:
        since_ns: Times of all messages since row 0 (N,), rising [ns].
        step: Time between two rows [ns].
        first: Smallest number of a row.
    """
    ends = np.flatnonzero(np.diff(since_ns.astype(np.float64)) > LONGEST_GAP_NS)
    if not len(ends):
        return np.arange(first, int(since_ns[-1] // step) + 1)
    warnings.warn(
        f"no rows where no message came for more than {LONGEST_GAP_NS / SECOND_NS:g} s", TeleopWarning, stacklevel=4
    )
    low = np.ceil(since_ns[np.append(0, ends + 1)] / step).astype(np.int64)
    high = np.floor(since_ns[np.append(ends, len(since_ns) - 1)] / step).astype(np.int64) + 1
    low = np.maximum(low, first)
    counts = np.maximum(high - low, 0)
    offsets = np.cumsum(counts) - counts
    return np.repeat(low - offsets, counts) + np.arange(counts.sum())


def numeric(recording: Recording) -> list[str]:
    """Topics of a recording that can be read as numbers, in the order of the recording."""
    found = []
    for name in recording.topics:
        kind = kind_of(name, recording.bag.topics[name].type)
        if kind is not None and (kind is not Kind.REPORT or has_columns(name)):
            found.append(name)
    return found


def has_columns(name: str) -> bool:
    """Whether a report has columns of numbers."""
    columns = [topic.columns for n, topic in BY_NAME.items() if name == n or name.endswith(f"/{n}")]
    return any(columns)


def is_report(bag: reader.Bag, name: str) -> bool:
    """Whether a topic contains reports."""
    return kind_of(name, bag.topics[name].type) is Kind.REPORT


def columns_of(bag: reader.Bag, name: str, series: Series) -> tuple[str, ...]:
    """Names of the columns of a stream in a recording."""
    kind = kind_of(name, bag.topics[name].type)
    assert kind is not None
    if kind.has_joints:
        is_bare = series.values.shape[1] == len(series.names)
        kind = Kind.JOINTS if is_bare else Kind.STATE
    return kind.columns(series.names)


def newest(times: Stamps, logs: Stamps, rows: Array) -> Array:
    """The newest row at each time; NaN before the first row."""
    at = np.searchsorted(logs, times, side="right") - 1
    found = np.full((len(times), rows.shape[1]), np.nan)
    found[at >= 0] = rows[at[at >= 0]]
    return found


def _series(stream: Stream) -> Series:
    return Series(stream.stamp_ns, stream.log_ns, stream.values)
