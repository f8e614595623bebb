"""Writing recordings: streams in blocks and single messages become a rosbag2 directory.

A separate thread builds, compresses and writes the messages in the order of the calls, so that the same calls give the
same bytes. The writer copies all data that it is given.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType

import numpy as np

from teleop_core.bags import compression as compressions
from teleop_core.bags import ending, rosbag2
from teleop_core.bags.chunks import Assembly, Messages, Single, Stretch
from teleop_core.bags.layouts import SECOND_NS, Layout, Stamps, Values, layout
from teleop_core.bags.mcap_file import McapFile
from teleop_core.bags.recording import RecordingParameters
from teleop_core.base.background import SYSTEM, Background
from teleop_core.base.errors import ParameterError, RecordingError, ShapeError, UnknownNameError
from teleop_core.graph.topics import Kind, Topic

CHUNK_BYTES = 2 << 20  # approximate size of a chunk [bytes]
QUEUE_LENGTH = 8
"""Seconds of a session that are queued for a slow disk before callers have to wait."""
METADATA_NAME = "teleop_core"
Block = Mapping[Topic, tuple[Stamps, Values, Stamps]]


class _Channel:
    """A topic that may be recorded. ``every`` is 0 if it is not recorded; ``seen`` counts all its messages."""

    __slots__ = ("every", "layout", "number", "recorded", "seen")

    def __init__(self, number: int, every: int, form: Layout | None) -> None:
        self.number, self.every, self.layout = number, every, form
        self.seen = self.recorded = 0

    def is_turn(self) -> bool:
        """Count the next sample and return whether it is recorded."""
        self.seen += 1
        return self.every > 0 and (self.seen - 1) % self.every == 0


class BagWriter:
    """Recorder of one session, a context manager for ``with``.

    Args:
        path: Directory to create.
        topics: Topics that may be written; topics that the parameters deselect are ignored.
        joint_names: Joints of the robot, in the order of the columns. For several arms: the joints of each arm, by its
            namespace.
        parameters: Recorded topics, their rates and the compression.
        compression: Replaces ``parameters.compression``.
        metadata: Names and texts stored with the recording, such as configuration and seed.
        start_ns: Log time at which the session starts, [ns].
        hold_ns: Longest log time for which single messages are collected before they are written, [ns]. A value below
            one second means a live recording: written data are synced to the disk at once. The end of the process or a
            loss of power then loses only the collected messages.
        background: Thread, queue and disk of the writer.

    Raises:
        RecordingError: The path exists already or cannot be written.
    """

    def __init__(
        self,
        path: Path | str,
        topics: Iterable[Topic],
        joint_names: tuple[str, ...] | Mapping[str, tuple[str, ...]],
        *,
        parameters: RecordingParameters | None = None,
        compression: str | None = None,
        metadata: Mapping[str, str] | None = None,
        start_ns: int = 0,
        hold_ns: int = SECOND_NS,
        background: Background = SYSTEM,
    ) -> None:
        self.path, self._start_ns, self._hold_ns = Path(path), start_ns, hold_ns
        self.parameters = parameters or RecordingParameters()
        if compression is not None:
            self.parameters = replace(self.parameters, compression=compression)
        declared = list(topics)
        named = joint_names if isinstance(joint_names, Mapping) else {"": joint_names}
        every = self.parameters.every_nth(declared)
        self._topics = [topic for topic in declared if every[topic.name]]
        numbers = {topic.name: i for i, topic in enumerate(self._topics, start=1)}
        self._channels = {
            topic.name: _Channel(
                numbers.get(topic.name, 0),
                every[topic.name],
                None if topic.kind is Kind.REPORT else layout(topic, named.get(topic.arm, ())),
            )
            for topic in declared
        }
        self._singles: list[Single] = []
        self._bytes, self._first_ns = 0, 0
        self._failure: BaseException | None = None
        self._is_open = True
        self._mcap = self._create({METADATA_NAME: dict(metadata or {})}, background)
        self._jobs = background.queue(QUEUE_LENGTH * max(1, SECOND_NS // hold_ns))
        self._worker = background.thread("bag writer", self._work)
        self._worker.start()

    def _create(self, metadata: dict[str, dict[str, str]], background: Background) -> McapFile:
        name = self.parameters.compression
        compress = compressions.compressor(name, self.parameters.compression_level)
        schemas, channels = rosbag2.records_of(self._topics)
        with rosbag2.new_directory(self.path) as file:
            return McapFile(file, schemas, channels, metadata, "" if name == "none" else name, compress, background)

    # -- what callers do -------------------------------------------------------------------------

    @property
    def counts(self) -> dict[str, int]:
        """Number of messages given for recording so far, per recorded topic, after decimation."""
        return {topic.name: self._channels[topic.name].recorded for topic in self._topics}

    def write(self, topic: Topic, log_ns: int, data: bytes, publish_ns: int | None = None) -> None:
        """Record one message.

        Args:
            topic: Topic of the message.
            log_ns: Time at which the message was received, [ns].
            data: CDR bytes of the message.
            publish_ns: Time at which the message was sent, [ns]; None if unknown.

        Raises:
            RecordingError: Writing has failed, now or earlier.
            UnknownNameError: The topic was not announced.
        """
        channel = self._channels.get(topic.name) or self._unknown(topic)
        if channel.every != 1 and not channel.is_turn():
            return
        if publish_ns is None:
            publish_ns = log_ns
        if not self._singles:
            self._first_ns = log_ns
        self._singles.append((channel.number, channel.recorded, log_ns, publish_ns, data))
        channel.recorded += 1
        self._bytes += len(data)
        if self._bytes > CHUNK_BYTES or abs(log_ns - self._first_ns) >= self._hold_ns:
            self.flush()

    def write_block(self, block: Block) -> None:
        """Record a block of samples of streams; a block of about one second is best.

        Args:
            block: For each topic: stamps [ns], shape (N,); values, shape (N, width); and log times [ns], shape (N,),
                which must not decrease. N may differ between topics.

        Raises:
            RecordingError: Writing has failed, now or earlier.
            ParameterError: Log times are negative or decrease, or the topic carries reports.
            ShapeError: Arrays of a topic do not fit each other or the topic.
            UnknownNameError: A topic was not announced.
        """
        stretches = []
        for topic, (stamp_ns, values, log_ns) in block.items():
            channel = self._channels.get(topic.name) or self._unknown(topic)
            stretch = _stretch(topic, channel, stamp_ns, values, log_ns)
            channel.seen += len(values)
            channel.recorded += len(stretch.log_ns)
            if len(stretch.log_ns):
                stretches.append(stretch)
        self._hand_over(stretches)

    def flush(self) -> None:
        """Pass collected single messages to the writing thread.

        Raises:
            RecordingError: Writing has failed, now or earlier.
        """
        self._hand_over([])

    def flush_older(self, now_ns: int) -> None:
        """Pass collected single messages to the writing thread if the first of them is older than ``hold_ns``.

        Args:
            now_ns: Current log time, [ns]. A clock that was set back does not make messages wait longer.

        Raises:
            RecordingError: Writing has failed, now or earlier.
        """
        if self._singles and abs(now_ns - self._first_ns) >= self._hold_ns:
            self.flush()

    def close(self) -> None:
        """Write the remaining messages and finish the recording; further calls do nothing.

        Raises:
            RecordingError: Writing has failed, now or earlier.
        """
        if not self._is_open:
            return
        self._is_open = False
        if self._singles and self._failure is None:
            self._jobs.put(([], self._singles))
        self._jobs.put(None)
        self._worker.join()
        self._raise_failure()

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None and error is self._failure:
            self._failure = None  # the failure is already being raised
        self.close()

    # -- between the threads ---------------------------------------------------------------------

    def _unknown(self, topic: Topic) -> _Channel:
        raise UnknownNameError("topic", topic.name, self._channels)

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _hand_over(self, stretches: list[Stretch]) -> None:
        self._raise_failure()
        if not self._is_open:
            raise RecordingError(self.path, "is closed; nothing more can be recorded")
        if stretches or self._singles:
            self._jobs.put((stretches, self._singles))
            self._singles, self._bytes = [], 0

    # -- the writing thread ----------------------------------------------------------------------

    def _work(self) -> None:
        jobs: Iterator[Messages] = iter(self._jobs.get, None)
        assembly = Assembly(CHUNK_BYTES)
        stopped: OSError | None = None
        try:
            for stretches, singles in jobs:
                for chunk in assembly.chunks(stretches, singles):
                    self._mcap.append(chunk)
                if self._hold_ns < SECOND_NS and self._jobs.empty():
                    self._mcap.sync()
        except OSError as error:
            stopped = error
        except BaseException as error:  # a bug in this package: the written part stays readable
            self._failure = error
        try:
            given = sum(self.counts.values())
            told = ending.end(self.path, self._mcap, self._start_ns, stopped, given)
            self._failure = self._failure or told
        finally:
            self._mcap.close()
        for _ in jobs:  # empty the queue, so that callers do not block
            pass


def _stretch(topic: Topic, channel: _Channel, stamp_ns: Stamps, values: Values, log_ns: Stamps) -> Stretch:
    """Copy of the samples that are recorded."""
    form = channel.layout
    if form is None:
        raise ParameterError("topic of a block", topic.name, "a stream; write() takes reports")
    if values.shape != (len(log_ns), form.width) or stamp_ns.shape != log_ns.shape:
        raise ShapeError(f"values of {topic.name}", (len(log_ns), form.width), values.shape)
    if len(log_ns) and (log_ns[0] < 0 or (log_ns[1:] < log_ns[:-1]).any()):
        raise ParameterError(f"log times of {topic.name}", log_ns, "not negative, not decreasing")
    part = slice(-channel.seen % channel.every, None, channel.every) if channel.every else slice(0)
    return Stretch(
        channel.number,
        channel.recorded,
        form,
        np.array(stamp_ns[part], np.int64),
        np.array(values[part], np.float64),
        np.array(log_ns[part], np.int64),
    )
