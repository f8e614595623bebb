"""Node ``frames``: robots, frames and markers of a running session, for RViz and Foxglove.

It reads the copies of streams that all nodes send for displays, and only while there are subscribers. A recording
contains the frames of its own samples.
"""

import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from teleop_core.bags.recording import FRAMES, RecordingParameters
from teleop_core.bags.transforms import TF
from teleop_core.base.errors import TeleopError
from teleop_core.base.parameters import build, fixed, specs, values_of
from teleop_core.graph.graph import RECORDER_NAME, Graph
from teleop_core.graph.layers import SESSION, parse_text
from teleop_core.graph.stage import Stage
from teleop_core.graph.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_JS, Kind, Topic
from teleop_core.kernels.axes import axis_map
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.display import PERIOD_NS, DisplayedStream
from teleop_core.nodes.files import session_of
from teleop_core.nodes.markers import LiveMarkers, absolute
from teleop_core.nodes.newest import Newest
from teleop_core.nodes.streams import Subscription
from teleop_core.session.configuration import Configuration
from teleop_core.session.model import DrawnArm, Model

_NOWHERE = np.zeros(7)


class LiveModel:
    """Frames of the robots of a running session.

    The robot's description is sent with the first joint positions that match the robot. A robot other than the
    configured one is thus not drawn as that one.

    Args:
        model: Model that is drawn.

    Attributes:
        topics: Topics of the model.
        read: Topics from which it is drawn.
    """

    def __init__(self, model: Model) -> None:
        self.topics = model.topics
        self._arms, self._period_ns, self._slot = model.arms, model.period_ns, -1
        self._described: set[str] = set()
        self.read = [topic for arm in self._arms for topic in (_joints(arm), _stylus(arm))]

    @property
    def is_new(self) -> bool:
        """Whether a robot is not described yet."""
        return len(self._described) < len(self._arms)

    def forget(self) -> None:
        """Send the robots' descriptions again, for example at the beginning of a recording."""
        self._described.clear()

    def messages(self, newest: Newest) -> list[tuple[Topic, bytes, int]]:
        """Messages that are due, each as topic, bytes, and time of arrival [ns] of the newest drawn sample."""
        latest_ns = max(map(newest.received_ns, self.read), default=0)
        if not latest_ns or latest_ns // self._period_ns == self._slot:
            return []
        self._slot = latest_ns // self._period_ns
        due = [message for arm in self._arms for message in self._due(arm, newest)]
        return [(topic, data, latest_ns) for topic, data in due]

    def _due(self, arm: DrawnArm, newest: Newest) -> list[tuple[Topic, bytes]]:
        joints = newest.values(_joints(arm), arm.robot.joint_names)
        if joints is None:
            return []
        stylus = newest.values(_stylus(arm))
        stamp_ns, row = joints
        place = _NOWHERE if stylus is None else stylus[1]
        (data,) = arm.transforms(np.array([stamp_ns]), row[None, : arm.robot.n], place[None])
        if arm.arm in self._described:
            return [(TF, data)]
        self._described.add(arm.arm)
        return [(arm.description, arm.urdf()), (TF, data)]


