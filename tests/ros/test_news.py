"""What nodes say in their logs, once, for people who look on."""

from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from ros.conftest import NodeProcess, Peer

pytestmark = pytest.mark.ros


def said(node: "NodeProcess", text: str) -> list[Any]:
    return [line for line in node.stderr.read_text().splitlines() if text in line]


def test_a_node_says_once_what_it_is_reads_and_writes(peer: "Peer") -> None:
    node = peer.start("slave", arm="left")
    (line,) = said(node, "at work")
    assert "left.slave" in line
    assert "robot rcrt1, 1000 steps a second; reads /left/slave/servo_jp" in line
    assert "writes /left/slave/setpoint_js, " in line
