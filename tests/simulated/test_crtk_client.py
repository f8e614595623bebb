"""CRTK in simulated time: a stock client moves an arm to its goal and drives its joints."""

from typing import TYPE_CHECKING

import numpy as np
from sensor_msgs.msg import JointState

from teleop_core.graph import topics
from teleop_core.middleware.world import Qos
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


def test_a_client_without_names_moves_an_arm_to_its_goal_and_then_drives_it(peer: "Peer") -> None:
    move = peer.ros.create_publisher(JointState, "/slave/move_jp", Qos(depth=10))
    drive = peer.ros.create_publisher(JointState, "/slave/servo_jv", Qos(depth=10))
    peer.start("slave")
    setpoints = peer.listen(topics.SLAVE_SETPOINT_JS)
    peer.wait(lambda: setpoints.take() and move.get_subscription_count(), "an arm at home")
    home = load_robot("rcrt1").home
    goal = home + np.where(np.arange(len(home)) == 0, 0.02, 0.0)
    move.publish(JointState(position=goal.tolist()))

    def first() -> float:
        setpoints.take()
        return float(setpoints.values[-1][0])

    peer.wait(lambda: abs(first() - goal[0]) < 1e-9, "the goal")
    np.testing.assert_allclose(setpoints.values[-1][: len(goal)], goal, atol=1e-9)
    back = np.where(np.arange(len(goal)) == 0, -0.1, 0.0)

    def is_back() -> bool:
        drive.publish(JointState(velocity=back.tolist()))
        return first() < home[0]

    peer.wait(is_back, "the way back")
    np.testing.assert_allclose(setpoints.values[-1][1 : len(goal)], goal[1:], atol=1e-9)
