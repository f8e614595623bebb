"""Console streams: the streams of an arm that a page reads, and the messages of a hand that a page publishes."""

import math
from collections import deque
from contextlib import suppress
from typing import Any

import numpy as np

from teleop_console.link import ArmView, ShownArm
from teleop_core.bags.messages import Layout, layout, read_any
from teleop_core.graph.topics import DISPLAY_MEASURED_CP, OPERATOR_BUTTONS, OPERATOR_JAW, OPERATOR_SERVO_CP, Topic
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.platform import Owner, Qos
from teleop_core.nodes.display import DisplayedStream
from teleop_core.nodes.streams import message_type

SILENCE = 1.0
"""Time without a message after which a stream is no longer fresh [s]. Then the page searches another source of the
stream."""
_PRESS = 0.12  # duration of a button press [s]
_FRAMES = 512  # largest number of samples of a stream that wait to be shown
_SCREEN_NS = 33_000_000  # delay of the page itself [ns]; equal to the default latency of a display
_RHYTHM_NS = 3_000_000_000  # time over which the frames of a display are counted [ns]


def now_of(owner: Owner) -> float:
    """Time of a clock that never goes back [s]."""
    return 1e-9 * owner.platform.monotonic_ns()


class NewestSample:
    """Newest sample of a stream of an arm."""

    def __init__(self, owner: Owner, topic: Topic, arm: ShownArm) -> None:
        self.topic, self._joints = topic, arm.robot.joint_names
        self._layout: Layout = layout(topic, self._joints)
        self._owner, self._own = owner, topic.of_arm(arm.name)
        self._stream = DisplayedStream(owner, self._own)
        self._is_of_slave = topic.name.startswith("slave/")
        self._waiting: deque[tuple[int, int, Array]] = deque(maxlen=_FRAMES)
        self._frames: deque[tuple[int, int]] = deque(maxlen=_FRAMES)  # arrival times of new samples, and their stamps

    def take(self) -> bool:
        """Store the newest sample for :meth:`show`; returns whether a new sample has arrived."""
        newest = self._stream.take()
        if newest is None:
            return False
        found: Any = self._layout.decode_one(newest.data) or read_any(self.topic.kind, newest.data, self._joints)
        if not isinstance(found, tuple) or not np.isfinite(found[1]).all():
            return False  # the nodes that use the topic refuse and count wrong messages
        now_ns = self._owner.platform.time_ns()
        self._waiting.append((now_ns, found[0], found[1].copy()))
        if not self._frames or self._frames[-1][1] != found[0]:
            self._frames.append((now_ns, found[0]))
        return True

    def rhythm(self) -> tuple[float, float]:
        """Number of new samples per second, and the delay of the newest sample [s]; NaN without recent samples."""
        since_ns = self._owner.platform.time_ns() - _RHYTHM_NS
        seen = [frame for frame in self._frames if frame[0] >= since_ns]
        if len(seen) < 2:
            return math.nan, math.nan
        return 1e9 * (len(seen) - 1) / (seen[-1][0] - seen[0][0]), 1e-9 * (seen[-1][0] - seen[-1][1])

    def show(self, view: ArmView) -> None:
        """Write the newest sample into `view`; samples of the slave are delayed as on the display."""
        seen_ns = view.stamp_ns.get(DISPLAY_MEASURED_CP.name) if self._is_of_slave else None
        while self._waiting and (seen_ns is None or self._waiting[0][0] <= seen_ns + _SCREEN_NS):
            _, view.stamp_ns[self.topic.name], view.streams[self.topic.name] = self._waiting.popleft()


class Hand:
    """Publishers of a person's hand on one arm."""

    def __init__(self, owner: Owner, arm: str) -> None:
        self._layout, self._pressed = layout(OPERATOR_SERVO_CP, ()), layout(OPERATOR_BUTTONS, ())
        self._platform = owner.platform
        self._lock, self._pressing = self._platform.lock(), self._platform.lock()
        self._publishers = [
            owner.ros.create_publisher(message_type(topic.kind.ros_type), f"/{topic.of_arm(arm).name}", Qos(depth=10))
            for topic in (OPERATOR_SERVO_CP, OPERATOR_BUTTONS, OPERATOR_JAW)
        ]
        self._closed = layout(OPERATOR_JAW, ())

    def hold(self, pose: Array) -> None:
        """Command a pose of the stylus."""
        with self._lock:
            data = self._layout.encode_one(self._platform.time_ns(), np.asarray(pose, np.float64))
            self._publishers[0].publish(data)

    def press(self, name: str) -> None:
        """Press a button and release it after a short time; several presses are sent one after the other."""
        self._platform.thread("press", lambda: self._press(name)).start()

    def _press(self, name: str) -> None:
        with self._pressing, suppress(RuntimeError):  # rclpy, once the link is closed
            self._say(np.array([0.0, name == "fixture", name == "mode"]))
            self._platform.sleep(_PRESS)
            self._say(np.zeros(3))
            # keep the button released for the same time, so that two presses are not received as one
            self._platform.sleep(_PRESS)

    def close_jaw(self, share: float) -> None:
        """Command the closed share of the jaw, 0 to 1."""
        with self._lock:
            self._publishers[2].publish(self._closed.encode_one(self._platform.time_ns(), np.array([share])))

    def _say(self, pressed: Array) -> None:
        with self._lock:
            self._publishers[1].publish(self._pressed.encode_one(self._platform.time_ns(), pressed))
