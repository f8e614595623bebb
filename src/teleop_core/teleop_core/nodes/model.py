"""Live model: the robots' frames while a session runs, for its recording and for other tools."""

from dataclasses import replace
from typing import Any

import numpy as np

from teleop_core.bags.transforms import TF
from teleop_core.graph.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_JS, Topic
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.newest import Newest
from teleop_core.session.model import DrawnArm, Model

_NOWHERE = np.zeros(7)


class LiveModel:
    """Frames of the robots of a running session.

    The robot's description is sent with the first joint positions that match the robot. If the recorder records the
    session of another robot, that robot is thus not drawn as this one.

    Args:
        model: Model that is drawn.
    """

    def __init__(self, model: Model) -> None:
        self.topics = model.topics
        self._arms, self._period_ns, self._slot = model.arms, model.period_ns, -1
        self._described: set[str] = set()
        self._read = [topic for arm in self._arms for topic in (_joints(arm), _stylus(arm))]

    def forget(self) -> None:
        """Send the robots' descriptions again, for example at the beginning of a recording."""
        self._described.clear()

    def messages(self, newest: Newest) -> list[tuple[Topic, bytes, int]]:
        """Messages that are due, each as topic, bytes, and time of arrival [ns] of the newest drawn sample."""
        latest_ns = max(map(newest.received_ns, self._read), default=0)
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


class ModelTopics:
    """Publishers of the robot model and its frames; one exists only if the package of its messages is installed.

    ``tf2_msgs`` for example is part of ROS, and not on PyPI.

    Args:
        node: Node that owns the publishers.
        topics: Topics of the model.
    """

    def __init__(self, node: CoreNode, topics: tuple[Topic, ...]) -> None:
        self._publishers: dict[str, Any] = {}
        for topic in topics:
            try:
                publisher = node.open_publisher(absolute(topic))
            except (ImportError, AttributeError):
                continue
            self._publishers[topic.name] = publisher

    def send(self, topic: Topic, data: bytes) -> None:
        """Publish a message: frames only if there are subscribers, latched messages always."""
        publisher = self._publishers.get(topic.name)
        if publisher is not None and (topic is not TF or publisher.get_subscription_count()):
            publisher.publish(data)


def _joints(arm: DrawnArm) -> Topic:
    return SLAVE_MEASURED_JS.of_arm(arm.arm)


def _stylus(arm: DrawnArm) -> Topic:
    return MASTER_MEASURED_CP.of_arm(arm.arm)


def absolute(topic: Topic) -> Topic:
    """The topic with its full name: the arm's namespace already includes the node's namespace."""
    return replace(topic, name=f"/{topic.name}")
