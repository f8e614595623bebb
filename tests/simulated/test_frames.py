"""Frames, markers and copies for displays come from the nodes that know them, not from the recorder."""

import sys
from functools import partial
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING

import pytest

from teleop_core.bags.markers import MARKERS
from teleop_core.bags.transforms import ROBOT_DESCRIPTION, TF
from teleop_core.graph.graph import build_graph
from teleop_core.graph.topics import SLAVE_MEASURED_JS, Topic
from teleop_core.middleware.platform import Qos
from teleop_core.nodes.crews import Processes, crews
from teleop_core.nodes.display import displayed
from teleop_core.nodes.streams import Subscription, message_type

if TYPE_CHECKING:
    from simulated.conftest import SimulatedPeer

DRAWN = (TF, MARKERS, ROBOT_DESCRIPTION, displayed(SLAVE_MEASURED_JS))


@pytest.fixture
def tf2_msgs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The package of the messages of ``/tf``, which is part of ROS."""
    message = type("TFMessage", (), {"__module__": "tf2_msgs.msg"})
    monkeypatch.setitem(sys.modules, "tf2_msgs", ModuleType("tf2_msgs"))
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", SimpleNamespace(TFMessage=message))


def came(subscription: Subscription) -> int:
    """Number of messages since the last call."""
    number = 0
    while subscription.take() is not None:
        number += 1
    return number


@pytest.mark.usefixtures("tf2_msgs")
def test_a_recorder_that_is_killed_blanks_no_other_tool(peer: "SimulatedPeer", tmp_path: Path) -> None:
    recorder = peer.start("recorder", out=str(tmp_path / "bag"))
    (_, sides) = crews(build_graph(), Processes.SIDES)
    for nodes in reversed([*sides.values()]):
        peer.side(*nodes)
    seen = {topic: Subscription(peer, topic, f"/{topic.name}".replace("//", "/")) for topic in DRAWN}
    described = seen.pop(ROBOT_DESCRIPTION)
    peer.wait(lambda: came(described), "the robot's description")
    for topic, one in seen.items():
        peer.wait(partial(came, one), topic.name)
    recorder.kill()
    rates = {topic.name: _rate(peer, topic, seen[topic]) for topic in seen}
    assert rates[TF.name] == pytest.approx(40.0, rel=0.1)
    assert rates[displayed(SLAVE_MEASURED_JS).name] == pytest.approx(40.0, rel=0.1)
    assert rates[MARKERS.name] == pytest.approx(20.0, rel=0.1)


def _rate(peer: "SimulatedPeer", topic: Topic, subscription: Subscription) -> float:
    """Messages of a topic per second of the next two seconds."""
    peer.wait(lambda: came(subscription), topic.name)
    begin_ns, number = peer.time_ns(), 0
    while peer.time_ns() - begin_ns < 2_000_000_000:
        peer.spin()
        number += came(subscription)
    return number / 2.0


def test_nodes_send_copies_and_read_streams_for_frames_only_while_somebody_looks(peer: "SimulatedPeer") -> None:
    peer.side(*crews(build_graph(), Processes.SIDES)[1]["slave_side"])
    copy = displayed(SLAVE_MEASURED_JS)
    readers = peer.ros.create_publisher(message_type(copy.ros_type), copy.name, Qos()).get_subscription_count
    peer.wait(lambda: not readers(), "frames that read nothing")
    markers = Subscription(peer, MARKERS, f"/{MARKERS.name}")
    peer.wait(readers, "frames that read copies")
    markers.close()
    peer.wait(lambda: not readers(), "frames that read nothing")
