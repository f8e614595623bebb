"""What nodes say in their logs, once, for people who look on."""

from typing import TYPE_CHECKING, Any

import pytest

from teleop_core.graph import topics
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


HOME = load_robot("rcrt1").home


def said(node: Any, text: str) -> list[Any]:
    return [line for line in node.stderr.read_text().splitlines() if text in line]


@pytest.mark.slow
def test_a_node_says_who_commands_it_when_that_changes(peer: "Peer") -> None:
    node = peer.start("slave")
    assert said(node, "comes from") == []
    peer.send(topics.SLAVE_SERVO_JP, 1, HOME)
    peer.wait(lambda: said(node, "/slave/servo_jp now comes from /peer"), "who commands")
    ticks = peer.status("slave").number("ticks")
    peer.wait_value("slave", "ticks", lambda now: now > ticks + 3000)
    assert len(said(node, "comes from")) == 1
    peer.ros.destroy(peer.publisher(topics.SLAVE_SERVO_JP))
    peer.wait(lambda: said(node, "/slave/servo_jp now comes from no node"), "nobody")
