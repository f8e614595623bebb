"""Node ``recorder``: records every message of the graph, as received, in MCAP files."""

import sys
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

from teleop_core.bags.arms import NAMESPACE_KEY
from teleop_core.bags.recording import MARKS, RECORDER, RecordingParameters
from teleop_core.bags.reports import report
from teleop_core.bags.writer import BagWriter
from teleop_core.base.errors import RecordingError, SessionError
from teleop_core.base.parameters import fixed, parameter
from teleop_core.graph.graph import Graph
from teleop_core.graph.stage import Stage
from teleop_core.graph.topics import DIAGNOSTICS, Quality, Topic
from teleop_core.middleware.platform import TransitionResult
from teleop_core.nodes.feed import FeedReader
from teleop_core.nodes.files import graph_of
from teleop_core.nodes.frames import SessionNode
from teleop_core.nodes.newest import Arrival, Newest
from teleop_core.nodes.recorder_services import serve
from teleop_core.nodes.streams import Subscription
from teleop_core.session.configuration import Configuration
from teleop_core.session.runner import describe

DEPTH = 2000
"""Queue length of a topic while the disk or another process is slow [messages]: two seconds."""
HOLD_NS = 100_000_000
"""Longest time for which messages are collected before they are written [ns]. A loss of power or the end of the
process loses the messages of this time plus the time of writing one chunk, together below 0.2 s."""
DISCOVERY_NS = 3_000_000_000
"""Time within which two existing nodes discover each other [ns]; most nodes need a tenth of this time."""
_PAUSE = 5e-3
_RECENT = 1000
"""Number of messages of a topic that may come by the middleware before the topic's feed announces itself."""


@dataclass(frozen=True, kw_only=True)
class RecorderParameters(RecordingParameters):
    """Parameters of the recorder as a node."""

    out: str = fixed("", doc="directory of the new recording; empty: a directory in bags/ named after the current time")
    configuration: str = fixed("", doc="text of the session's parameter file; it is stored in the recording")
    scenario: str = fixed("", doc="name of the session; it is stored in the recording")
    mark: str = parameter("", doc="text of the next marks; empty: each mark gets its number as text")


class _Channel:
    """One recorded topic, with counts of received messages and of messages that the middleware lost."""

    def __init__(self, node: SessionNode, topic: Topic) -> None:
        self.topic, self._node, self._platform = topic, node, node.platform
        self.received = self.lost = 0
        self._numbers: dict[bytes, int] = {}  # last number of each publisher
        self._since_ns = 0  # time since which the topic is read [ns]
        self._given: deque[Arrival] = deque()
        self._subscription: Subscription | None = None
        self._inside_ns: int | None = None
        self._recent: deque[int] = deque(maxlen=_RECENT)  # times of sending of messages that came by the topic
        self._twice = 0  # number of messages of a feed that already came by the topic
        self._follow()

    def join(self, is_inside: bool, since_ns: int | None = None) -> None:
        """Receive messages sent since ``since_ns`` [ns] from :meth:`give` if ``is_inside``, else from the topic.

        Messages that already came by the topic are not recorded twice.
        """
        if is_inside is not (self._inside_ns is None):
            return
        since_ns = since_ns or self._platform.time_ns()
        self._inside_ns = since_ns if is_inside else None
        self._twice = sum(sent_ns >= since_ns for sent_ns in self._recent) if is_inside else 0

    def give(self, data: bytes, sent_ns: int) -> None:
        """Receive a message from a sender in this process, which may be in another thread.

        The time of arrival is the time at which the message was given to the next stage, before it was published.
        """
        self._given.append((sent_ns, self.topic, data, sent_ns))

    def take(self, data: bytes, sent_ns: int, lost: int) -> None:
        """Receive a message of a feed; ``lost`` messages before it were lost."""
        self.lost += lost
        if self._twice:
            self._twice -= 1
            return
        self._given.append((sent_ns, self.topic, data, sent_ns))

    def drain(self, came: list[Arrival]) -> None:
        """Append the messages received since the last call to ``came``."""
        given = self._given
        self.received += (count := len(given))
        came.extend([given.popleft() for _ in range(count)])
        inside_ns = self._inside_ns
        while self._subscription is not None and (taken := self._subscription.take()) is not None:
            if inside_ns is None or taken.sent_ns < inside_ns:
                self.count(taken.sender, taken.number)
                self._recent.append(taken.sent_ns)
                # Messages of a feed arrive when they are sent. A message of the topic that arrives later would be
                # recorded after newer ones.
                came_ns = taken.came_ns if inside_ns is None else min(taken.came_ns, inside_ns)
                came.append((came_ns, self.topic, taken.data, taken.sent_ns))
        self._follow()

    def _follow(self) -> None:
        """Open or close the subscription as needed, in the thread that reads it."""
        if self._inside_ns is not None:
            self.close()
        elif self._subscription is None:
            depth = 10 if self.topic.quality is Quality.LATCHED else DEPTH
            self._numbers.clear()
            self._since_ns = self._platform.monotonic_ns()
            self._subscription = Subscription(self._node, self.topic, f"/{self.topic.name}", depth)

    def close(self) -> None:
        """Stop listening to the topic."""
        if self._subscription is not None:
            self._subscription.close()
            self._subscription = None

    def count(self, sender: bytes, number: int) -> None:
        """Count a message, by its publisher and its number in the publisher's sequence.

        A restarted node sends for 0.1 s, rarely 1 s, before the recorder discovers it. Messages that a late publisher
        sent before its first recorded message therefore count as lost.
        """
        self.received += 1
        if (last := self._numbers.get(sender)) is None:
            last = 0 if self._numbers and self._is_new_there() else number - 1
        self._numbers[sender] = max(last, number)
        self.lost += max(0, number - last - 1)

    def _is_new_there(self) -> bool:
        """Whether an unknown publisher is new, and so cannot have sent before the recorder started."""
        listens_ns = self._platform.monotonic_ns() - self._since_ns
        return self.topic.quality is Quality.STREAM and listens_ns > DISCOVERY_NS


