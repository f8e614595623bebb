"""Devices of the host as the hand of a node: read in a thread, lost, found again, or not there."""

import signal
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rclpy.logging import get_logger

from teleop_core.base.errors import SessionError
from teleop_core.graph.topics import HAND_BUTTONS
from teleop_core.hand.input_device import UNHELD
from teleop_core.hand.operators import OPERATORS
from teleop_core.hand.operators.remote import AHEAD, RemoteHand
from teleop_core.middleware.ros import ROS
from teleop_core.nodes.device_hand import DeviceHand
from virtual_pad import VirtualPad

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros
NODE = SimpleNamespace(ros=SimpleNamespace(get_logger=lambda: get_logger("devices")), platform=ROS)


@pytest.fixture
def pad() -> Iterator[VirtualPad]:
    pytest.importorskip("pygame")
    from virtual_pad import VirtualPad

    made = VirtualPad()
    yield made
    made.unplug()


def opened(hand: RemoteHand, force: float = 0.0, **parameters: object) -> DeviceHand:
    operator: Any = OPERATORS.find("gamepad")
    return DeviceHand(NODE, hand, operator.opens, operator.parameters(**parameters), lambda: force)


class Clock:
    """Asks the hand at 1000 Hz of real time, as the node does."""

    def __init__(self, hand: RemoteHand) -> None:
        self._hand, self._ticks, self._begin = hand, 0, time.monotonic()
        self.row = np.zeros(12)

    def until(self, condition: Any, what: str) -> None:
        deadline = time.monotonic() + 30.0
        while not condition():
            assert time.monotonic() < deadline, what
            while self._ticks * 1e-3 < time.monotonic() - self._begin:
                times: Any = (self._ticks + 1 + np.arange(AHEAD)) * 1e-3
                self._ticks += AHEAD
                self.row = self._hand.motion(times)[-1]
            time.sleep(0.002)


def test_a_gamepad_moves_the_hand_while_it_is_held_and_is_let_go_of_when_it_is_lost(pad: VirtualPad) -> None:
    hand = RemoteHand()
    clock, device = Clock(hand), opened(hand, force=0.5, speed=0.1)
    try:
        assert device.concerns()[0].endswith(UNHELD)
        assert "Virtual" in device.values()["hand"]
        pad.move("left x", 1.0)
        pad.press("right shoulder")
        clock.until(lambda: clock.row[0] > 0.01, "the stylus goes right")
        assert abs(clock.row[1]) + abs(clock.row[2]) < 1e-9
        assert device.concerns() == []
        pad.press("right shoulder", is_pressed=False)
        clock.until(lambda: clock.row[6] == 1.0, "a pressed clutch")
        pad.press("right shoulder")
        clock.until(lambda: hand.is_held, "a second grip")
        pad.unplug()
        clock.until(lambda: "disconnected; waits for it" in str(device.concerns()), "a lost gamepad")
        clock.until(lambda: clock.row[6] == 1.0, "a pressed clutch")
    finally:
        device.close()


def test_a_gamepad_that_comes_back_is_taken_again(pad: VirtualPad) -> None:
    from virtual_pad import VirtualPad

    hand = RemoteHand()
    clock, device = Clock(hand), opened(hand)
    try:
        pad.unplug()
        clock.until(lambda: "disconnected" in device.concerns()[0], "a lost gamepad")
        other = VirtualPad()
        try:
            clock.until(lambda: "disconnected" not in device.concerns()[0], "the gamepad is back")
            other.press("left shoulder")
            clock.until(lambda: hand.is_held, "a grip")
        finally:
            other.unplug()
    finally:
        device.close()


def test_no_gamepad_is_an_error_of_whoever_opens_it() -> None:
    pytest.importorskip("pygame")
    with pytest.raises(SessionError, match="no gamepad; found: none"):
        opened(RemoteHand())


@pytest.mark.parametrize("name", ["gamepad", "spacemouse"])
def test_a_node_without_its_device_says_so_in_one_line_and_ends(peer: "Peer", name: str) -> None:
    node = peer.start("operator", wait="", kind=name, remote__delay=0.1)
    assert node.wait() == 2
    said = node.stderr.read_text()
    assert "configure refused: no " in said
    assert "found: none" in said
    assert "Traceback" not in said


def test_a_node_with_a_hand_ends_in_order(peer: "Peer") -> None:
    buttons = peer.listen(HAND_BUTTONS)
    node = peer.start("operator", kind="remote", patience=0.0)
    peer.wait(lambda: buttons.take() > 100, "samples")
    assert node.end(signal.SIGINT) == 0
