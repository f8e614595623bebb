"""A small CRTK arm of somebody else, with three joints, and what is wrong with it."""

import math
from collections import deque
from collections.abc import Callable
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from foreign_hand import stamp
from teleop_core.middleware.platform import Platform, Publisher, Qos

crtk = pytest.importorskip("crtk_msgs.msg")

SPEED = 0.017
"""Of its joints [rad/s]: as fast as a hundredth of a radian is commanded in a sine of two seconds.
Where commands come late it catches up no faster, or its motion would be over before its speeds
could be told."""


class ForeignArm:
    """The arm, on whatever platform.

    Args:
        platform: Where it is.
        faults: What is wrong with it.
    """

    def __init__(self, platform: Platform, faults: tuple[str, ...] = ()) -> None:
        self.platform, self.faults = platform, set(faults)
        self.state = "DISABLED" if "disabled" in faults else "ENABLED"
        self.q, self.busy_until_ns = [0.1, 0.2, 0.3], 0
        self.goal, self.home = list(self.q), list(self.q)
        self.past: deque[list[float]] = deque(maxlen=50)
        self.last_ns = platform.time_ns()
        node = platform.node("foreign", use_global_arguments=False, enable_rosout=False)
        self.executor = platform.executor()
        self.executor.add_node(node)
        self.states: Publisher | None = None
        if "no state" not in faults:
            self.states = node.create_publisher(crtk.OperatingState, "PSM/operating_state", Qos())
        self.measured = node.create_publisher(JointState, "PSM/measured_js", Qos(is_reliable="qos" not in faults))
        if "owners" in faults:
            node.create_publisher(JointState, "PSM/measured_js", Qos())
        self.setpoint = node.create_publisher(JointState, "PSM/setpoint_js", Qos())
        self.pose = node.create_publisher(JointState if "type" in faults else PoseStamped, "PSM/measured_cp", Qos())
        self.wanted = node.create_publisher(PoseStamped, "PSM/setpoint_cp", Qos())
        node.create_subscription(crtk.StringStamped, "PSM/state_command", self.command, Qos())
        node.create_subscription(JointState, "PSM/move_jp", self.move, Qos())
        node.create_subscription(JointState, "PSM/servo_jp", self.servo, Qos())
        node.create_timer(0.01, self.tick)

    def serve(self, goes_on: Callable[[], bool] = lambda: True) -> int:
        """Be there."""
        while goes_on():
            self.executor.spin_once(0.1)
        return 0

    def command(self, message: Any) -> None:
        if "ignores" in self.faults:
            return
        if "jumps" in self.faults and message.string == "resume":
            self.q = list(self.goal)
        word = {"pause": "PAUSED", "resume": "ENABLED"}.get(message.string)
        if "any word" in self.faults:
            word = word or "DISABLED"
        self.state = word or self.state

    def move(self, message: Any) -> None:
        if "jumps" in self.faults and self.state == "PAUSED":
            self.goal = list(message.position)
        if "ignores" not in self.faults and (self.state == "ENABLED" or "moves paused" in self.faults):
            self.goal = list(message.position)
            self.busy_until_ns = self.platform.monotonic_ns() + 150_000_000

    def servo(self, message: Any) -> None:
        if self.state == "ENABLED" and "ignores" not in self.faults:
            self.goal = list(message.position)

    def lying(self, dt: float) -> tuple[list[float], list[float]]:
        """Joints and speeds as this arm tells them, a time after it told the last ones [s]."""
        self.past.append(list(self.q))
        before = self.past[-2] if len(self.past) > 1 else self.q
        told, speed = list(self.q), [(a - b) / dt for a, b in zip(self.q, before, strict=True)]
        if "frozen" in self.faults:
            told = list(self.home)
        if "scaled" in self.faults:
            told = [h + 0.5 * (q - h) for h, q in zip(self.home, told, strict=True)]
        if "late" in self.faults:
            told = self.past[0]
        if "speeds" in self.faults:
            speed = [2.0 * v for v in speed]
        if "bulge" in self.faults and 0.004 < self.q[0] - self.home[0] < 0.0045:  # for three hundredths of a second
            told[2] += 0.01
        return told, speed

    def tip(self, now_ns: int, turn: float = 0.0) -> PoseStamped:
        """Pose of the tip, which the first joint moves; it turns with its way [rad/m]."""
        pose = PoseStamped()
        stamp(pose, now_ns)
        pose.pose.position.x = way = 0.3 * (self.q[0] - self.home[0])
        length = 0.5 if "unit" in self.faults else 1.0
        pose.pose.orientation.w = length * math.cos(0.5 * turn * way)
        pose.pose.orientation.z = length * math.sin(0.5 * turn * way)
        return pose

    def tick(self) -> None:
        now_ns, is_busy = self.platform.time_ns(), False
        # Ten milliseconds, more on a busy machine: speeds are those of the time that passed.
        dt = max(1e-9 * (now_ns - self.last_ns), 1e-3)
        self.last_ns = now_ns
        for i in range(0 if "jumps" in self.faults and self.state == "PAUSED" else 3):
            step = min(max(self.goal[i] - self.q[i], -SPEED * dt), SPEED * dt)
            self.q[i] += step
            is_busy = is_busy or abs(step) > 0.0
        is_busy = (is_busy or self.platform.monotonic_ns() < self.busy_until_ns) and "never busy" not in self.faults
        if self.states is not None:
            state = crtk.OperatingState(state=self.state, is_homed=True, is_busy=is_busy)
            stamp(state, now_ns)
            self.states.publish(state)
        if "detour" in self.faults:
            share = min(max(100.0 * (self.q[0] - self.home[0]), 0.0), 1.0)
            self.q[2] = self.home[2] + 0.01 * math.sin(math.pi * share)
        told, speed = self.lying(dt)
        setpoint = JointState(name=["a", "b", "c"], position=list(self.q))
        stamp(setpoint, now_ns)
        self.setpoint.publish(setpoint)
        joints = JointState(name=["a", "c", "b"] if "swapped" in self.faults else ["a", "b", "c"], position=told)
        if self.faults & {"speeds", "honest"}:
            joints.velocity = speed
        if "stamp" not in self.faults:
            stamp(joints, now_ns + 300_000_000 * ("future" in self.faults))
        if "nan" in self.faults:
            joints.position[1] = math.nan
        if "length" in self.faults:
            joints.velocity = [0.0]
        self.measured.publish(joints)
        self.wanted.publish(self.tip(now_ns))
        if "type" not in self.faults:
            pose = self.tip(now_ns, 30.0 if "turning" in self.faults else 0.0)
            pose.pose.position.x *= "frozen tip" not in self.faults
            self.pose.publish(pose)
