"""An arm from the view of an ordinary CRTK client: subscriptions to its topics, and commands to it."""

from collections.abc import Callable
from typing import Any

import numpy as np

from teleop_core.bags.messages import SECOND_NS
from teleop_core.middleware.platform import Endpoint, Node, Platform, Publisher, Qos
from teleop_core.middleware.ros import ROS
from teleop_core.middleware.ros_messages import read_message
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.streams import message_type
from teleop_drill.conformance.crtk_topics import CRTK_TOPICS

_BY_NAME = {row.name: row for row in CRTK_TOPICS}
_TURN = 0.005
_SETTLED = 15  # discovery is complete after so many tenths of a second without a new publisher or reader


class Tap:
    """Subscription to one topic that counts the messages and stores the newest one.

    Args:
        node: Node that listens.
        name: Full name of the topic.
        ros_type: Type of its messages.
        depth: Largest number of waiting messages.
    """

    def __init__(self, node: Node, name: str, ros_type: str, depth: int = 2000) -> None:
        self._taker = node.create_taker(message_type(ros_type), name, Qos(depth=depth, is_reliable=False))
        self.close: Callable[[], None] = self._taker.close
        """Stop listening."""
        self.count = 0
        self.newest: Any = None
        self._kept: list[tuple[int, bytes]] = []

    def read(self, every: Callable[[Any], None] | None = None) -> int:
        """Read all waiting messages; returns their number.

        Args:
            every: Called with each message; without it only the newest message is decoded.
        """
        data, count = None, 0
        while (taken := self._taker.take()) is not None:
            data = taken.data
            count += 1
            if every is not None:
                every(read_message(data, self._taker.type))
        if data is not None:
            self.newest = read_message(data, self._taker.type)
        self.count += count
        return count

    def drain(self) -> bool:
        """Store all waiting messages undecoded; return whether any message is stored."""
        while (taken := self._taker.take()) is not None:
            self._kept.append((taken.sent_ns, taken.data))
        return bool(self._kept)

    def kept(self) -> list[tuple[int, Any]]:
        """Messages of :meth:`drain`, each with the time at which it was sent [ns]."""
        return [(sent_ns, read_message(data, self._taker.type)) for sent_ns, data in self._kept]


