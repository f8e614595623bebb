"""Node, implemented with rclpy."""

import time
from collections.abc import Callable
from typing import Any

from rclpy.client import Client
from rclpy.duration import Duration
from rclpy.lifecycle import LifecyclePublisher
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.service import Service
from rclpy.subscription import Subscription

from teleop_core.middleware.agenda import Agenda, GuardCondition, Timer
from teleop_core.middleware.platform import Endpoint, Qos
from teleop_core.middleware.ros_taking import RosTaker

_DESTROY = {
    LifecyclePublisher: "destroy_lifecycle_publisher",
    Publisher: "destroy_publisher",
    Subscription: "destroy_subscription",
    Service: "destroy_service",
    Client: "destroy_client",
}


_FRESH_NS = 50_000_000
"""Time for which an answer of discovery is used again [ns]: the nodes of a process ask for the same topics."""
_known: dict[tuple[Any, str], tuple[int, list[Endpoint]]] = {}


def profile_of(qos: Qos) -> QoSProfile:
    """Quality of service as an rclpy profile."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL if qos.keeps_all else HistoryPolicy.KEEP_LAST,
        depth=qos.depth,
        reliability=(ReliabilityPolicy.RELIABLE if qos.is_reliable else ReliabilityPolicy.BEST_EFFORT),
        durability=(DurabilityPolicy.TRANSIENT_LOCAL if qos.is_latched else DurabilityPolicy.VOLATILE),
    )


class RosPublisher:
    """See :class:`~teleop_core.middleware.platform.Publisher`.

    Args:
        own: Publisher of rclpy.
    """

    def __init__(self, own: Publisher) -> None:
        self.own: Any = own
        self._handle = own.handle
        self._is_managed = isinstance(own, LifecyclePublisher)
        self.publish: Callable[[Any], None] = own.publish
        self.get_subscription_count: Callable[[], int] = own.get_subscription_count

    @property
    def pointer(self) -> int:
        """Address of the publisher in rcl, for kernels; 0 while the node is not active."""
        return 0 if self._is_managed and not self.own.is_activated else int(self._handle.pointer)

    def hold(self) -> None:
        """Keep the publisher in memory until :meth:`release`: kernels publish without the interpreter's lock."""
        self._handle.__enter__()

    def release(self) -> None:
        """Let the publisher be destroyed."""
        self._handle.__exit__(None, None, None)

    def send(self, data: bytes) -> None:
        """Send bytes, if the node is active."""
        if self._is_managed and not self.own.is_activated:
            return
        with self._handle:
            self._handle.publish_raw(data)

    def wait_for_all_acked(self, seconds: float) -> None:
        """Wait until all readers have received all messages, at most for some time [s]."""
        self.own.wait_for_all_acked(Duration(nanoseconds=round(seconds * 1e9)))


class RosNode:
    """See :class:`~teleop_core.middleware.platform.Node`.

    Args:
        own: Node of rclpy.
    """

    def __init__(self, own: Node) -> None:
        self.own: Any = own
        self.get_name = self.own.get_name
        self.get_namespace = self.own.get_namespace
        self.get_logger = self.own.get_logger
        self.resolve_topic_name = self.own.resolve_topic_name
        self.create_service = self.own.create_service
        self.create_client = self.own.create_client
        self.agenda = Agenda()
        self.count_publishers = self.own.count_publishers
        self.get_topic_names_and_types = self.own.get_topic_names_and_types
        self.get_service_names_and_types = self.own.get_service_names_and_types
        self.destroy_node = self.own.destroy_node

    def create_publisher(self, kind: Any, name: str, qos: Qos) -> RosPublisher:
        """Publisher of messages of a class."""
        return RosPublisher(self.own.create_publisher(kind, name, profile_of(qos)))

    def create_taker(self, kind: Any, name: str, qos: Qos) -> RosTaker:
        """Subscription whose messages are read without an executor."""
        return RosTaker(self.own, kind, name, profile_of(qos))

    def create_subscription(self, kind: Any, name: str, callback: Callable[[Any], None], qos: Qos) -> Any:
        """Subscription whose messages the executor passes to ``callback``."""
        return self.own.create_subscription(kind, name, callback, profile_of(qos))

    def create_timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """Timer whose function the executor calls."""
        return self.agenda.timer(period, callback)

    def create_guard_condition(self, callback: Callable[[], None]) -> GuardCondition:
        """Guard whose function the executor calls."""
        return GuardCondition(self.agenda, callback)

    def destroy(self, entity: Any) -> None:
        """Destroy an object that one of the methods above has made."""
        if isinstance(entity, Timer):
            self.agenda.drop(entity)
            return
        if isinstance(entity, GuardCondition):
            entity.cancel()
            return
        own = entity.own if isinstance(entity, RosPublisher) else entity
        destroy = next(name for kind, name in _DESTROY.items() if isinstance(own, kind))
        getattr(self.own, destroy)(own)

    def defer(self, work: Callable[..., object], *arguments: object) -> None:
        """Let the executor call ``work`` soon. May be called from any thread."""
        self.agenda.defer(work, *arguments)

    def publishers(self, name: str) -> list[Endpoint]:
        """Discovered publishers of a topic, as known at most 50 ms ago to any node of this context."""
        key, now_ns = (self.own.context, name), time.monotonic_ns()
        asked_ns, found = _known.get(key, (-_FRESH_NS, []))
        if now_ns - asked_ns >= _FRESH_NS:
            found = [_endpoint(info) for info in self.own.get_publishers_info_by_topic(name)]
            _known[key] = now_ns, found
        return found

    def readers(self, name: str) -> list[Endpoint]:
        """Discovered readers of a topic."""
        return [_endpoint(info) for info in self.own.get_subscriptions_info_by_topic(name)]


def _endpoint(info: Any) -> Endpoint:
    """Endpoint from rclpy's data about it."""
    return Endpoint(
        f"{info.node_namespace.rstrip('/')}/{info.node_name}",
        bytes(info.endpoint_gid),
        info.topic_type,
        info.qos_profile.reliability == ReliabilityPolicy.RELIABLE,
        info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
    )
