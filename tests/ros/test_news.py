"""What nodes say in their logs, once, for people who look on."""

from typing import TYPE_CHECKING, Any

import pytest

from teleop_core.graph import topics
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from ros.conftest import NodeProcess, Peer

pytestmark = pytest.mark.ros

HOME = load_robot("rcrt1").home


def said(node: "NodeProcess", text: str) -> list[Any]:
    return [line for line in node.stderr.read_text().splitlines() if text in line]


def test_a_node_says_once_what_it_is_reads_and_writes(peer: "Peer") -> None:
    node = peer.start("slave", arm="left")
    (line,) = said(node, "at work")
    assert "left.slave" in line
    assert "robot rcrt1, 1000 steps a second; reads /left/slave/servo_jp" in line
    assert "writes /left/slave/setpoint_js, " in line


@pytest.mark.slow
def test_a_node_says_who_commands_it_when_that_changes(peer: "Peer") -> None:
    node = peer.start("slave")
    assert said(node, "comes from") == []
    peer.send(topics.SLAVE_SERVO_JP, 1, HOME)
    peer.wait(lambda: said(node, "/slave/servo_jp comes from /peer"), "who commands")
    ticks = peer.status("slave").number("ticks")
    peer.wait_value("slave", "ticks", lambda now: now > ticks + 3000)
    assert len(said(node, "comes from")) == 1
    peer.node.destroy_publisher(peer.publisher(topics.SLAVE_SERVO_JP))
    peer.wait(lambda: said(node, "/slave/servo_jp comes from nobody any more"), "nobody")