class ArmClient(Guest):
    """Client of one arm.

    Args:
        namespace: Namespace of the arm's topics, such as ``/PSM1`` or ``slave``.
        domain: ROS domain; None for that of the environment.
    platform: Middleware and time of the client.

    Attributes:
        interrupt: Ends a wait with KeyboardInterrupt.

    Raises:
        MessageTypeError: A package of messages is not installed, such as crtk_msgs.
    """

    def __init__(self, namespace: str, domain: int | None = None, platform: Platform = ROS) -> None:
        for row in CRTK_TOPICS:  # subscribe before the arm moves
            message_type(row.ros_type)
        super().__init__("teleop_conformance", domain, platform)
        self._own = f"/{self.ros.get_name()}"
        self.namespace = "/" + namespace.strip("/")
        self.interrupt = Interrupt()
        self._taps: dict[str, Tap] = {}
        self._keeping: dict[str, Tap] = {}
        self._publishers: dict[str, Publisher] = {}

    def path(self, name: str) -> str:
        """Full name of a topic of the arm."""
        return f"{self.namespace}/{name}"

    # -- what is there ---------------------------------------------------------------------------

    def is_there(self, timeout: float) -> bool:
        """Whether any topic of the arm appears within a time [s]; if so, wait until no more topics appear."""
        if not self.wait(lambda: self._ends() > 0, timeout):
            return False
        counts = [0]
        while counts[-1] != self._ends() or len(counts) < _SETTLED:
            counts = [*counts, self._ends()] if counts[-1] == self._ends() else [self._ends()]
            self.pause(0.1)
        return True

    def _ends(self) -> int:
        """Number of publishers and readers of the arm's topics, without our own."""
        return sum(len(self.publishers(r.name)) + len(self.readers(r.name)) for r in CRTK_TOPICS)

    def publishers(self, name: str) -> list[Endpoint]:
        """Publishers of a topic, without our own."""
        return [end for end in self.ros.publishers(self.path(name)) if end.node != self._own]

    def readers(self, name: str) -> list[Endpoint]:
        """Readers of a topic, without our own."""
        return [end for end in self.ros.readers(self.path(name)) if end.node != self._own]

    def others(self, name: str) -> int:
        """Number of other publishers of a command, without those of the arm's own nodes."""
        own = {end.node for query in ("setpoint_js", "measured_js", "measured_cp") for end in self.publishers(query)}
        own |= {end.node for end in self.readers("servo_cp")}
        return sum(end.node not in own for end in self.publishers(name))

    # -- listening and speaking ------------------------------------------------------------------

    def tap(self, name: str) -> Tap:
        """Tap of a topic of the arm; it receives messages from the first call on."""
        if name not in self._taps:
            self._taps[name] = Tap(self.ros, self.path(name), _BY_NAME[name].ros_type)
        return self._taps[name]

    def untap(self, name: str) -> None:
        """Close the tap of a topic."""
        if name in self._taps:
            self._taps.pop(name).close()

    def keep(self, names: list[str], timeout: float = 2.0) -> None:
        """Store all messages of some topics, in addition to those of :meth:`tap`.

        Returns when each topic has had a message, or after a time [s]. The wait is needed because messages are lost
        until a publisher has discovered the new reader. A motion that began earlier would be incomplete.
        """
        made = [Tap(self.ros, self.path(name), _BY_NAME[name].ros_type) for name in names]
        self._keeping.update(zip(names, made, strict=True))
        self.wait(lambda: all(tap.drain() for tap in made), timeout)

    def kept(self) -> dict[str, list[tuple[int, Any]]]:
        """Return the stored messages with their sending times [ns], and stop to store messages."""
        found = {}
        for name, tap in self._keeping.items():
            tap.drain()
            found[name] = tap.kept()
            tap.close()
        self._keeping.clear()
        return found

    def newest(self, name: str, timeout: float = 2.0) -> Any:
        """Newest message of a topic; None if there is none within a time [s]."""
        tap = self.tap(name)
        self.wait(lambda: bool(tap.read()) or tap.newest is not None, timeout)
        return tap.newest

    def send(self, name: str, message: Any) -> None:
        """Send a command with the present time as its stamp."""
        if hasattr(message, "header"):
            stamp = message.header.stamp
            stamp.sec, stamp.nanosec = divmod(self.platform.time_ns(), SECOND_NS)
        self.publisher_of(name).publish(message)

    def publisher_of(self, name: str) -> Publisher:
        """Publisher of a command; returned as soon as the arm has discovered the publisher."""
        row = _BY_NAME[name]
        if row.name not in self._publishers:
            quality = Qos(is_latched=row.name == "state_command")  # as in the CRTK library's client
            own = self.ros.create_publisher(message_type(row.ros_type), self.path(row.name), quality)
            self._publishers[row.name] = own
            self.wait(lambda: own.get_subscription_count() > 0, 3.0)
        return self._publishers[row.name]

    def message(self, name: str, **values: Any) -> Any:
        """Empty message of a topic, with the given fields filled."""
        return message_type(_BY_NAME[name].ros_type)(**values)

    def wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Whether a condition becomes true within a time [s]."""
        end_ns = self.platform.monotonic_ns() + round(timeout * SECOND_NS)
        while not condition():
            self.interrupt.check()
            for tap in self._keeping.values():
                tap.drain()
            if self.platform.monotonic_ns() > end_ns:
                return False
            self.platform.sleep(_TURN)
        return True

    def pause(self, seconds: float) -> None:
        """Let time pass [s]."""
        self.wait(lambda: False, seconds)


def stamp_of(message: Any) -> int:
    """Stamp of a message [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec * SECOND_NS + stamp.nanosec)


def numbers_of(message: Any) -> dict[str, np.ndarray]:
    """Vectors of a message by name; empty fields are left out."""
    if hasattr(message, "position"):
        parts = ("position", "velocity", "effort")
        return {part: np.array(getattr(message, part), dtype=np.float64) for part in parts}
    if hasattr(message, "pose"):
        p, q = message.pose.position, message.pose.orientation
        return {"position": np.array([p.x, p.y, p.z]), "quaternion": np.array([q.w, q.x, q.y, q.z])}
    if hasattr(message, "twist"):
        v, w = message.twist.linear, message.twist.angular
        return {"twist": np.array([v.x, v.y, v.z, w.x, w.y, w.z])}
    if hasattr(message, "wrench"):
        f, t = message.wrench.force, message.wrench.torque
        return {"wrench": np.array([f.x, f.y, f.z, t.x, t.y, t.z])}
    if hasattr(message, "data"):
        return {"data": np.array(message.data, dtype=np.float64)}
    return {}
