"""Trust: whatever anybody publishes, nodes go on and say what they refuse."""

import pytest

from teleop_core import topics
from teleop_core.stage import STAGES

pytestmark = pytest.mark.ros

GARBAGE = b"\0\1\0\0" + bytes(range(200, 256))
NODES = ("haptic_master", "motion_scaling", "inverse_kinematics", "slave_sim")


@pytest.mark.parametrize("name", NODES)
def test_bytes_that_are_no_message_are_refused_on_every_topic_a_node_reads(peer, name):
    reads = STAGES.find(name).reads
    node = peer.start(name)

    def refused():
        for topic in reads:
            peer.publisher(topic).publish(GARBAGE)
        values = peer.status(name).values
        return all(f"refused.{topic.name}.malformed" in values for topic in reads)

    peer.wait(refused, "refusals")
    assert "has bytes that are no message of its type" in peer.status(name).message
    assert node.end() == 0


def test_who_watches_a_session_passes_reports_over_that_are_none(peer):
    peer.start("motion_scaling")
    publisher = peer.publisher(topics.DIAGNOSTICS)

    def counted():
        publisher.publish(GARBAGE)
        peer.status("motion_scaling")
        return peer.observer.malformed

    peer.wait(counted, "malformed reports")
    peer.observer.statuses.clear()
    peer.wait(lambda: peer.status("motion_scaling"), "a further report")
