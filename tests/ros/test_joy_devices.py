"""Masters of others with another number of buttons, as real messages at real nodes."""

import numpy as np
import pytest
from sensor_msgs.msg import Joy

from teleop_core import topics

pytestmark = pytest.mark.ros

MS = 1_000_000
WHERE = [0.4, 0.0, -0.2, 1.0, 0.0, 0.0, 0.0]


class Hand:
    """A hand that moves 10 µm a sample, with the buttons of a foreign device."""

    def __init__(self, peer):
        self._peer, self._stamp, self._x = peer, 0, 0.0
        name = f"/{topics.MASTER_BUTTONS.name}"
        self._publisher = peer.node.create_publisher(Joy, name, 10)
        peer.wait(self._publisher.get_subscription_count, "a reader of the buttons")
        self.answers = peer.listen(topics.SLAVE_SERVO_CP)

    def move(self, *buttons):
        self._stamp += MS
        self._x += 1e-5
        joy = Joy(buttons=list(buttons))
        joy.header.stamp.nanosec = self._stamp
        self._publisher.publish(joy)
        pose = [self._x, -0.06, -0.08, 1.0, 0.0, 0.0, 0.0]
        self._peer.send(topics.MASTER_MEASURED_CP, self._stamp, pose)

    def engage(self, *buttons):
        """Tell where the slave is until it follows."""

        def engaged():
            self.move(*buttons)
            self._peer.send(topics.SLAVE_SETPOINT_CP, self._stamp, WHERE)
            return self.answers.take() >= 3

        self._peer.wait(engaged, "motion_scaling at work")

    def moved(self, *buttons):
        """How far the answers to some hundred samples go [m]."""

        def answered():
            self.move(*buttons)
            return self.answers.take() > 200

        self.answers.forget()
        self._peer.wait(answered, "answers")
        return np.ptp(np.array(self.answers.values)[-100:, :3], axis=0).max()


@pytest.mark.parametrize(
    ("places", "released", "pressed"),
    [
        ([0, -1, 1], (0, 0), (1, 0)),
        ([0, 1, 2], (0, 0, 0, 0, 0, 0), (1, 0, 0, 0, 0, 0)),
        ([5, 1, 2], (0, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 1)),
    ],
    ids=["two buttons", "six buttons", "another order"],
)
def test_the_clutch_of_any_device_holds_the_slave(peer, places, released, pressed):
    peer.start("motion_scaling", joy_buttons=places, feedback_timeout=5.0)
    hand = Hand(peer)
    hand.engage(*released)
    assert hand.moved(*released) > 5e-4
    assert hand.moved(*pressed) == 0.0
    assert hand.moved(*released) > 5e-4


def test_a_device_with_too_few_buttons_is_told_what_to_set(peer):
    peer.start("motion_scaling")
    hand = Hand(peer)

    def told():
        hand.move(1, 0)
        peer.send(topics.SLAVE_SETPOINT_CP, 0, WHERE)
        return "set joy_buttons=[0, -1, 1]" in peer.status("motion_scaling").message

    peer.wait(told, "a warning")
