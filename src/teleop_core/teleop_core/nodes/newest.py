"""Newest: the last message of each topic that the recorder received, for displays."""

from collections.abc import Callable

from teleop_core.bags.layouts import layout
from teleop_core.bags.messages import Refusal, read_any
from teleop_core.graph.topics import Topic
from teleop_core.kernels.geometry import Array

Arrival = tuple[int, Topic, bytes, int]
"""Time of arrival [ns], topic, bytes, time of sending [ns]."""


class Newest:
    """Newest message of every topic, as bytes."""

    def __init__(self) -> None:
        self._messages: dict[str, Arrival] = {}

    def take(self, came: list[Arrival]) -> None:
        """Add the received messages, in their order."""
        for message in came:
            self._messages[message[1].name] = message

    def data(self, topic: Topic) -> bytes:
        """Newest message of a topic; the same object until the next message comes; empty before the first message."""
        message = self._messages.get(topic.name)
        return b"" if message is None else message[2]

    def received_ns(self, topic: Topic) -> int:
        """Time of arrival of the newest message [ns]; 0 before the first message."""
        message = self._messages.get(topic.name)
        return 0 if message is None else message[0]

    def values(self, topic: Topic, joint_names: tuple[str, ...] = ()) -> tuple[int, Array] | None:
        """Stamp [ns] and values of the newest message; None if there is no valid message."""
        data = self.data(topic)
        if not data:
            return None
        found = layout(topic, joint_names).decode_one(data)
        answer = read_any(topic.kind, data, joint_names) if found is None else found
        return None if isinstance(answer, Refusal) else answer


class Cadence:
    """Tells when a period has passed.

    Args:
        clock: Returns the monotonic time [ns].
        period_ns: Shortest time between two due times [ns].
    """

    def __init__(self, clock: Callable[[], int], period_ns: int) -> None:
        self._clock, self._period_ns, self._last_ns = clock, period_ns, 0

    def is_due(self) -> bool:
        """Whether the period has passed; if so, a new period begins."""
        now_ns = self._clock()
        if now_ns - self._last_ns < self._period_ns:
            return False
        self._last_ns = now_ns
        return True
