"""Display: the newest samples of some streams, thirty times a second, for pages that only display them.

Each additional reader of a stream costs the sender one message per tick, in the loop that must not be late. Each node
therefore repeats its own streams at a rate for displays, outside its loop.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

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
from teleop_core.middleware.platform import Owner, Taken
from teleop_core.nodes.streams import Output, Subscription

SEEN = (
    MASTER_MEASURED_CP, MASTER_MEASURED_CF, SLAVE_SERVO_CP, SLAVE_SETPOINT_JS, SLAVE_MEASURED_JS,
    SLAVE_MEASURED_CP, SLAVE_MEASURED_CF, SLAVE_JAW_MEASURED_JS, SLAVE_JAW_OBJECT_CP,
    SLAVE_JAW_BOARD, MASTER_ENERGY, SLAVE_ENERGY, TASK_STATE, SCENE_POSES, DISPLAY_MEASURED_CP,
)  # fmt: skip
"""Streams that are repeated."""
PERIOD_NS = 25_000_000
"""Shortest time between two copies of a stream [ns]."""
_SILENCE_NS = 1_000_000_000
"""Time without a copy after which a reader looks for publishers of copies [ns]."""


def displayed(topic: Topic) -> Topic:
    """Topic of the copies of a stream, in its arm's namespace."""
    return replace(topic, name=f"/display/{topic.name}")


class DisplayCopies:
    """Copies of a node's own streams for displays, sent while there are subscribers.

    Args:
        node: Node that publishes the streams.
        outputs: Outputs of the node, by the topic in its namespace.
    """

    def __init__(self, node: Any, outputs: Mapping[Topic, Output]) -> None:
        seen = {topic.of_arm(node.arm).name for topic in SEEN}
        own = [topic for topic in outputs if topic.name in seen]
        self._copies = [(outputs[topic], node.open_publisher(displayed(topic))) for topic in own]
        self._ros, self._sent, self._timer = node.ros, [0] * len(self._copies), None

    def look(self) -> None:
        """Begin or end sending, as there are subscribers."""
        is_watched = any(publisher.get_subscription_count() for _, publisher in self._copies)
        if is_watched and self._timer is None:
            self._timer = self._ros.create_timer(1e-9 * PERIOD_NS, self._send)
        elif not is_watched:
            self.close()

    def close(self) -> None:
        """End sending."""
        if self._timer is not None:
            self._ros.destroy(self._timer)
            self._timer = None

    def _send(self) -> None:
        for index, (output, publisher) in enumerate(self._copies):
            if output.sent != self._sent[index] and publisher.get_subscription_count():
                self._sent[index] = output.sent
                publisher.publish(output.data)


class DisplayedStream:
    """Newest message of a stream, from its copy for displays; from the stream itself if no node sends copies.

    Args:
        owner: Node that reads the stream.
        topic: The stream, in the namespace of its arm.
    """

    def __init__(self, owner: Owner, topic: Topic) -> None:
        self._owner, self._topic = owner, topic
        self._name, self._since_ns = displayed(topic).name, owner.platform.monotonic_ns()
        self._subscription = Subscription(owner, topic, self._name, 1)

    def take(self) -> Taken | None:
        """Newest message; None if no message came since the last call."""
        newest = None
        while (taken := self._subscription.take()) is not None:
            newest = taken
        now_ns, is_copy = self._owner.platform.monotonic_ns(), self._name != f"/{self._topic.name}"
        if newest is None and is_copy and now_ns - self._since_ns > _SILENCE_NS:
            self._since_ns = now_ns
            if not self._owner.ros.count_publishers(self._name):
                self._subscription.close()
                self._name = f"/{self._topic.name}"
                self._subscription = Subscription(self._owner, self._topic, self._name, 1)
        return newest

    def close(self) -> None:
        """Stop listening."""
        self._subscription.close()
