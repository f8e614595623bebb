"""Trust: whatever anybody publishes, nodes go on and say what they refuse."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import rclpy
from rclpy.context import Context

from teleop_core.bags.messages import layout
from teleop_core.graph import topics
from teleop_core.nodes.recorder import DISCOVERY_NS
from teleop_core.nodes.streams import message_type

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros


def test_a_recorder_tells_how_much_of_a_node_that_starts_again_came_before_it_knew_of_it(
    peer: "Peer", tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    peer.start("recorder", out=str(tmp_path / "bag"))
    topic = topics.MASTER_MEASURED_CP
    first = peer.publisher(topic)
    data = layout(topic, ()).encode_one(1, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
    begin = time.monotonic()

    def heard_for_longer_than_discovery_takes() -> bool:
        first.publish(data)
        received = peer.status("recorder").number(f"received.{topic.name}")
        return received > 0 and time.monotonic() > begin + 1e-9 * DISCOVERY_NS

    peer.wait(heard_for_longer_than_discovery_takes, "the first publisher")
    context, unheard = Context(), 300
    context.init(domain_id=int(peer.domain))
    request.addfinalizer(context.shutdown)
    newcomer = rclpy.create_node("newcomer", context=context, use_global_arguments=False)
    second = newcomer.create_publisher(message_type(topic.kind.ros_type), topic.name, 10)
    for _ in range(unheard):
        second.publish(data)
    assert second.get_subscription_count() == 0
    lost = f"lost.{topic.name}"

    def told() -> Any:
        second.publish(data)
        status = peer.status("recorder")
        return status if status.number(lost) >= unheard else None

    status = peer.wait(told, "what the recorder tells of it")
    assert "lost" in status.message
