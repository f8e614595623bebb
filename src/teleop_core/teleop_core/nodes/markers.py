"""Live markers: what RViz and Foxglove draw beside the robot, while somebody looks."""

import time
from typing import Any

import numpy as np

from teleop_core.bags.markers import MARKERS, Marker, marker_message
from teleop_core.bags.messages import read_reports
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.model import Newest, absolute
from teleop_core.session.markers import ArmMarkers
from teleop_core.topics import (
    MASTER_MEASURED_CF,
    MASTER_MEASURED_CP,
    SLAVE_MEASURED_CP,
    SLAVE_SERVO_CP,
    TELEOP_STATE,
    Topic,
)

PERIOD_NS = 50_000_000
"""Time from one message to the next [ns]."""
_READ = (
    MASTER_MEASURED_CF, MASTER_MEASURED_CP, SLAVE_MEASURED_CP, SLAVE_SERVO_CP, TELEOP_STATE,
)  # fmt: skip


class LiveMarkers:
    """Markers of one arm of a running session.

    Args:
        node: Node that publishes them.
        arm: Namespace of the arm.
    """

    def __init__(self, node: CoreNode, arm: str) -> None:
        self._topics = {topic: topic.of_arm(arm) for topic in _READ}
        self._newest = Newest(tuple(topic.name for topic in self._topics.values()))
        self._drawn, self._sent_ns = ArmMarkers(arm), 0
        self._publisher: Any = node.open_publisher(absolute(MARKERS.of_arm(arm)))

    def take(self, came: list[tuple[int, Topic, bytes, int]]) -> None:
        """Take what came, and publish what is due while somebody listens."""
        for _, topic, data, _ in came:
            self._newest.put(topic.name, data)
        now_ns = time.monotonic_ns()
        if now_ns - self._sent_ns < PERIOD_NS:
            return
        self._sent_ns = now_ns
        if not self._publisher.get_subscription_count():
            self._drawn.forget()
            return
        self._publisher.publish(marker_message(time.time_ns(), self._markers()))

    def _markers(self) -> list[Marker]:
        wrench, stylus = self._values(MASTER_MEASURED_CF), self._values(MASTER_MEASURED_CP)
        force = np.zeros(3) if wrench is None else wrench[:3]
        data = self._newest.data(self._topics[TELEOP_STATE].name)
        texts = read_reports(data)[0].values if data else {}
        state = {name: float(texts[name]) for name in TELEOP_STATE.columns if name in texts}
        kind = texts.get("fixture", "box")
        markers = [self._drawn.fixture(state, kind, float(np.linalg.norm(force)))]
        if stylus is not None:
            markers.append(self._drawn.force(stylus, force))
        for name, topic in (("measured", SLAVE_MEASURED_CP), ("commanded", SLAVE_SERVO_CP)):
            pose = self._values(topic)
            if pose is not None:
                markers.append(self._drawn.path(name, pose[:3]))
        return markers

    def _values(self, topic: Topic) -> Any:
        found = self._newest.values(self._topics[topic])
        return None if found is None else found[1]
