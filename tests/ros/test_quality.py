"""Quality: streams reach subscribers of both kinds, and qos_overrides mean what they say."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data

from teleop_core.base import ParameterError
from teleop_core.graph import STAGES, topics
from teleop_core.nodes.quality import QualityOverrides, profile
from teleop_core.nodes.streams import message_type

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros

JS: Any = topics.SLAVE_MEASURED_JS


def heard(peer: "Peer", topic: topics.Topic, qos: QoSProfile) -> Any:
    """Messages of a subscription as a stock client makes it."""
    found: list[Any] = []
    peer.node.create_subscription(message_type(topic.kind.ros_type), topic.name, found.append, qos)
    return found


def spun(peer: "Peer", condition: Callable[..., object]) -> Callable[[], object]:
    def done() -> object:
        peer.spin()
        return condition()

    return done


def test_a_stream_reaches_reliable_and_best_effort_subscribers(peer: "Peer") -> None:
    """The default of ROS's subscribers, and so of stock clients, is reliable."""
    streams = [t for t in STAGES.find("slave").writes if t.quality is topics.Quality.STREAM]
    reliable: Any = {topic: heard(peer, topic, QoSProfile(depth=10)) for topic in streams}
    best_effort = heard(peer, JS, qos_profile_sensor_data)
    peer.start("slave")
    for topic, found in {**reliable, JS.name: best_effort}.items():
        peer.wait(spun(peer, lambda own=found: len(own) > 20), topic)


def test_a_command_is_taken_from_senders_of_both_kinds(peer: "Peer") -> None:
    peer.start("slave")
    for qos in (QoSProfile(depth=10), qos_profile_sensor_data):
        kind = message_type(topics.SLAVE_SERVO_JP.kind.ros_type)
        own: Any = peer.node.create_publisher(kind, topics.SLAVE_SERVO_JP.name, qos)
        peer.wait(own.get_subscription_count, "the slave as a reader")
        peer.node.destroy_publisher(own)


def test_an_override_changes_what_a_publisher_offers(peer: "Peer") -> None:
    name = f"/{JS.name}"
    override: dict[str, Any] = {f"qos_overrides.{name}.publisher.reliability": "best_effort"}
    peer.start("slave_sim", **override)
    published = peer.node.get_publishers_info_by_topic
    (found,) = peer.wait(lambda: published(name), "the publisher")
    assert found.qos_profile.reliability is ReliabilityPolicy.BEST_EFFORT
    other_name = f"/{topics.SLAVE_TRUE_CP.name}"
    (other,) = peer.wait(lambda: published(other_name), "the other publisher")
    assert other.qos_profile.reliability is ReliabilityPolicy.RELIABLE


def test_an_override_changes_what_a_subscription_asks_for(peer: "Peer") -> None:
    name = f"/{topics.SLAVE_SERVO_JP.name}"
    peer.start("slave", **dict[str, Any]({f"qos_overrides.{name}.subscription.reliability": "reliable"}))
    peer.wait(lambda: peer.node.get_subscriptions_info_by_topic(name), "the subscription")
    (found,) = peer.node.get_subscriptions_info_by_topic(name)
    assert found.qos_profile.reliability is ReliabilityPolicy.RELIABLE


def test_a_wrong_override_ends_the_node_in_one_line(peer: Any) -> None:
    name = f"qos_overrides./{JS.name}.publisher.reliability"
    node = peer.start("slave_sim", wait="", **dict[str, Any]({name: "very"}))
    assert node.wait() == 2
    said = node.stderr.read_text().strip().splitlines()
    assert len(said) == 1
    assert name in said[0]
    assert "one of reliable, best_effort" in said[0]


def test_an_override_of_a_topic_that_is_not_open_is_told(peer: Any) -> None:
    name = "qos_overrides./slave/measure_js.publisher.reliability"
    peer.start("slave", **dict[str, Any]({name: "reliable"}))
    peer.wait(lambda: f"no effect of {name}" in peer.status("slave").message, "the warning")


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("qos_overrides.slave/x.publisher.reliability", "reliable", "full name"),
        ("qos_overrides./slave/x.reader.reliability", "reliable", "publisher|subscription"),
        ("qos_overrides./slave/x.publisher.lifespan", "1", "reliability, durability, history"),
        ("qos_overrides./slave/x.publisher.reliability", 1, "one of reliable, best_effort"),
        ("qos_overrides./slave/x.publisher.depth", 0, "a whole number from 1"),
        ("qos_overrides./slave/x.publisher.depth", True, "a whole number from 1"),
        ("qos_overrides./slave/x.publisher.depth", "10", "a whole number from 1"),
        ("qos_overrides.", None, "full name"),
    ],
)
def test_overrides_that_cannot_be_are_refused_with_what_can(
    name: str, value: str | int | bool | None, told: str
) -> None:
    with pytest.raises(ParameterError) as refused:
        QualityOverrides({name: value})
    assert told in str(refused.value)
    assert name in str(refused.value)


def test_an_override_changes_its_end_of_its_topic_alone() -> None:
    overrides = QualityOverrides({"qos_overrides./slave/a.publisher.depth": 7, "other": 1})
    assert overrides.apply("/slave/a", "subscription", profile(JS)).depth == 1
    assert overrides.apply("/slave/ab", "publisher", profile(JS)).depth == 1
    assert overrides.unused() == ["qos_overrides./slave/a.publisher.depth"]
    assert overrides.apply("/slave/a", "publisher", profile(JS)).depth == 7
    assert overrides.unused() == []
