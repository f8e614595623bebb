"""Display: the newest samples of some streams, thirty times a second, for pages that only look.

A reader of a stream costs its sender a message a tick, in the loop that must not be late. The
recorder has all of them already, and says again what people can see.
"""

import time
from dataclasses import replace

from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.model import Newest
from teleop_core.topics import (
    MASTER_MEASURED_CF,
    MASTER_MEASURED_CP,
    SLAVE_MEASURED_CP,
    SLAVE_MEASURED_JS,
    SLAVE_SERVO_CP,
    SLAVE_SETPOINT_JS,
    Topic,
)

SEEN = (
    MASTER_MEASURED_CP, MASTER_MEASURED_CF, SLAVE_SERVO_CP, SLAVE_SETPOINT_JS, SLAVE_MEASURED_JS,
    SLAVE_MEASURED_CP,
)  # fmt: skip
"""Streams that are said again."""
PERIOD_NS = 25_000_000
"""Time from one sample of a stream to the next, at least [ns]."""


def displayed(topic: Topic) -> Topic:
    """Topic on which a stream, in its arm's namespace, is said again."""
    return replace(topic, name=f"/display/{topic.name}")


class LiveDisplay:
    """Slow copies of the streams of one arm, while somebody looks.

    Args:
        node: Node that publishes them.
        arm: Namespace of the arm.
    """

    def __init__(self, node: CoreNode, arm: str) -> None:
        topics = [topic.of_arm(arm) for topic in SEEN]
        self._newest, self._sent_ns = Newest(tuple(topic.name for topic in topics)), 0
        self._publishers = {topic.name: node.open_publisher(displayed(topic)) for topic in topics}

    def take(self, came: list[tuple[int, Topic, bytes, int]]) -> None:
        """Take what came, and say again what is due."""
        for _, topic, data, _ in came:
            self._newest.put(topic.name, data)
        now_ns = time.monotonic_ns()
        if now_ns - self._sent_ns < PERIOD_NS:
            return
        self._sent_ns = now_ns
        for name, publisher in self._publishers.items():
            if (data := self._newest.data(name)) and publisher.get_subscription_count():
                publisher.publish(data)
                self._newest.put(name, b"")
