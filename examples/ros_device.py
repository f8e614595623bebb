"""Replace the simulated master by your own device: a plain ROS 2 node.

Start the rest of the graph first, in other terminals or in the background::

    motion_scaling & inverse_kinematics & slave & slave_sim &

The device needs no part of this package, only the topics: it sends its pose and its buttons, and receives the force
that it should apply. It rests until teleop/state reports that the slave follows; before that, the slave moves to its
start.
"""

import math
import sys

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default, qos_profile_sensor_data
from sensor_msgs.msg import Joy

SECONDS = 4.0


class Device(Node):
    """A stylus that moves 20 mm to the left and back, repeatedly."""

    def __init__(self) -> None:
        super().__init__("my_device")
        quality = qos_profile_sensor_data  # best effort: only the newest sample matters
        self._poses = self.create_publisher(PoseStamped, "master/measured_cp", quality)
        self._buttons = self.create_publisher(Joy, "master/buttons", quality)
        self.create_subscription(WrenchStamped, "master/servo_cf", self._push, quality)
        self.create_subscription(PoseStamped, "slave/measured_cp", self._look, quality)
        latched = qos_profile_action_status_default  # reliable; a late subscriber receives the last message
        self.create_subscription(DiagnosticArray, "teleop/state", self._know, latched)
        self.forces, self.seen, self.ticks = 0, list[float](), 0
        self.is_followed = False
        self.create_timer(0.002, self._tick)

    def _tick(self) -> None:
        """Send one sample; a real device would read its encoders here."""
        pose, buttons = PoseStamped(), Joy(buttons=[0, 0, 0])
        pose.header.stamp = buttons.header.stamp = self.get_clock().now().to_msg()
        pose.header.frame_id = buttons.header.frame_id = "master_base"
        self.ticks += self.is_followed
        pose.pose.position.x = 0.01 * (math.cos(math.pi * 0.002 * self.ticks) - 1.0)
        pose.pose.orientation.w = 1.0
        self._poses.publish(pose)
        self._buttons.publish(buttons)

    def _push(self, message: WrenchStamped) -> None:
        """Receive a force [N]; a real device would apply it to the hand."""
        self.forces += 1

    def _look(self, message: PoseStamped) -> None:
        """Receive the pose of the slave; the master's x is the slave's -y."""
        if self.is_followed:
            self.seen.append(float(message.pose.position.y))

    def _know(self, message: DiagnosticArray) -> None:
        """Receive the state of the slave: ALIGNING, FOLLOWING or CLUTCHED."""
        self.is_followed = message.status[0].message.startswith("FOLLOWING")


def main() -> int:
    """Move the slave for some seconds; print its distance and the number of received forces."""
    rclpy.init()
    device = Device()
    begin = device.get_clock().now().nanoseconds
    while device.ticks * 0.002 < SECONDS:
        rclpy.spin_once(device, timeout_sec=0.1)
        if device.ticks == 0 and device.get_clock().now().nanoseconds - begin > 60e9:
            print("nobody follows: start the rest of the graph first, as this file says")
            return 1
    width = max(device.seen) - min(device.seen)
    print(f"slave: {1e3 * width:.1f} mm wide; {device.forces} forces for {device.ticks} samples")
    rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
