"""Masters of others with another number of buttons, at nodes."""

from typing import TYPE_CHECKING

import pytest

from foreign_hand import WHERE, Hand
from teleop_core.graph import topics

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


@pytest.mark.parametrize(
    ("places", "released", "pressed"),
    [
        ([0, -1, 1], (0, 0), (1, 0)),
        ([0, 1, 2], (0, 0, 0, 0, 0, 0), (1, 0, 0, 0, 0, 0)),
        ([5, 1, 2], (0, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 1)),
    ],
    ids=["two buttons", "six buttons", "another order"],
)
def test_the_clutch_of_any_device_holds_the_slave(
    peer: "Peer", places: list[int], released: tuple[int, ...], pressed: tuple[int, ...]
) -> None:
    peer.start("motion_scaling", joy_buttons=places, feedback_timeout=5.0)
    hand = Hand(peer)
    hand.engage(*released)
    assert hand.moved(*released) > 5e-4
    assert hand.moved(*pressed) == 0.0
    assert hand.moved(*released) > 5e-4


def test_a_device_with_too_few_buttons_is_told_what_to_set(peer: "Peer") -> None:
    peer.start("motion_scaling")
    hand = Hand(peer)

    def told() -> bool:
        hand.move(1, 0)
        peer.send(topics.SLAVE_SETPOINT_CP, 0, WHERE)
        return "set joy_buttons=[0, -1, 1]" in peer.status("motion_scaling").message

    peer.wait(told, "a warning")
