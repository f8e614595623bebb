"""Jaw bridge: a real gripper's controller in the place of the simulated jaw."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest
from std_msgs.msg import Float64MultiArray

from simulated_arms import controller
from teleop_core.graph.topics import SLAVE_JAW_MEASURED_JS, SLAVE_JAW_SERVO_JP
from teleop_core.middleware.platform import Qos

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

TOPICS = {
    "joint_state": ("/robot_joint_command", "/robot_joint_states"),
    "forward_command": ("/forward_position_controller/commands", "/joint_states"),
}
HELD = 0.1  # rad


class Gripper:
    """A controller of a gripper, its bridge, and the servers of jaw and arm."""

    def __init__(self, peer: "Peer") -> None:
        self.peer, self.witnessed = peer, [0.0, 0.0]
        self.measured = peer.listen(SLAVE_JAW_MEASURED_JS)
        peer.ros.create_subscription(Float64MultiArray, "/witness", self._see, Qos())

    def _see(self, message: Any) -> None:
        self.witnessed = list(message.data)

    def angle(self) -> Any:
        return self.measured.values[-1][0] if self.measured.take() else None

    def command(self, angle: float, until: Callable[[], object], what: str) -> None:
        """Command an angle, as a hand does, until something is so."""

        def goes_on() -> object:
            self.peer.send(SLAVE_JAW_SERVO_JP, self.peer.time_ns(), [angle])
            return until()

        self.peer.wait(goes_on, what)

    def is_at(self, angle: float) -> bool:
        found = self.angle()
        return found is not None and abs(found - angle) < 2e-3

    def says(self, node: str, text: str) -> bool:
        status = self.peer.status(node)
        return status is not None and text in status.message


def gripper(peer: Any, kind: str) -> Gripper:
    peer.foreign("controller", controller(kind, "gripper"))
    found = Gripper(peer)
    command, state = TOPICS[kind]
    peer.start(
        "jaw_bridge", kind=kind, joint="knuckle", scale=-1.0, offset=0.8, command_topic=command, state_topic=state
    )
    peer.start("jaw")
    peer.start("slave")
    return found


@pytest.mark.parametrize("kind", sorted(TOPICS))
def test_a_gripper_that_holds_something_opens_only_once_the_hand_has_closed(peer: "Peer", kind: str) -> None:
    found = gripper(peer, kind)
    peer.wait(lambda: found.is_at(HELD), "where the gripper is")
    found.command(0.8, lambda: found.says("jaw", "close the hand first"), "a jaw that holds")
    assert found.is_at(HELD)
    assert found.says("jaw_bridge", "waits for the hand")
    assert peer.status("jaw_bridge").number("commands") == 0
    found.command(0.0, lambda: found.is_at(0.0), "a closed gripper")
    found.command(0.8, lambda: found.is_at(0.8), "an open gripper")
    peer.wait(lambda: peer.spin() or found.witnessed[1] > 0.0, "a witness")
    assert max(found.witnessed) <= 2.5  # 1.2 of a rated speed, over two periods at most
