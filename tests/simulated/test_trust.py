"""Trust: whatever anybody publishes, nodes go on and say what they refuse."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from teleop_core.bags.messages import layout
from teleop_core.graph import topics
from teleop_core.graph.stage import STAGES
from teleop_core.middleware.platform import Qos
from teleop_core.nodes.recorder import DISCOVERY_NS
from teleop_core.nodes.streams import message_type
from teleop_drill.simulation.platform import SimulatedPlatform

if TYPE_CHECKING:
    from peers import AnyPeer as Peer
    from simulated.conftest import SimulatedPeer


GARBAGE = b"\0\1\0\0" + bytes(range(200, 256))
NODES = ("operator", "haptic_master", "motion_scaling", "inverse_kinematics", "slave", "slave_sim")


@pytest.mark.parametrize("name", NODES)
def test_bytes_that_are_no_message_are_refused_on_every_topic_a_node_reads(peer: "Peer", name: str) -> None:
    reads = STAGES.find(name).reads
    looks: dict[str, Any] = {"kind": "remote"} if name == "operator" else {}  # others do not look at what is told
    node = peer.start(name, has_arm=False, **looks)

    def refused() -> bool:
        for topic in reads:
            peer.publisher(topic).publish(GARBAGE)
        values = peer.status(name).values
        return all(f"refused.{topic.name}.malformed" in values for topic in reads)

    peer.wait(refused, "refusals")
    assert "has bytes that are no valid message of its type" in peer.status(name).message
    assert node.end() == 0


def test_who_watches_a_session_passes_reports_over_that_are_none(peer: "Peer") -> None:
    peer.start("motion_scaling")
    publisher = peer.publisher(topics.DIAGNOSTICS)

    def counted() -> int:
        publisher.publish(GARBAGE)
        peer.status("motion_scaling")
        return peer.observer.malformed

    peer.wait(counted, "malformed reports")
    peer.observer.statuses.clear()
    peer.wait(lambda: peer.status("motion_scaling"), "a further report")


def test_a_second_master_is_refused_and_the_first_one_goes_on(peer: "Peer") -> None:
    peer.start("motion_scaling", owner_silence=10.0)
    first = peer.publisher(topics.MASTER_MEASURED_CP)
    kind = message_type(topics.MASTER_MEASURED_CP.kind.ros_type)
    second = peer.ros.create_publisher(kind, topics.MASTER_MEASURED_CP.name, Qos())
    form = layout(topics.MASTER_MEASURED_CP, ())
    stamp, pose = 300, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    for number in range(1, stamp):  # so that their numbers are apart
        first.publish(form.encode_one(number, pose))

    def heard() -> Any:
        first.publish(form.encode_one(stamp, pose))
        return peer.status("motion_scaling").number("received.master/measured_cp") > 0

    peer.wait(heard, "the first one, which owns the topic from then on")
    commands = peer.listen(topics.SLAVE_SERVO_CP)  # which carry the stamps of their poses on

    def refused() -> Any:
        """Report that tells of it; a later one is of a time without messages."""
        nonlocal stamp
        stamp += 2
        peer.send(topics.SLAVE_SETPOINT_CP, stamp, pose)
        first.publish(form.encode_one(stamp, pose))
        second.publish(form.encode_one(stamp + 1, pose))
        status = peer.status("motion_scaling")
        count = status.number("refused.master/measured_cp.second_publisher")
        is_told = count > 100 and "a second publisher" in status.message
        return status if is_told and commands.take() > 20 else None

    status = peer.wait(refused, "refusals of the second one")
    assert "2 publishers on master/measured_cp" in status.message
    assert "is from a second publisher" in status.message
    assert all(stamp % 2 == 0 for stamp in commands.stamps if stamp > 300)
    assert max(commands.stamps) > 302
    assert status.number("rate_hz.master/measured_cp") > 0.0


def test_a_recorder_does_not_take_a_second_publisher_for_losses(peer: "Peer", tmp_path: Path) -> None:
    peer.start("recorder", out=str(tmp_path / "bag"))
    topic = topics.MASTER_MEASURED_CP
    first = peer.publisher(topic)
    second = peer.ros.create_publisher(message_type(topic.kind.ros_type), topic.name, Qos())
    data = layout(topic, ()).encode_one(1, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
    for _ in range(1000):
        first.publish(data)
    sent = 1000

    def recorded() -> Any:
        nonlocal sent
        for _ in range(20):
            first.publish(data)
            second.publish(data)
        sent += 40
        status = peer.status("recorder")
        return status if status.number(f"received.{topic.name}") > 4000 else None

    status = peer.wait(recorded, "messages of both")
    # What a busy machine loses is lost, but nothing is both lost and received, or never was sent.
    assert status.number(f"lost.{topic.name}") <= sent - status.number(f"received.{topic.name}")


def test_a_recorder_tells_how_much_of_a_node_that_starts_again_came_before_it_knew_of_it(
    peer: "SimulatedPeer", tmp_path: Path
) -> None:
    peer.start("recorder", out=str(tmp_path / "bag"))
    topic, unheard, heard = topics.MASTER_MEASURED_CP, 300, list[int]()
    first = peer.publisher(topic)
    data = layout(topic, ()).encode_one(1, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
    begin_ns = peer.platform.monotonic_ns()

    def heard_for_longer_than_discovery_takes() -> bool:
        first.publish(data)
        received = peer.status("recorder").number(f"received.{topic.name}")
        return received > 0 and peer.platform.monotonic_ns() > begin_ns + DISCOVERY_NS

    peer.wait(heard_for_longer_than_discovery_takes, "the first publisher")

    def newcomer(platform: SimulatedPlatform) -> int:
        second = platform.node("newcomer").create_publisher(
            message_type(topic.kind.ros_type), topic.name, Qos(depth=10)
        )
        for _ in range(unheard):
            second.publish(data)
        heard.append(second.get_subscription_count())
        while True:
            second.publish(data)
            platform.sleep(0.01)

    peer.foreign("newcomer", newcomer)
    lost = f"lost.{topic.name}"
    peer.wait(lambda: peer.status("recorder").number(lost) >= unheard, "what the recorder tells of it")
    assert "lost" in peer.status("recorder").message
    assert heard == [0]
