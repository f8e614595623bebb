"""Parameters that a button changes."""

from typing import TYPE_CHECKING, Any

import pytest
from rcl_interfaces.srv import GetParameters

from foreign_hand import Hand

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

PRESS, RELEASE = (0, 0, 1), (0, 0, 0)


def mode(peer: "Peer") -> Any:
    request = GetParameters.Request(names=["mode"])
    answer = peer.call(GetParameters, "/motion_scaling/get_parameters", request)
    return answer.values[0].string_value


def press(peer: "Peer", hand: Hand, expected: str) -> None:
    """Press the mode button until the parameter shows the mode, and release it."""

    def shown() -> Any:
        hand.move(*PRESS)
        return mode(peer) == expected

    peer.wait(shown, f"parameter mode {expected}")
    hand.moved(*RELEASE)


def test_mode_as_a_parameter_follows_the_button_and_can_be_set_back(peer: "Peer") -> None:
    peer.start("motion_scaling", feedback_timeout=5.0)
    hand = Hand(peer)
    hand.engage(*RELEASE)
    coarse = hand.moved(*RELEASE)
    press(peer, hand, "fine")
    assert hand.moved(*RELEASE) == pytest.approx(0.1 * coarse, rel=0.2)
    (result,) = peer.set("motion_scaling", mode="coarse")
    assert result.successful
    assert hand.moved(*RELEASE) == pytest.approx(coarse, rel=0.2)
    press(peer, hand, "fine")
    assert peer.set("motion_scaling", fine_gain=0.2)[0].successful
    assert hand.moved(*RELEASE) == pytest.approx(0.2 * coarse, rel=0.2)  # and the mode stays
    assert mode(peer) == "fine"
