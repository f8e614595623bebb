"""Node ``recorder``: every message of the graph as it came, in an MCAP recording."""

import sys
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from teleop_core.bags.arms import NAMESPACE_KEY
from teleop_core.bags.recording import RECORDER, RecordingParameters
from teleop_core.bags.writer import BagWriter
from teleop_core.errors import RecordingError
from teleop_core.graph import RECORDER_NAME, Graph
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.files import graph_of, session_of
from teleop_core.nodes.streams import Subscription
from teleop_core.parameters import build, parameter, specs, values_of
from teleop_core.session.configuration import Configuration
from teleop_core.session.layers import SESSION, parse_text
from teleop_core.session.runner import describe
from teleop_core.stage import Stage
from teleop_core.topics import DIAGNOSTICS, Quality, Topic

DEPTH = 2000
"""Messages of one topic that wait while the disk or another process is slow: two seconds."""
HOLD_NS = 100_000_000
"""Longest time for which messages wait before they go to the disk [ns]: what a loss of power or the
end of the process costs is this time and that of writing one chunk, together below 0.2 s."""
_PAUSE = 5e-3
Arrival = tuple[int, Topic, bytes, int]
"""Time of arrival [ns], topic, bytes, time of sending [ns]."""


@dataclass(frozen=True, kw_only=True)
class RecorderParameters(RecordingParameters):
    """Parameters of the recorder as a node."""

    out: str = parameter("", fixed=True, doc="directory to make; empty: bags/ and the time")
    configuration: str = parameter(
        "", fixed=True, doc="parameter file of the session, as text, kept with the recording"
    )
    scenario: str = parameter("", fixed=True, doc="name of the session, kept with the recording")


class _Channel:
    """One recorded topic: what came and what the middleware lost on the way."""

    def __init__(self, node: CoreNode, topic: Topic) -> None:
        self.topic, self._node = topic, node
        self.received = self.lost = self._number = 0
        self.publishers = 0 if topic is DIAGNOSTICS else 1
        self._given: deque[Arrival] = deque()
        self._subscription: Subscription | None = None
        self._inside_ns: int | None = None
        self._follow()

    def join(self, is_inside: bool) -> None:
        """Take messages from :meth:`give`, from a sender in this process, or from the topic."""
        if is_inside is (self._inside_ns is None):
            self._inside_ns = time.time_ns() if is_inside else None

    def give(self, data: bytes, sent_ns: int) -> None:
        """Take a message from a sender in this process, whose thread may be another one.

        It came when it was given to the next stage, before it was published.
        """
        self._given.append((sent_ns, self.topic, data, sent_ns))

    def drain(self, came: list[Arrival]) -> None:
        """Append what has come since the last call."""
        while self._given:
            came.append(self._given.popleft())
            self.received += 1
        inside_ns = self._inside_ns
        while self._subscription is not None and (taken := self._subscription.take()) is not None:
            data, about = taken
            if inside_ns is None or about["source_timestamp"] < inside_ns:
                self.count(about["publication_sequence_number"])
                arrival_ns = about["received_timestamp"]
                came.append((arrival_ns, self.topic, data, about["source_timestamp"]))
        self._follow()

    def _follow(self) -> None:
        """Listen to the topic or not, in the thread that takes from it."""
        if self._inside_ns is not None:
            self.close()
        elif self._subscription is None:
            depth = 10 if self.topic.quality is Quality.LATCHED else DEPTH
            self._subscription, self._number = (
                Subscription(self._node, self.topic, f"/{self.topic.name}", depth),
                0,
            )

    def close(self) -> None:
        """Stop listening to the topic."""
        if self._subscription is not None:
            self._subscription.close()
            self._subscription = None

    def count(self, number: int) -> None:
        """Note a message by its number in its publisher's sequence; a smaller one starts anew.

        The middleware does not say which publisher a message comes from, so that losses are
        counted while there is one.
        """
        self.received += 1
        if self._number and number > self._number and self.publishers == 1:
            self.lost += number - self._number - 1
        self._number = number


