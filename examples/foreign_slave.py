"""Replace the simulated drives by your own drives: a plain ROS 2 node.

The stage ``slave`` still does everything else: states, emergency stop, limits, faults, motion to goals. Drives need no
part of this package, only three topics: they hold the joints at ``slave/setpoint_js``, publish the joint positions on
``slave/measured_js``, and brake when ``slave/operation`` requires it. Start the stage in another terminal or in the
background, then the drives, and test the arm::

    slave &
    python examples/foreign_slave.py &
    teleop conformance slave --yes
"""

import signal
import sys
import threading
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default, qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

# Joint positions of the arm, an RCRT-1, when it is switched on [rad, m]; it is not at home.
STANDS = {"theta1": 0.1, "theta2": 1.9, "d3": 0.4, "theta4": 0.0, "theta5": 0.1, "theta6": 0.0}
# Speed limits, a tenth above the rated speeds, which setpoints never exceed [rad/s, m/s].
FASTEST = {"theta1": 3.4, "theta2": 3.4, "d3": 0.068, "theta4": 8.0, "theta5": 15.0, "theta6": 15.0}
RATE = 500.0  # samples per second; the slave accepts any rate
BANDWIDTH = 200.0  # bandwidth of each joint's loop [rad/s]


class Drives(Node):
    """Joints whose speed is in proportion to their distance from the setpoint."""

    def __init__(self) -> None:
        super().__init__("my_drives")
        quality = qos_profile_sensor_data  # best effort: only the newest sample matters
        self._sender = self.create_publisher(JointState, "slave/measured_js", 10)  # for anybody
        self.create_subscription(JointState, "slave/setpoint_js", self._follow, quality)
        latched = qos_profile_action_status_default  # reliable; a late subscriber receives the last message
        self.create_subscription(DiagnosticArray, "slave/operation", self._obey, latched)
        self.setpoint, self.is_braked = dict(STANDS), False
        self.place, self.speed = dict(STANDS), dict.fromkeys(STANDS, 0.0)
        self.begun, self.steps = time.monotonic(), 0
        self.create_timer(1.0 / RATE, self._tick)

    def _follow(self, message: JointState) -> None:
        """Receive the newest setpoints; real drives would get them here."""
        self.setpoint.update(zip(message.name, message.position, strict=True))

    def _obey(self, message: DiagnosticArray) -> None:
        """Receive whether the brakes must hold the arm."""
        values = {entry.key: entry.value for entry in message.status[0].values}
        self.is_braked = float(values["is_braked"]) > 0.0

    def _tick(self) -> None:
        """Make all steps that are due, and publish the joint positions, as encoders do."""
        due = round(RATE * (time.monotonic() - self.begun)) - self.steps
        for _ in range(due):
            self._step()
        self.steps += due
        message = JointState(name=list(STANDS), effort=[0.0] * len(STANDS))
        message.header.stamp = self.get_clock().now().to_msg()
        message.position = [self.place[name] for name in STANDS]
        message.velocity = [self.speed[name] for name in STANDS]
        self._sender.publish(message)

    def _step(self) -> None:
        for name in STANDS:
            wanted = BANDWIDTH * (self.setpoint[name] - self.place[name])
            most = 0.0 if self.is_braked else FASTEST[name]
            self.speed[name] = min(max(wanted, -most), most)
            self.place[name] += self.speed[name] / RATE


def main() -> int:
    """Run the arm until the program is told to end."""
    ended = threading.Event()  # checked between two turns, because an exception could interrupt any statement
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    drives = Drives()
    while not ended.is_set():
        rclpy.spin_once(drives, timeout_sec=0.1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
