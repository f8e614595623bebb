"""A hand at a device of others, for tests of nodes."""

from typing import TYPE_CHECKING, Any

import numpy as np
from sensor_msgs.msg import Joy

from teleop_core.graph import topics

if TYPE_CHECKING:
    from ros.conftest import Peer

MS = 1_000_000
WHERE = [0.4, 0.0, -0.2, 1.0, 0.0, 0.0, 0.0]
"""Where the slave is that it moves: position [m] and quaternion."""


class Hand:
    """A hand that moves 10 µm a sample, with the buttons of a foreign device."""

    def __init__(self, peer: "Peer") -> None:
        self._peer, self._stamp, self._x = peer, 0, 0.0
        name = f"/{topics.MASTER_BUTTONS.name}"
        self._publisher = peer.node.create_publisher(Joy, name, 10)
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