class RecorderNode(CoreNode):
    """Takes what has come, some hundred times a second, and hands it to the writer unread."""

    def __init__(self, stage: Stage = RECORDER, graph: Graph | None = None, **options: Any) -> None:
        super().__init__(stage, RecorderParameters, **options)
        self.channels: dict[str, _Channel] = {}
        self._graph = graph
        self.patience = 10.0  # a slow disk is no reason to end a session
        self.stages: dict[str, Any] = {}
        """Parameters of the stages of the process, by their names in the graph."""

    def setup(self, parameters: RecorderParameters) -> None:
        """Make the recording's directory."""
        configuration = self._configuration(parameters)
        graph = self._graph or (
            configuration.graph if parameters.configuration else graph_of(sys.argv)
        )
        name = parameters.out or time.strftime("bags/live_%Y%m%d_%H%M%S")
        topics = (*(topic.of_arm(self.arm) for topic in graph.topics), DIAGNOSTICS)
        self._writer = BagWriter(
            Path(name), topics, {}, parameters=parameters, metadata=self._about(configuration),
            start_ns=time.time_ns(), hold_ns=HOLD_NS,
        )  # fmt: skip
        self.stage, self._is_broken = self._writer, False
        every = parameters.every_nth(topics)
        self._recorded = [topic for topic in topics if every[topic.name]]

    def _configuration(self, parameters: RecorderParameters) -> Configuration:
        """Configuration of the session: as given, as its stages have it, or the defaults."""
        if self._graph is not None and not parameters.configuration:
            own = {spec.name for spec in specs(RecordingParameters)}
            values = {k: v for k, v in values_of(parameters).items() if k in own}
            recording = build(RecordingParameters, values)
            groups = {SESSION: session_of(sys.argv), **self.stages, RECORDER_NAME: recording}
            return Configuration(groups, parameters.scenario, self._graph)
        layer = parse_text(parameters.configuration, "recorder.configuration")
        return Configuration.from_layers([layer], parameters.scenario)

    def _about(self, configuration: Configuration) -> dict[str, str]:
        """What is kept with the recording, and below which namespace all arms are."""
        about = describe(configuration)
        return about | {NAMESPACE_KEY: self.arm} if self.arm else about

    def start(self) -> None:
        """Open the topics; latched ones send what they have."""
        self.channels = {topic.name: _Channel(self, topic) for topic in self._recorded}

    def turn(self) -> None:
        """Record what has come."""
        time.sleep(_PAUSE)
        self._drain()
        self.counts.ticks += 1

    def stop(self) -> None:
        """Record what came last, and close the topics."""
        try:
            if not self._is_broken:
                self._drain()
        finally:
            for channel in self.channels.values():
                channel.close()

    def teardown(self) -> None:
        """Finish the recording."""
        if not self._is_broken:
            try:
                self._writer.close()
            except RecordingError:
                self.exit_code = self.exit_code or 1  # the log says why
                raise

    def abandon(self) -> None:
        """Close the recording where an orderly end has become impossible, in any thread."""
        if self._loop is not None:
            self._loop.stop()
        if self.stage is not None:
            if self.is_at_work and not self._is_broken:
                self._drain()
            self._writer.close()

    def news(self, word: str) -> str:
        """Where it records."""
        return f"{word}: records to {self._writer.path}" if word == "at work" else word

    def _drain(self) -> None:
        came: list[Arrival] = []
        for channel in self.channels.values():
            channel.drain(came)
        came.sort(key=lambda message: message[0])
        try:
            for received_ns, topic, data, sent_ns in came:
                self._writer.write(topic, received_ns, data, sent_ns)
            self._writer.flush_older(time.time_ns())
        except RecordingError:
            self._is_broken = True  # said once; what is safe has been closed
            self.exit_code = self.exit_code or 1
            raise

    def concerns(self) -> list[str]:
        """Topics of which messages were lost before they came here."""
        for channel in self.channels.values():
            is_shared = channel.topic is DIAGNOSTICS
            channel.publishers = 0 if is_shared else self.count_publishers(f"/{channel.topic.name}")
        lost = sum(channel.lost for channel in self.channels.values())
        return [f"the middleware lost {lost} messages on the way here"] if lost else []

    def values(self) -> dict[str, str]:
        """What came, what was lost, and where it is recorded."""
        values = {"out": str(self._writer.path)}
        for channel in self.channels.values():
            values[f"received.{channel.topic.name}"] = str(channel.received)
            values[f"lost.{channel.topic.name}"] = str(channel.lost)
        return values
