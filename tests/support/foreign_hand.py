"""A hand at a device of others, for tests of nodes."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped, TransformStamped, WrenchStamped
from sensor_msgs.msg import Joy

from teleop_core.graph import topics
from teleop_core.middleware.platform import Qos

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

MS = 1_000_000
WHERE = [0.4, 0.0, -0.2, 1.0, 0.0, 0.0, 0.0]
"""Where the slave is that it moves: position [m] and quaternion."""


class Hand:
    """A hand that moves 10 µm a sample, with the buttons of a foreign device."""

    def __init__(self, peer: "Peer") -> None:
        self._peer, self._stamp, self._x = peer, 0, 0.0
        name = f"/{topics.MASTER_BUTTONS.name}"
        self._publisher = peer.ros.create_publisher(Joy, name, Qos())
        peer.wait(self._publisher.get_subscription_count, "a reader of the buttons")
        self.answers = peer.listen(topics.SLAVE_SERVO_CP)

    def move(self, *buttons: object) -> None:
        self._stamp += MS
        self._x += 1e-5
        joy = Joy(buttons=list(buttons))
        joy.header.stamp.nanosec = self._stamp
        self._publisher.publish(joy)
        pose = [self._x, -0.06, -0.08, 1.0, 0.0, 0.0, 0.0]
        self._peer.send(topics.MASTER_MEASURED_CP, self._stamp, pose)

    def engage(self, *buttons: object) -> None:
        """Tell where the slave is until it follows."""

        def engaged() -> bool:
            self.move(*buttons)
            self._peer.send(topics.SLAVE_SETPOINT_CP, self._stamp, WHERE)
            return self.answers.take() >= 3

        self._peer.wait(engaged, "motion_scaling at work")

    def moved(self, *buttons: object) -> Any:
        """How far the answers to some hundred samples go [m]."""

        def answered() -> bool:
            self.move(*buttons)
            return self.answers.take() > 200

        self.answers.forget()
        self._peer.wait(answered, "answers")
        return np.ptp(np.array(self.answers.values)[-100:, :3], axis=0).max()


AXES = ["+y", "+z", "+x"]
"""The master's axes in those of :class:`Device`, and as a matrix."""
ROWS = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
TYPES = {"PoseStamped": PoseStamped, "TransformStamped": TransformStamped, "Pose": Pose}


def stamp(message: Any, time_ns: int) -> None:
    """Give a message a time [ns]."""
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(time_ns, 10**9)


def turning(peer: "Peer", condition: Callable[[], object]) -> Callable[[], object]:
    """A condition, looked at once the test's own node had a turn."""
    return lambda: peer.spin() or condition()


class Device:
    """A stylus of the test, in millimetres: it says where it is 500 times a second."""

    def __init__(self, peer: "Peer", kind: str = "PoseStamped") -> None:
        self.place, self.buttons, self.force = np.zeros(3), [0, 0], np.zeros(3)
        self._peer, self._kind, quality = peer, TYPES[kind], Qos(depth=5, is_reliable=False)
        self._poses = peer.ros.create_publisher(self._kind, "touch/pose", quality)
        self._joy = peer.ros.create_publisher(Joy, "touch/joy", quality)
        peer.ros.create_subscription(WrenchStamped, "touch/force", self._push, quality)
        self._timer = peer.ros.create_timer(0.002, self._tick)

    bridge: Any
    has_stamps = True

    def stop(self) -> None:
        self._peer.ros.destroy(self._timer)

    def _push(self, message: Any) -> None:
        force = message.wrench.force
        self.force = np.array([force.x, force.y, force.z])

    def _tick(self) -> None:
        message, (x, y, z) = self._kind(), self.place.tolist()
        if self._kind is not Pose and self.has_stamps:
            stamp(message, self._peer.time_ns())
        if self._kind is TransformStamped:
            there, turn = message.transform.translation, message.transform.rotation
        else:
            pose = message if self._kind is Pose else message.pose
            there, turn = pose.position, pose.orientation
        there.x, there.y, there.z, turn.w = x, y, z, 1.0
        self._poses.publish(message)
        self._joy.publish(Joy(buttons=self.buttons))
