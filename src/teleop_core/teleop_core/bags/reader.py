"""Reading recordings of this package and of other writers, as columns or in the order of their log times."""

import sys
import warnings
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from teleop_core.bags import finding, mcap_source, messages, writer
from teleop_core.bags.recovery import recover
from teleop_core.bags.series import Column, Series, join, kind_of
from teleop_core.base import RecordingError, TeleopWarning, printable
from teleop_core.graph.topics import Kind, Topic


class _Message(NamedTuple):
    log_ns: int
    place: int  # file offset of the chunk or records that contain the message
    channel: int
    begin: int
    end: int
    records: mcap_source.Records


_log_time = itemgetter(0)
_order = itemgetter(0, 1)


def in_order(source: mcap_source.McapSource, channels: frozenset[int]) -> Iterator[tuple[int, int, bytes]]:
    """Channel, log time [ns] and CDR bytes of messages in log-time order; equal log times in the order of the file.

    Chunks may overlap in time, so a message is held back until no later chunk can contain an earlier message.
    """
    places = sorted(
        (p for p in source.contents.places if p.channels is None or p.channels & channels),
        key=lambda place: place.start_ns,
    )
    starts = chain((place.start_ns for place in places[1:]), [sys.maxsize])
    waiting: list[_Message] = []
    tables = source.records(places, window=sys.maxsize)
    for place, records, next_start in zip(places, tables, starts, strict=False):
        waiting += _messages(place.offset, records, channels)
        waiting.sort(key=_order)
        ready = bisect_left(waiting, next_start, key=_log_time)
        for message in waiting[:ready]:
            data = message.records.data[message.begin : message.end].tobytes()
            yield message.channel, message.log_ns, data
        del waiting[:ready]


def _messages(place: int, records: mcap_source.Records, channels: frozenset[int]) -> Iterator[_Message]:
    own = np.flatnonzero(np.isin(records.channel, list(channels)))
    ends = (records.begin + records.size)[own]
    columns = (records.log_ns[own], records.channel[own], records.begin[own], ends)
    for log_ns, channel, begin, end in zip(*(c.tolist() for c in columns), strict=True):
        yield _Message(log_ns, place, channel, begin, end, records)


__all__ = ["Bag", "Series", "TopicInfo", "recover"]

_LATEST_NS = 2**62
"""First invalid log time [ns], in the year 2116. Differences of earlier log times fit into 64 bits."""


@dataclass(frozen=True)
class TopicInfo:
    """Message type of a topic, and its number of messages."""

    type: str
    count: int


def _name(topic: Topic | str) -> str:
    return topic.name if isinstance(topic, Topic) else printable(topic.removeprefix("/"))


def _begin_ns(source: mcap_source.McapSource) -> int:
    """First log time of a file [ns]; needed because an index may list files in another order than that of time."""
    return min((place.start_ns for place in source.contents.places), default=0)


