"""Live markers: shapes that RViz and Foxglove draw beside the robot, published while there are subscribers."""

from dataclasses import replace
from typing import Any

import numpy as np

from teleop_core.bags.markers import MARKERS, Marker, marker_message
from teleop_core.bags.messages import read_reports
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.newest import Cadence, Newest
from teleop_core.session.markers import ArmMarkers

PERIOD_NS = 50_000_000
"""Time from one message to the next [ns]."""
_READ = (
    topics.MASTER_MEASURED_CF,
    topics.MASTER_MEASURED_CP,
    topics.SLAVE_MEASURED_CP,
    topics.SLAVE_SERVO_CP,
    topics.TELEOP_STATE,
)


class LiveMarkers:
    """Markers of one arm of a running session.

    Args:
        node: Node that publishes the markers.
        arm: Namespace of the arm.
        axes: Rotation (3, 3) from the master's base to the slave's axes; None for the rotation of the default
            parameters.

    Attributes:
        read: Topics from which they are drawn.
    """

    def __init__(self, node: CoreNode, arm: str, axes: Array | None = None) -> None:
        self._topics = {topic: topic.of_arm(arm) for topic in _READ}
        self.read = tuple(self._topics.values())
        self._drawn, self._cadence = (ArmMarkers(arm, axes), Cadence(node.platform.monotonic_ns, PERIOD_NS))
        self._publisher = node.open_publisher(absolute(MARKERS.of_arm(arm)))
        self._time_ns = node.platform.time_ns

    @property
    def is_watched(self) -> bool:
        """Whether there are subscribers."""
        return bool(self._publisher.get_subscription_count())

    def show(self, newest: Newest) -> None:
        """Publish the markers that are due, if there are subscribers."""
        if not self._cadence.is_due():
            return
        if not self.is_watched:
            self._drawn.forget()
            return
        self._publisher.publish(marker_message(self._time_ns(), self._markers(newest)))

    def _markers(self, newest: Newest) -> list[Marker]:
        wrench = self._values(newest, topics.MASTER_MEASURED_CF)
        stylus = self._values(newest, topics.MASTER_MEASURED_CP)
        force = np.zeros(3) if wrench is None else wrench[:3]
        data = newest.data(self._topics[topics.TELEOP_STATE])
        texts = read_reports(data)[0].values if data else {}
        state = {name: float(texts[name]) for name in topics.TELEOP_STATE.columns if name in texts}
        markers = [self._drawn.fixture(state, texts, float(np.linalg.norm(force)))]
        if stylus is not None:
            markers.append(self._drawn.force(stylus, force))
        for name, topic in (("measured", topics.SLAVE_MEASURED_CP), ("commanded", topics.SLAVE_SERVO_CP)):
            pose = self._values(newest, topic)
            if pose is not None:
                markers.append(self._drawn.path(name, pose[:3]))
        return markers

    def _values(self, newest: Newest, topic: topics.Topic) -> Any:
        found = newest.values(self._topics[topic])
        return None if found is None else found[1]


def absolute(topic: topics.Topic) -> topics.Topic:
    """The topic with its full name: the arm's namespace already includes the node's namespace."""
    return replace(topic, name=f"/{topic.name}")
