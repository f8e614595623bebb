"""Ends: in order, though nodes were shut down before."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from lifecycle_msgs.msg import Transition

from teleop_core.bags.reader import Bag

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


def test_a_node_that_was_shut_down_by_service_still_ends_well(peer: "Peer", tmp_path: Path) -> None:
    node = peer.start("recorder", out=str(tmp_path / "bag"))
    assert peer.change("recorder", Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert (tmp_path / "bag" / "metadata.yaml").exists()
    assert node.end() == 0, node.stderr.read_text()


def test_a_transition_that_there_is_not_is_refused_and_the_node_goes_on(peer: "Peer") -> None:
    node = peer.start("slave")
    assert not peer.change("slave", Transition.TRANSITION_ACTIVATE)
    assert not peer.change("slave", Transition.TRANSITION_CONFIGURE)
    before = peer.status("slave").number("ticks")
    peer.wait_value("slave", "ticks", lambda ticks: ticks > before + 500)
    assert node.end() == 0


@pytest.fixture
def composed(compose: Callable[..., object]) -> Any:
    """Process of the composed session, all its nodes active."""
    return compose(operator={"approach_time": 1.0, "patience": 0.0})


@pytest.mark.parametrize("name", ["slave", "recorder"])
def test_a_composed_session_of_which_a_node_was_shut_down_ends_well(
    peer: "Peer", composed: Any, tmp_path: Path, name: str
) -> None:
    peer.wait_value("slave", "ticks", lambda ticks: ticks > 100)
    assert peer.change(name, Transition.TRANSITION_ACTIVE_SHUTDOWN)
    peer.wait_state(name, "finalized")
    composed.send_signal(signal.SIGTERM)
    assert composed.wait() == 0
    assert (tmp_path / "bag" / "metadata.yaml").exists()
    assert Bag(tmp_path / "bag").topics["slave/measured_js"].count > 0
