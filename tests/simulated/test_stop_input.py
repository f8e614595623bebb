"""Stop input: what a process hears of a stop button that was pressed while it stood still."""

from typing import TYPE_CHECKING, Any

import pytest
from std_msgs.msg import Bool

from teleop_core.middleware.platform import Qos
from teleop_core.nodes.operation import STOP_TOPIC, StopButton, StopInput

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


def test_a_button_that_was_released_before_it_was_found_is_released_after_a_standstill_too(peer: "Peer") -> None:
    button = StopButton(peer)
    button.say(is_pressed=True)
    button.say(is_pressed=False)
    heard: list[Any] = []
    stop = StopInput(peer)

    def take() -> bool:
        heard.extend(stop.take(is_idle=True))
        return False

    try:
        stop.take()
        since = peer.now()
        peer.wait(lambda: button.listeners == 3 and peer.now() > since + 0.3, "a while")
        peer.wait(lambda: take() or heard, "its state")
    finally:
        stop.close()
    assert heard == [False]


@pytest.mark.parametrize("is_idle", [True, False])
def test_what_a_button_said_before_it_was_found_counts_unless_the_listener_is_idle(peer: "Peer", is_idle: bool) -> None:
    button = peer.ros.create_publisher(Bool, STOP_TOPIC, Qos())
    for _ in range(3):
        button.publish(Bool(data=False))
    heard: list[Any] = []
    stop = StopInput(peer)

    def take() -> bool:
        heard.extend(stop.take(is_idle=is_idle))
        return False

    try:
        peer.wait(lambda: button.get_subscription_count() == 2, "both who hear reliable senders")
        assert not take()
        assert "peer" in stop.unheard()
        button.publish(Bool(data=False))
        peer.wait(lambda: take() or heard, "the fourth message")
        assert not stop.unheard()
    finally:
        stop.close()
    assert heard == [False] if is_idle else heard == [True, False]
