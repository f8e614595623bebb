"""Display: the newest samples of some streams, thirty times a second, for pages that only display them.

Each additional reader of a stream costs the sender one message per tick, in the loop that must not be late. The
recorder already receives all streams, so it republishes them at a rate for displays.
"""

from dataclasses import replace

from teleop_core.graph.topics import (
    DISPLAY_MEASURED_CP,
    MASTER_ENERGY,
    MASTER_MEASURED_CF,
    MASTER_MEASURED_CP,
    SCENE_POSES,
    SLAVE_ENERGY,
    SLAVE_JAW_BOARD,
    SLAVE_JAW_MEASURED_JS,
    SLAVE_JAW_OBJECT_CP,
    SLAVE_MEASURED_CF,
    SLAVE_MEASURED_CP,
    SLAVE_MEASURED_JS,
    SLAVE_SERVO_CP,
    SLAVE_SETPOINT_JS,
    TASK_STATE,
    Topic,
)
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.newest import Cadence, Newest

SEEN = (
    MASTER_MEASURED_CP, MASTER_MEASURED_CF, SLAVE_SERVO_CP, SLAVE_SETPOINT_JS, SLAVE_MEASURED_JS,
    SLAVE_MEASURED_CP, SLAVE_MEASURED_CF, SLAVE_JAW_MEASURED_JS, SLAVE_JAW_OBJECT_CP,
    SLAVE_JAW_BOARD, MASTER_ENERGY, SLAVE_ENERGY, TASK_STATE, SCENE_POSES, DISPLAY_MEASURED_CP,
)  # fmt: skip
"""Streams that are republished."""
PERIOD_NS = 25_000_000
"""Shortest time between two republished samples of a stream [ns]."""


def displayed(topic: Topic) -> Topic:
    """Topic on which a stream is republished, in its arm's namespace."""
    return replace(topic, name=f"/display/{topic.name}")


class LiveDisplay:
    """Publishes the streams of one arm at a low rate while there are subscribers.

    Args:
        node: Node that publishes the streams.
        arm: Namespace of the arm.
    """

    def __init__(self, node: CoreNode, arm: str) -> None:
        topics = [topic.of_arm(arm) for topic in SEEN]
        self._publishers = {topic: node.open_publisher(displayed(topic)) for topic in topics}
        self._cadence, self._said = (Cadence(node.world.monotonic_ns, PERIOD_NS), dict.fromkeys(topics, b""))

    def show(self, newest: Newest) -> None:
        """Publish the samples that are due and new."""
        if not self._cadence.is_due():
            return
        for topic, publisher in self._publishers.items():
            data = newest.data(topic)
            if data is not self._said[topic] and publisher.get_subscription_count():
                publisher.publish(data)
                self._said[topic] = data
