"""Memory bag: a recording in memory, which can be read and scored like a recording on disk."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from teleop_core.bags import layouts, messages, reader
from teleop_core.bags.reports import Report
from teleop_core.bags.series import Series
from teleop_core.base.errors import RecordingError
from teleop_core.graph.topics import Kind, Topic

Message = tuple[int, bytes]
"""Log time [ns] and CDR bytes."""


class LeftOutError(RecordingError):
    """A caller requests a stream that was not stored in memory."""


class MemoryBag(reader.Bag):
    """Recording that is stored in arrays.

    Args:
        name: Name of the recording in scores.
        series: Streams with their samples, by topic.
        reports: Messages of reports in the order of their log times, by topic.
        metadata: Names and texts, as a writer would store them.
        left_out: Streams of the session that were not stored.

    Raises:
        RecordingError: The recording has no samples.
    """

    def __init__(
        self,
        name: str,
        series: Mapping[Topic, Series],
        reports: Mapping[Topic, list[Message]],
        metadata: Mapping[str, str],
        left_out: Iterable[Topic] = (),
    ) -> None:
        self.path, self.metadata = Path(name), dict(metadata)
        self.streams = dict(series)
        self._series = {topic.name: found for topic, found in series.items()}
        self._reports = {topic.name: found for topic, found in reports.items()}
        counts = {topic: len(found) for topic, found in series.items()}
        counts |= {topic: len(found) for topic, found in reports.items()}
        self._left_out = {topic.name for topic in left_out}
        counts |= dict.fromkeys(left_out, 1)
        self.topics = {t.name: reader.TopicInfo(t.kind.ros_type, n) for t, n in counts.items()}
        logs = [found.log_ns for found in series.values() if len(found)]
        if not logs:
            raise RecordingError(self.path, "holds no messages; record it again")
        self.start_ns = min(int(log[0]) for log in logs)
        self.end_ns = max(int(log[-1]) for log in logs)

    def read_many(self, topics: Iterable[Topic | str], joint_names: tuple[str, ...] | None = None) -> dict[str, Series]:
        """See :meth:`~teleop_core.bags.reader.Bag.read_many`."""
        wanted = [topic.name if isinstance(topic, Topic) else topic.strip("/") for topic in topics]
        self.require(wanted)
        for name in wanted:
            if name in self._left_out:
                raise LeftOutError(self.path, f"{name} was not kept in memory")
            if name not in self._series:
                raise RecordingError(self.path, f"{name} contains reports, which cannot be read as numbers")
        kinds = {topic.name: topic.kind for topic in self.streams}
        return {name: _ordered(self._series[name], joint_names if kinds[name].has_joints else None) for name in wanted}

    def blocks(
        self, topics: Iterable[Topic | str], joint_names: tuple[str, ...] | None = None
    ) -> Iterator[dict[str, Series]]:
        """See :meth:`~teleop_core.bags.reader.Bag.blocks`; all messages are in a single block."""
        yield self.read_many(topics, joint_names)

    def reports(self, topic: Topic | str) -> list[Report]:
        """See :meth:`~teleop_core.bags.reader.Bag.reports`."""
        self.require([topic])
        name = topic.name if isinstance(topic, Topic) else topic.strip("/")
        return [one for _, data in self._reports.get(name, ()) for one in messages.read_reports(data)]

    def raw(self, topics: Iterable[Topic | str] | None = None) -> Iterator[tuple[str, str, int, bytes]]:
        """See :meth:`~teleop_core.bags.reader.Bag.raw`; the bytes are made when they are requested."""
        given = self.topics if topics is None else topics
        names = [topic.name if isinstance(topic, Topic) else topic.strip("/") for topic in given]
        self.require(names if topics is not None else ())
        yield from sorted(self._messages(names), key=lambda message: message[2])

    def _messages(self, names: Iterable[str]) -> Iterator[tuple[str, str, int, bytes]]:
        by_name = {topic.name: topic for topic in self.streams}
        for name in names:
            for log_ns, data in self._reports.get(name, ()):
                yield name, Kind.REPORT.ros_type, log_ns, data
            if (topic := by_name.get(name)) is not None:
                series = self._series[name]
                form = layouts.layout(topic, series.names)
                for i in range(len(series)):
                    data = form.encode_one(int(series.stamp_ns[i]), series.values[i])
                    yield name, topic.kind.ros_type, int(series.log_ns[i]), data


def _ordered(series: Series, joint_names: tuple[str, ...] | None) -> Series:
    if not joint_names or joint_names == series.names or not series.names:
        return series
    parts = series.values.shape[1] // len(series.names)
    at = [series.names.index(name) for name in joint_names]
    columns = [part * len(series.names) + joint for part in range(parts) for joint in at]
    values = np.ascontiguousarray(series.values[:, columns])
    return Series(series.stamp_ns, series.log_ns, values, joint_names, series.frame_id)
