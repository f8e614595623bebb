"""A plain controller of a real arm, in rclpy alone: an RCRT-1 with names of its own, a UR5e, or a gripper.

python plain_controller.py joint_state|forward_command|joint_trajectory|crtk
    [rcrt1|ur5e|gripper [SEED]]

With a seed the arm stands somewhere near where it else does.
It says where its joints are, among those of a gripper, 500 times a second, and goes to what it is
told. What it is told on ``misbehave`` it does: ``names``, ``order``, ``stale``, ``back``, ``jump``,
``mute``, ``strange``; nothing ends it. On ``witness`` it says how far the first command was from
where it stood, in its largest joint, and the largest step since: both in shares of what a rated
speed makes up in a period of its own.
"""

import math
import random
import signal
import sys
import time
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory

ARMS = {
    "rcrt1": (
        ("base", "shoulder", "slide", "roll", "pitch", "yaw"),  # ours theta1, theta2, d3 ...
        (0.1, -1.9, 0.4, 0.0, 0.1, 0.0),  # the shoulder counts the other way
        (3.0, 3.0, 0.06, 7.0, 13.0, 13.0),
        ("yaw", "pitch", "roll", "slide", "shoulder", "base"),
    ),
    "ur5e": (
        tuple(f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")),
        (0.1, -1.5, 1.4, -1.5, -1.6, 0.2),
        (math.pi,) * 6,
        (),
    ),
    "gripper": (("knuckle",), (0.7,), (4.0,), ()),  # 0 open, 0.8 closed: it has gripped something
}
"""Names of the joints, where they stand, rated speeds, order of forward commands where another."""
COMMANDS = {
    "joint_state": (JointState, "/robot_joint_command", "/robot_joint_states"),
    "forward_command": (Float64MultiArray, "/forward_position_controller/commands", "/joint_states"),
    "joint_trajectory": (JointTrajectory, "/joint_trajectory_controller/joint_trajectory", "/joint_states"),
    "crtk": (JointState, "/PSM1/servo_jp", "/PSM1/measured_js"),
}
RATE, BANDWIDTH = 500.0, 200.0


class Controller:
    """Joints whose speed is in proportion to their distance from what they are told.

    Args:
        kind: What it takes.
        arm: Which joints.
        seed: Of where they stand; empty: where they always do.
        now, time_ns: Clock of motion [s], and of stamps [ns].

    Attributes:
        topics: Those it listens to: name, class of the messages, and what takes them.
        says: Topic of its joints.
    """

    def __init__(
        self,
        kind: str,
        arm: str = "rcrt1",
        seed: str = "",
        *,
        now: Callable[[], float] = time.monotonic,
        time_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self.joints, stands, self.rated, order = ARMS[arm]
        self.order = order or self.joints
        chance = random.Random(seed)
        off = [chance.uniform(-0.3, 0.3) if seed else 0.0 for _ in stands]
        message, told, self.says = COMMANDS[kind]
        take: Callable[[Any], None] = self._joint_state
        if kind in {"forward_command", "joint_trajectory"}:
            take = self._array if kind == "forward_command" else self._trajectory
        self.topics: Any = ((told, message, take), ("misbehave", String, self._misbehave))
        self.place = {j: s + o for j, s, o in zip(self.joints, stands, off, strict=True)}
        self.goal, self._now, self._time_ns = dict(self.place), now, time_ns
        self.is_leading, self.arrival = False, 0.0
        self.first, self.largest, self.mode, self.frozen_ns = math.nan, 0.0, "", 0
        self.speed, self.now, self.cycles = dict.fromkeys(self.joints, 0.0), now(), 0

    def cycle(self) -> tuple[JointState | None, Float64MultiArray | None]:
        """Go on by the time since the last cycle: what it says, and what it witnesses."""
        self._go_on()
        self.cycles += 1
        is_due = self.cycles % 50 == 0
        witness = Float64MultiArray(data=[self.first, self.largest]) if is_due else None
        return (None if self.mode == "mute" else self._said()), witness

    def _misbehave(self, message: String) -> None:
        self.mode, self.frozen_ns = message.data, self._time_ns()
        if self.mode == "jump":
            self.place[self.joints[0]] += 0.5
            self.goal[self.joints[0]] += 0.5

    def _go(self, goal: dict[str, float]) -> None:
        start = self.goal if self.is_leading else self.place
        share = max(abs(goal[n] - start[n]) / (s / RATE) for n, s in zip(self.joints, self.rated, strict=True))
        if not self.is_leading:
            self.first, self.is_leading = share, True
        self.largest = max(self.largest, share)
        self.goal = goal

    def _joint_state(self, message: JointState) -> None:
        self._go(dict(zip(message.name, message.position, strict=True)))

    def _array(self, message: Float64MultiArray) -> None:
        self._go(dict(zip(self.order, message.data, strict=True)))

    def _trajectory(self, message: JointTrajectory) -> None:
        (point,) = message.points
        ahead = point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec
        self.arrival = self._now() + ahead
        self._go(dict(zip(message.joint_names, point.positions, strict=True)))

    def _go_on(self) -> None:
        begun, self.now = self.now, self._now()
        passed = self.now - begun
        left = self.arrival - begun  # to the end of a trajectory's point
        share = passed / left if left > passed else 1.0 - math.exp(-BANDWIDTH * passed)
        for name, rated in zip(self.joints, self.rated, strict=True):
            most = 1.1 * rated * passed
            way = min(max(share * (self.goal[name] - self.place[name]), -most), most)
            self.place[name] += way
            self.speed[name] = way / passed

    def _said(self) -> JointState:
        names = ["finger", *self.joints]
        if self.mode == "order":
            names.reverse()
        message = JointState(name=names)
        values, speeds = {"finger": 0.3, **self.place}, {"finger": 0.0, **self.speed}
        message.position = [values[name] for name in names]
        message.velocity = [speeds[name] for name in names]
        message.effort = [math.nan] * len(names)  # as joint_state_broadcaster says what it lacks
        if self.mode == "names":
            message.name = [name.replace("slide", "lift") for name in names]
        elif self.mode == "strange":
            message.name = [f"left_{name}" for name in names]
        now_ns = self._time_ns()
        if self.mode == "stale":
            now_ns -= 1_000_000_000
        elif self.mode == "back":
            now_ns = 2 * self.frozen_ns - now_ns
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(now_ns, 1_000_000_000)
        return message


def take_all(takers: Any) -> None:
    """Take all that has come."""
    for subscription, take in takers:
        handle, kind = subscription.handle, subscription.msg_type
        with handle:
            while (taken := handle.take_message(kind, False)) is not None:
                take(taken[0])


def main() -> int:
    """Be a controller until it is told to end."""
    ended: list[int] = []  # an event's lock may be held where the signal comes
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: ended.append(number))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node, controller = rclpy.create_node("plain_controller"), Controller(*sys.argv[1:])
    takers = [
        (node.create_subscription(kind, name, take, 1000), take)  # none is lost
        for name, kind, take in controller.topics
    ]
    says = node.create_publisher(JointState, controller.says, 10)
    witness, due = node.create_publisher(Float64MultiArray, "witness", 10), time.monotonic()
    # No executor: it would wait, wake and look through its entities for each message anew, and on a
    # slow machine fall ever farther behind what it is told.
    while not ended:
        due = max(due + 1.0 / RATE, time.monotonic())
        time.sleep(max(due - time.monotonic(), 0.0))
        take_all(takers)
        for publisher, message in zip((says, witness), controller.cycle(), strict=True):
            if message is not None:
                publisher.publish(message)
    return 0


if __name__ == "__main__":
    sys.exit(main())