class RecorderNode(SessionNode):
    """Reads the received messages some hundred times a second, and passes their bytes to the writer."""

    def __init__(self, stage: Stage = RECORDER, graph: Graph | None = None, **options: Any) -> None:
        super().__init__(stage, RecorderParameters, graph, **options)
        self.channels: dict[str, _Channel] = {}
        self.patience = 10.0  # a slow disk is no reason to end a session
        self._feeds: FeedReader | None = None
        self._writing = self.platform.lock()  # locked while something is written, or the file changes
        self._is_recording, self._part, self._marks = False, 0, 0
        self._last: dict[Topic, bytes] = {}  # last messages of latched topics, for the next recording
        serve(self, self, self.fail)

    def setup(self, parameters: RecorderParameters) -> None:
        """Make the recording's directory."""
        configuration = self.configuration()
        graph = self.graph or (configuration.graph if parameters.configuration else graph_of(sys.argv))
        self._path = Path(parameters.out or time.strftime("bags/live_%Y%m%d_%H%M%S"))
        topics = (*(topic.of_arm(self.arm) for topic in graph.topics), DIAGNOSTICS, *parameters.others)
        self._model, self._newest = self.model_of(configuration, parameters.tf_rate), Newest()
        every = parameters.every_nth((*topics, *self._model.topics))
        self._recorded = [topic for topic in topics if every[topic.name]]
        self._mark_topic, self._part, self._marks = MARKS.of_arm(self.arm), 0, 0
        self._mark_publisher = self.open_publisher(replace(self._mark_topic, name=f"/{self._mark_topic.name}"))
        self._last.clear()
        self._open = partial(
            BagWriter,
            topics=(*topics, self._mark_topic, *self._model.topics),
            joint_names={},
            parameters=parameters,
            metadata=self._about(configuration),
            hold_ns=HOLD_NS,
            background=self.platform.background,
        )
        self._begin_recording(self._path)
        self._is_broken = False

    def _begin_recording(self, path: Path) -> None:
        """Begin a recording with the last messages of latched topics."""
        now_ns = self.platform.time_ns()
        self._writer = self.stage = self._open(path, start_ns=now_ns)
        self._is_recording = True
        self._model.forget()
        for topic, data in self._last.items():
            self._writer.write(topic, now_ns, data, now_ns)

    def _about(self, configuration: Configuration) -> dict[str, str]:
        """Metadata of the recording, and the namespace of all arms."""
        about = describe(configuration)
        return about | {NAMESPACE_KEY: self.arm} if self.arm else about

    def start(self) -> None:
        """Open the topics; latched topics send their last message."""
        self.channels = {topic.name: _Channel(self, topic) for topic in self._recorded}
        self._feeds = FeedReader(self.channels, self.platform)

    def due(self) -> Sequence[int]:
        """Wait a moment."""
        self.platform.sleep(_PAUSE)
        return (self.platform.monotonic_ns(),)

    def step(self, tick_ns: int) -> None:
        """Record the received messages."""
        with self._writing:
            self._drain()
        self.counts.ticks += 1

    def stop(self) -> None:
        """Record the last received messages, and close the topics."""
        try:
            if not self._is_broken:
                with self._writing:
                    self._drain()
        finally:
            for channel in self.channels.values():
                channel.close()
            if self._feeds is not None:
                self._feeds.close()

    def teardown(self) -> None:
        """Finish the recording."""
        if not self._is_broken:
            try:
                self._writer.close()
            except RecordingError:
                self.exit_code = self.exit_code or 1  # the log contains the reason
                raise

    def abandon(self) -> None:
        """Close the recording when an orderly end is no longer possible. May be called in any thread."""
        if self.loop is not None:
            self.loop.stop()
        if self.stage is not None:
            if self.is_at_work and not self._is_broken:
                self._drain()
            self._writer.close()

    def news(self, word: str) -> str:
        """Log line with the path of the recording."""
        return f"{word}: records to {self._writer.path}" if word == "at work" else word

    def _drain(self) -> None:
        came: list[Arrival] = []
        if self._feeds is not None:
            self._feeds.drain()
        for channel in self.channels.values():
            channel.drain(came)
        came.sort(key=itemgetter(0))
        self._last.update({m[1]: m[2] for m in came if m[1].quality is Quality.LATCHED})
        self._newest.take(came)
        drawn = self._model.messages(self._newest)
        if not self._is_recording:
            return
        try:
            for received_ns, topic, data, sent_ns in came:
                self._writer.write(topic, received_ns, data, sent_ns)
            for topic, data, received_ns in drawn:
                self._writer.write(topic, received_ns, data)
            self._writer.flush_older(self.platform.time_ns())
        except RecordingError:
            self._is_broken = True  # reported once; the written part is closed and safe
            self.exit_code = self.exit_code or 1
            raise

    # -- services --------------------------------------------------------------------------------

    def start_recording(self) -> str:
        """Record again, in a new directory. Raises the errors of :class:`Recorder`."""
        if self.stage is None:
            for transition in ("configure", "activate"):
                if self.ros.trigger(transition) is not TransitionResult.SUCCESS:
                    raise SessionError("did not start; see its log")
            return f"records to {self._writer.path}"
        self._insist(is_recording=False)
        with self._writing:
            self._begin_recording(self._next_path())
        return f"records to {self._writer.path}"

    def stop_recording(self) -> str:
        """Close the recording. Raises the errors of :class:`Recorder`."""
        self._insist(is_recording=True)
        with self._writing:
            self._end_recording()
        return f"stopped; recorded in {self._writer.path}"

    def split_recording(self) -> str:
        """Close the recording and continue in a new directory. Raises the errors of :class:`Recorder`."""
        self._insist(is_recording=True)
        with self._writing:
            closed = self._writer.path
            self._end_recording()
            self._begin_recording(self._next_path())
        return f"{closed} is closed; the recording continues in {self._writer.path}"

    def mark_recording(self) -> str:
        """Record a mark with the current time. Raises the errors of :class:`Recorder`."""
        self._insist(is_recording=True)
        with self._writing:
            self._drain()
            now_ns, self._marks = self.platform.time_ns(), self._marks + 1
            text = self.parameters.mark or str(self._marks)
            data = report(now_ns, self.member_name, 0, text, {"number": str(self._marks)})
            self._writer.write(self._mark_topic, now_ns, data, now_ns)
            self._mark_publisher.publish(data)
        return f"marked {text!r} in {self._writer.path}"

    def _insist(self, *, is_recording: bool) -> None:
        if self.stage is None or not self.is_at_work:
            raise SessionError("is not active, and therefore does not record")
        if self._is_recording is not is_recording:
            text = "records already to" if self._is_recording else "is stopped; the last one is"
            raise SessionError(f"{text} {self._writer.path}")

    def _end_recording(self) -> None:
        self._drain()
        self._is_recording = False
        try:
            self._writer.close()
        except RecordingError:
            self._is_broken = True
            self.exit_code = self.exit_code or 1
            raise

    def _next_path(self) -> Path:
        """Next directory name that does not exist: bag_1, bag_2."""
        while True:
            self._part += 1
            path = self._path.with_name(f"{self._path.name}_{self._part}")
            if not path.exists():
                return path

    # -- diagnostics -----------------------------------------------------------------------------

    def concerns(self) -> list[str]:
        """Texts about topics with messages that were lost before they reached the recorder."""
        lost, cut = sum(channel.lost for channel in self.channels.values()), self._cut
        found = [f"the middleware lost {lost} messages on the way here"] if lost else []
        if cut:
            found.append(f"{cut} processes ended abnormally; messages that they had not sent yet are lost")
        return found

    @property
    def _cut(self) -> int:
        return self._feeds.cut if self._feeds is not None else 0

    def values(self) -> dict[str, str]:
        """Counts of received and lost messages, and the path of the recording."""
        values = {"out": str(self._writer.path), "is_recording": str(int(self._is_recording))}
        values["cut_feeds"] = str(self._cut)
        for channel in self.channels.values():
            values[f"received.{channel.topic.name}"] = str(channel.received)
            values[f"lost.{channel.topic.name}"] = str(channel.lost)
        return values