class SessionNode(CoreNode):
    """Node beside the stages of a session, which knows the configuration of the whole session.

    Args:
        stage: Stage of the node.
        group: Parameters of the node, with the text of a parameter file as ``configuration``.
        graph: Graph of the session; None: the graph of the parameter files.
    """

    def __init__(self, stage: Stage, group: type, graph: Graph | None = None, **options: Any) -> None:
        super().__init__(stage, group, **options)
        self.graph = graph
        self.stages: dict[str, Any] = {}
        """Parameters of the recorder and of the stages of the process, by their names in the graph."""

    def configuration(self) -> Configuration:
        """Configuration of the session: the one in the parameters, the one of the stages, or the defaults."""
        text, scenario = self.parameters.configuration, getattr(self.parameters, "scenario", "")
        if self.graph is None or text:
            return Configuration.from_layers([parse_text(text, f"{self.description.name}.configuration")], scenario)
        own = {spec.name for spec in specs(RecordingParameters)}
        given = values_of(self.stages[RECORDER_NAME]) if RECORDER_NAME in self.stages else {}
        recording = build(RecordingParameters, {k: v for k, v in given.items() if k in own})
        defaults: dict[str, Any] = {member.name: build(member.stage.parameters, {}) for member in self.graph.members}
        groups = {**defaults, **self.stages, SESSION: session_of(sys.argv), RECORDER_NAME: recording}
        return Configuration(groups, scenario, self.graph)

    def model_of(self, configuration: Configuration, rate: float | None = None) -> LiveModel:
        """Model of the session's robots, as of :class:`Model`; it has no frames if a robot is not installed."""
        try:
            return LiveModel(Model(configuration, rate, self.arm))
        except TeleopError as error:
            self.ros.get_logger().warning(f"no model of the robot: {error}")
            return LiveModel(Model(configuration, 0.0))


@dataclass(frozen=True, kw_only=True)
class FramesParameters:
    """Parameters of the node of frames."""

    configuration: str = fixed("", doc="text of the session's parameter file")


class FramesNode(SessionNode):
    """Publishes robots, frames and markers some ten times a second, while there are subscribers."""

    def __init__(self, stage: Stage = FRAMES, graph: Graph | None = None, **options: Any) -> None:
        super().__init__(stage, FramesParameters, graph, **options)
        self._streams: list[tuple[Topic, DisplayedStream | Subscription]] = []

    def setup(self, parameters: FramesParameters) -> None:
        """Load the robots and open the topics to publish."""
        configuration = self.configuration()
        self._model, self._newest, self._markers = self.model_of(configuration), Newest(), list[LiveMarkers]()
        self._publishers: dict[str, Any] = {}
        for topic in self._model.topics:
            with suppress(ImportError, AttributeError):  # tf2_msgs is part of ROS, and not on PyPI
                self._publishers[topic.name] = self.open_publisher(absolute(topic))
        for name in configuration.graph.namespaces:
            axes = configuration.value("axes", name)
            turn = None if axes is None else axis_map("axes", axes)
            self._markers.append(LiveMarkers(self, "/".join(filter(None, (self.arm, name))), turn))
        self.stage = self._model

    def due(self) -> Sequence[int]:
        """Wait for the next copies."""
        self.platform.sleep(PERIOD_NS * 1e-9)
        return (self.platform.monotonic_ns(),)

    def step(self, tick_ns: int) -> None:
        """Publish what is due. The robots are described even without subscribers, once their joints are known."""
        self.counts.ticks += 1
        shared = self._publishers.get(TF.name)
        is_watched = shared is not None and shared.get_subscription_count() > 0
        if not (is_watched or self._model.is_new or any(markers.is_watched for markers in self._markers)):
            self.stop()
            return
        if not self._streams:
            read = dict.fromkeys([*self._model.read, *(topic for one in self._markers for topic in one.read)])
            self._streams = [(topic, self._opened(topic)) for topic in read]
        for topic, stream in self._streams:
            if (taken := stream.take()) is not None:
                self._newest.take([(taken.came_ns, topic, taken.data, taken.sent_ns)])
        for topic, data, _ in self._model.messages(self._newest):
            if topic.name in self._publishers and (topic is not TF or is_watched):
                self._publishers[topic.name].publish(data)
        for markers in self._markers:
            markers.show(self._newest)

    def _opened(self, topic: Topic) -> DisplayedStream | Subscription:
        if topic.kind is Kind.REPORT:
            return Subscription(self, topic, f"/{topic.name}")
        return DisplayedStream(self, topic)

    def stop(self) -> None:
        """Close the topics that are read."""
        for _, stream in self._streams:
            stream.close()
        self._streams = []


def _joints(arm: DrawnArm) -> Topic:
    return SLAVE_MEASURED_JS.of_arm(arm.arm)


def _stylus(arm: DrawnArm) -> Topic:
    return MASTER_MEASURED_CP.of_arm(arm.arm)
