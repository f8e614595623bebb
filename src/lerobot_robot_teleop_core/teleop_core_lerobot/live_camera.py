"""Live camera: pictures of a running session's camera, or of any other, from its topic, each with its true age."""

from typing import Any, Self

import numpy as np
import simplejpeg
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.bags.ros_types import deserialise
from teleop_core.graph.topics import Kind, Quality
from teleop_core.middleware.platform import Platform
from teleop_core_lerobot.side import SECOND_NS

_TYPE = "sensor_msgs/msg/CompressedImage"
_QUEUE = 10  # pictures that wait; with a single one, a late picture would push out a newer one
_TURN = 0.05  # longest wait before the clock is read again [s]
Pixels = NDArray[np.uint8]


class LiveCamera:
    """Camera of a live session, read from its topic of ``CompressedImage`` (JPEG).

    A picture that was taken before the newest one and comes after it is left out. Pictures are decoded when they are
    asked for.

    Args:
        topic: Name of the topic, such as ``camera/front/image_raw/compressed``, or of a camera of a scene: ``front``.
        platform: Platform of the session; None for ROS.

    Attributes:
        topic: Full name of the topic.
    """

    def __init__(self, topic: str, platform: Platform | None = None) -> None:
        name = topic.strip("/")
        self.topic, self._platform = name if "/" in name else f"camera/{name}/image_raw/compressed", platform
        self._guest: Any = None
        self._data, self._stamp_ns, self._is_new = b"", -1, False

    @property
    def is_running(self) -> bool:
        """Whether it listens."""
        return self._guest is not None

    def begin(self) -> None:
        """Begin to listen.

        Raises:
            SessionError: It listens already.
            TeleopError: ROS is not installed.
        """
        if self._guest is not None:
            raise tc.SessionError(f"{self.topic} is read already; end that first")
        try:  # all but cameras runs without ROS
            from teleop_core.middleware.ros import ROS
            from teleop_core.nodes.discovery import choose_transport
            from teleop_core.nodes.guest import Guest
            from teleop_core.nodes.streams import Subscription
        except ImportError as error:
            raise tc.TeleopError("live cameras need rclpy; pip install 'teleop_core[ros]' brings it") from error
        if self._platform is None:
            choose_transport()
        self._guest = Guest("lerobot_camera", platform=self._platform or ROS)
        self._data, self._stamp_ns, self._is_new = b"", -1, False
        topic = tc.Topic(self.topic, Kind.REPORT, quality=Quality.STREAM, message=_TYPE)
        self._taker = Subscription(self._guest, topic, f"/{self.topic}", _QUEUE)

    def end(self) -> None:
        """Stop listening; does nothing if it does not listen."""
        if self._guest is not None:
            self._guest.close()
            self._guest = None

    def __enter__(self) -> Self:
        self.begin()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    @property
    def age(self) -> float:
        """Time since the capture of the newest picture [s], by the clock of this machine; infinite before the first.

        Raises:
            SessionError: It does not listen.
        """
        self._take()
        return self._age()

    def _age(self) -> float:
        if self._stamp_ns < 0:
            return float("inf")
        return (self._listening.platform.time_ns() - self._stamp_ns) / SECOND_NS

    def newest(self, oldest: float = float("inf")) -> Pixels:
        """Newest picture that has come, without waiting.

        Args:
            oldest: Largest allowed age [s].

        Returns:
            Colours (height, width, 3), red, green and blue.

        Raises:
            SessionError: It does not listen.
            TimeoutError: No picture has come yet, or the newest one is older.
        """
        self._take()
        if self._stamp_ns < 0:
            raise TimeoutError(f"no picture has come on {self.topic}")
        if (age := self._age()) > oldest:
            raise TimeoutError(f"the newest picture of {self.topic} is {age:.3g} s old, at most {oldest:g} s allowed")
        self._is_new = False
        return self._decoded()

    def next(self, timeout: float) -> Pixels:
        """Newest picture that was not returned before; waits for one.

        Args:
            timeout: Longest wait [s].

        Raises:
            SessionError: It does not listen.
            TimeoutError: No new picture came in this time.
        """
        platform = self._listening.platform
        until_ns = platform.monotonic_ns() + round(timeout * SECOND_NS)
        self._take()
        while not self._is_new:
            left = (until_ns - platform.monotonic_ns()) / SECOND_NS
            if left <= 0.0:
                raise TimeoutError(f"no new picture came on {self.topic} in {timeout:g} s; is its camera running?")
            self._taker.wait(min(left, _TURN))
            self._take()
        self._is_new = False
        return self._decoded()

    @property
    def _listening(self) -> Any:
        if self._guest is None:
            raise tc.SessionError(f"{self.topic} is not read; begin first")
        return self._guest

    def _take(self) -> None:
        """Take all messages that have come, and keep the picture that was captured last."""
        self._listening  # noqa: B018 raises if it does not listen
        while (taken := self._taker.take()) is not None:
            stamp = deserialise(taken.data, _TYPE).header.stamp
            stamp_ns = stamp.sec * SECOND_NS + stamp.nanosec
            if stamp_ns > self._stamp_ns:
                self._data, self._stamp_ns, self._is_new = taken.data, stamp_ns, True

    def _decoded(self) -> Pixels:
        message = deserialise(self._data, _TYPE)
        try:
            return np.asarray(simplejpeg.decode_jpeg(message.data.tobytes()))
        except ValueError as error:
            raise tc.ParameterError(self.topic, str(message.format), "pictures in JPEG") from error