class Bag:
    """A recording, opened for reading.

    Topics are named as in :mod:`teleop_core.graph.topics`, without the leading slash.

    Args:
        path: Directory of a recording, or one ``.mcap`` file.

    Attributes:
        topics: Type and count of each topic, by its name.
        metadata: Names and texts that this package's writer stored; empty for recordings of other writers.
        is_ros1: Whether the messages are messages of ROS 1, which can only be imported.
        start_ns: First log time, [ns].
        end_ns: Last log time, [ns].

    Raises:
        RecordingError: The path does not exist or is no recording, or the recording was cut off or is empty.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        # For each file, the channels of each topic. Several publishers of a topic may have made several channels.
        self._numbers: dict[mcap_source.McapSource, dict[str, list[int]]] = {
            source: {} for source in sorted(map(mcap_source.McapSource, finding.mcap_files(self.path)), key=_begin_ns)
        }
        counts: Counter[str] = Counter()
        types: dict[str, str] = {}
        self.metadata: dict[str, str] = {}
        self.is_ros1 = False
        for source, numbers in self._numbers.items():
            found = source.contents
            for number, channel in found.channels.items():
                name = _name(channel.topic)
                numbers.setdefault(name, []).append(number)
                counts[name] += found.counts[number]
                schema = found.schemas.get(channel.schema_id)
                types[name] = printable(schema.name) if schema else ""
                self.is_ros1 |= channel.message_encoding == "ros1"
            for record in found.metadata:
                if record.name == writer.METADATA_NAME:
                    self.metadata |= {n: printable(text) for n, text in record.metadata.items()}
        self.topics = {name: TopicInfo(types[name], counts[name]) for name in types}
        places = [place for source in self._numbers for place in source.contents.places]
        if not counts.total() or not places:
            raise RecordingError(self.path, "holds no messages; record it again")
        self.start_ns = min(place.start_ns for place in places)
        self.end_ns = max(place.end_ns for place in places)
        if self.start_ns < 0 or self.end_ns >= _LATEST_NS:
            reason = "is damaged: the log times of its messages are in another century"
            raise RecordingError(self.path, reason)

    def require(self, topics: Iterable[Topic | str]) -> None:
        """Make sure that each topic has at least one message.

        Raises:
            RecordingError: A topic is missing or empty. The message lists the missing and the existing topics.
        """
        missing = []
        for topic in topics:
            info = self.topics.get(_name(topic))
            if info is None or not info.count:
                missing.append(_name(topic))
            elif isinstance(topic, Topic) and info.type != topic.kind.ros_type:
                missing.append(f"{topic.name} as {topic.kind.ros_type}, not {info.type}")
        if missing:
            present = ", ".join(sorted(n for n, info in self.topics.items() if info.count))
            raise RecordingError(self.path, f"lacks {', '.join(missing)}; it has {present}")

    # -- columns ---------------------------------------------------------------------------------

    def read(self, topic: Topic | str, joint_names: tuple[str, ...] | None = None) -> Series:
        """All messages of one topic; see :meth:`read_many`."""
        return self.read_many([topic], joint_names)[_name(topic)]

    def read_many(self, topics: Iterable[Topic | str], joint_names: tuple[str, ...] | None = None) -> dict[str, Series]:
        """All messages of some topics, in one pass over the file.

        Args:
            topics: Streams; reports are read with :meth:`reports`.
            joint_names: Wanted order of the joints; None for the order in the recording.

        Returns:
            Series of each topic, by its name.

        Raises:
            RecordingError: A topic is missing or cannot be read as numbers, or the file is damaged.
        """
        columns = self._columns(topics, joint_names)
        parts: dict[str, list[Series]] = {name: [] for name in columns}
        for block in self._blocks(columns):
            for name, series in block.items():
                parts[name].append(series)
        return {name: join(parts.pop(name), column) for name, column in columns.items()}

    def blocks(
        self, topics: Iterable[Topic | str], joint_names: tuple[str, ...] | None = None
    ) -> Iterator[dict[str, Series]]:
        """Messages of some topics chunk by chunk, so that memory use does not grow; see :meth:`read_many`.

        Chunks are returned in the order of the file. Topics without messages in a chunk are left out of its result.
        """
        yield from self._blocks(self._columns(topics, joint_names))

    def _columns(self, topics: Iterable[Topic | str], joint_names: tuple[str, ...] | None) -> dict[str, Column]:
        wanted = list(topics)
        self.require(wanted)
        columns = {}
        for name in map(_name, wanted):
            kind = kind_of(name, self.topics[name].type)
            if kind is None or kind is Kind.REPORT:
                reason = f"{name} contains {self.topics[name].type}, which cannot be read as numbers"
                raise RecordingError(self.path, reason)
            wanted_names = joint_names if joint_names and kind.has_joints else ()
            columns[name] = Column(name, kind, wanted_names)
        return columns

    def _blocks(self, columns: dict[str, Column]) -> Iterator[dict[str, Series]]:
        for source, records in self._records(columns):
            block = {}
            for name, column in columns.items():
                numbers = self._numbers[source].get(name, [])
                is_own = records.channel == numbers[0] if numbers else np.False_
                for number in numbers[1:]:  # np.isin would cost as much as reading
                    is_own = is_own | (records.channel == number)
                own = np.flatnonzero(is_own)
                if not len(own):
                    continue
                try:
                    block[name] = column.read(records.data, records.begin[own], records.size[own], records.log_ns[own])
                except ValueError as error:
                    raise RecordingError(self.path, f"{name} {error}") from error
            yield block
        for column in columns.values():
            if column.total and column.left_out.total() == column.total:
                raise RecordingError(self.path, f"has no readable messages: {column.notes()[0]}")
            for note in column.notes():
                warnings.warn(f"{self.path.name}: {note}", TeleopWarning, stacklevel=4)

    def _records(self, names: Iterable[str]) -> Iterator[tuple[mcap_source.McapSource, mcap_source.Records]]:
        for source, channels in self._numbers.items():
            numbers = {number for name in names for number in channels.get(name, [])}
            places = [place for place in source.contents.places if place.channels is None or place.channels & numbers]
            for records in source.records(places):
                yield source, records

    # -- single messages -------------------------------------------------------------------------

    def reports(self, topic: Topic | str) -> list[messages.Report]:
        """All reports of a topic.

        Raises:
            RecordingError: The topic is missing or does not contain reports.
        """
        self.require([topic])
        out: list[messages.Report] = []
        left_out = 0
        for _, _, _, data in self.raw([topic]):
            try:
                out += messages.read_reports(data)
            except ValueError:
                left_out += 1
        if left_out:
            note = f"{_name(topic)}: {left_out} messages, each {messages.Refusal.MALFORMED.value}"
            if not out:
                raise RecordingError(self.path, f"has no readable messages: {note}")
            warnings.warn(f"{self.path.name}: left out of {note}", TeleopWarning, stacklevel=2)
        return out

    def stored(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """Log time [ns] and bytes of a topic's messages in the order in which they are stored."""
        for source, records in self._records([topic]):
            own = np.flatnonzero(np.isin(records.channel, self._numbers[source].get(topic, [])))
            begins, sizes, logs = (c[own].tolist() for c in (records.begin, records.size, records.log_ns))
            for begin, size, log_ns in zip(begins, sizes, logs, strict=True):
                yield log_ns, records.data[begin : begin + size].tobytes()

    def raw(self, topics: Iterable[Topic | str] | None = None) -> Iterator[tuple[str, str, int, bytes]]:
        """Topic name, ROS type, log time [ns] and CDR bytes of messages in log-time order.

        Args:
            topics: Topics; None for all.
        """
        wanted = list(self.topics) if topics is None else [_name(topic) for topic in topics]
        self.require(wanted if topics is not None else ())
        for source, channels in self._numbers.items():
            names = {number: name for name in wanted for number in channels.get(name, [])}
            for number, log_ns, data in in_order(source, frozenset(names)):
                name = names[number]
                yield name, self.topics[name].type, log_ns, data
