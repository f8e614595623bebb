"""A plain controller of a real arm, in rclpy alone: the arm is an RCRT-1 with names of its own.

python plain_controller.py joint_state|forward_command|joint_trajectory|crtk

It says where its joints are, among those of a gripper, 500 times a second, and goes to what it is
told. What it is told on ``misbehave`` it does: ``names``, ``order``, ``stale``, ``back``, ``jump``,
``mute``, ``strange``; nothing ends it. On ``witness`` it says how far the first command was from
where it stood, in its largest joint, and the largest step since: both in shares of what a rated
speed makes up in a period of its own.
"""

import math
import signal
import sys
import threading
import time

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory

JOINTS = ("base", "shoulder", "slide", "roll", "pitch", "yaw")  # ours theta1, theta2, d3 ...
STANDS = (0.1, -1.9, 0.4, 0.0, 0.1, 0.0)  # the shoulder counts the other way
SPEED = (3.0, 3.0, 0.06, 7.0, 13.0, 13.0)
ORDER = ("yaw", "pitch", "roll", "slide", "shoulder", "base")  # of forward commands
COMMANDS = {
    "joint_state": (JointState, "/robot_joint_command", "/robot_joint_states"),
    "forward_command": (
        Float64MultiArray, "/forward_position_controller/commands", "/joint_states"
    ),
    "joint_trajectory": (
        JointTrajectory, "/joint_trajectory_controller/joint_trajectory", "/joint_states"
    ),
    "crtk": (JointState, "/PSM1/servo_jp", "/PSM1/measured_js"),
}  # fmt: skip
RATE, BANDWIDTH = 500.0, 200.0


class Controller(Node):
    """Joints whose speed is in proportion to their distance from what they are told."""

    def __init__(self, kind: str) -> None:
        super().__init__("plain_controller")
        message, told, says = COMMANDS[kind]
        self._sender = self.create_publisher(JointState, says, 10)
        self._witness = self.create_publisher(Float64MultiArray, "witness", 10)
        take = {
            "forward_command": self._array, "joint_trajectory": self._trajectory
        }.get(kind, self._joint_state)  # fmt: skip
        self._taken = [
            (self.create_subscription(message, told, take, 1000), take),  # none is lost
            (self.create_subscription(String, "misbehave", self._misbehave, 10), self._misbehave),
        ]
        self.place = dict(zip(JOINTS, STANDS, strict=True))
        self.goal = dict(self.place)
        self.is_leading, self.arrival = False, 0.0
        self.first, self.largest, self.mode, self.frozen_ns = math.nan, 0.0, "", 0
        self.begun, self.steps = time.monotonic(), 0
        self.told, self.told_at = dict(self.place), 0.0

    def until_next(self) -> float:
        """Time until the next step is due [s]."""
        return max(self.begun + (self.steps + 1) / RATE - time.monotonic(), 0.0)

    def cycle(self) -> None:
        """Take all that has come, then make the steps that are due."""
        for subscription, take in self._taken:
            handle, kind = subscription.handle, subscription.msg_type
            with handle:
                while (taken := handle.take_message(kind, False)) is not None:
                    take(taken[0])
        self._tick()

    def _misbehave(self, message: String) -> None:
        self.mode, self.frozen_ns = message.data, time.time_ns()
        if self.mode == "jump":
            self.place["base"] += 0.5
            self.goal["base"] += 0.5

    def _go(self, goal: dict[str, float]) -> None:
        start = self.goal if self.is_leading else self.place
        share = max(
            abs(goal[n] - start[n]) / (s / RATE) for n, s in zip(JOINTS, SPEED, strict=True)
        )
        if not self.is_leading:
            self.first, self.is_leading = share, True
        self.largest = max(self.largest, share)
        self.goal = goal

    def _joint_state(self, message: JointState) -> None:
        self._go(dict(zip(message.name, message.position, strict=True)))

    def _array(self, message: Float64MultiArray) -> None:
        self._go(dict(zip(ORDER, message.data, strict=True)))

    def _trajectory(self, message: JointTrajectory) -> None:
        (point,) = message.points
        ahead = point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec
        self.arrival = time.monotonic() + ahead
        self._go(dict(zip(message.joint_names, point.positions, strict=True)))

    def _tick(self) -> None:
        due = int(RATE * (time.monotonic() - self.begun)) - self.steps
        for _ in range(due):
            self._step()
        self.steps += due
        if self.mode != "mute":
            self._sender.publish(self._said())
        if self.steps % 50 < due:
            self._witness.publish(Float64MultiArray(data=[self.first, self.largest]))

    def _step(self) -> None:
        left = self.arrival - time.monotonic()  # to the end of a trajectory's point
        for name, most in zip(JOINTS, SPEED, strict=True):
            off = self.goal[name] - self.place[name]
            wanted = off / left if left > 1.0 / RATE else BANDWIDTH * off
            self.place[name] += min(max(wanted, -1.1 * most), 1.1 * most) / RATE

    def _said(self) -> JointState:
        names = ["finger", *JOINTS]
        if self.mode == "order":
            names.reverse()
        message = JointState(name=names)
        # Speeds are means since the last message, which may be some steps ago on a busy machine.
        now = time.monotonic()
        went = {name: self.place[name] - self.told[name] for name in JOINTS}
        speeds = {"finger": 0.0} | {name: way / (now - self.told_at) for name, way in went.items()}
        self.told, self.told_at = dict(self.place), now
        values = {"finger": 0.3, **self.place}
        message.position = [values[name] for name in names]
        message.velocity = [speeds[name] for name in names]
        message.effort = [math.nan] * len(names)  # as joint_state_broadcaster says what it lacks
        if self.mode == "names":
            message.name = [name.replace("slide", "lift") for name in names]
        elif self.mode == "strange":
            message.name = [f"left_{name}" for name in names]
        now_ns = time.time_ns()
        if self.mode == "stale":
            now_ns -= 1_000_000_000
        elif self.mode == "back":
            now_ns = 2 * self.frozen_ns - now_ns
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(now_ns, 1_000_000_000)
        return message


def main() -> int:
    """Be a controller until it is told to end."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    controller = Controller(sys.argv[1])
    # No executor: it would wait, wake and look through its entities for each message anew, and on a
    # slow machine fall ever farther behind what it is told.
    while not ended.wait(controller.until_next()):
        controller.cycle()
    return 0


if __name__ == "__main__":
    sys.exit(main())
