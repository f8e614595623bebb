"""Picture streams: the newest picture of each camera of a session, with its age."""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from teleop_core.bags.ros_types import deserialise
from teleop_core.middleware.platform import Owner, Qos, Taker
from teleop_core.nodes.streams import message_type

TYPE = "sensor_msgs/msg/CompressedImage"
_END = "/image_raw/compressed"
_LOOK = 1.0
"""Time between two looks for new cameras [s]."""
MOST = 8
"""Largest number of cameras that a page shows."""
LARGEST = 2_000_000
"""Largest picture that a page shows [bytes]."""
FORMS = {b"\xff\xd8": "jpeg", b"\x89P": "png"}
"""Forms of pictures that browsers show, by their first bytes."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of a camera.

    Attributes:
        data: Encoded picture.
        form: ``jpeg`` or ``png``.
        stamp_ns: Time of the capture [ns].
        age: Time from the capture until now [s].
    """

    data: bytes
    form: str
    stamp_ns: int
    age: float


def picture_of(data: bytes) -> tuple[bytes, str, int] | None:
    """Encoded picture, its form and its stamp [ns], from a message; None for one that a page cannot show."""
    with suppress(ValueError):
        message: Any = deserialise(data, TYPE)
        encoded, stamp = bytes(message.data), message.header.stamp
        form = FORMS.get(encoded[:2])
        if form is not None and len(encoded) <= LARGEST:
            return encoded, form, stamp.sec * 1_000_000_000 + stamp.nanosec
    return None


class PictureStreams:
    """Newest pictures of all cameras, which are found by the type of their topics.

    Args:
        owner: Node that reads the topics.
    """

    def __init__(self, owner: Owner) -> None:
        self._owner, self._looked = owner, -_LOOK
        self._takers: dict[str, Taker] = {}
        self._newest: dict[str, tuple[bytes, str, int]] = {}

    def take(self) -> dict[str, Picture]:
        """Newest picture of each camera, by the camera's name; cameras without a picture are missing."""
        now = 1e-9 * self._owner.platform.monotonic_ns()
        if now - self._looked > _LOOK:
            self._looked = now
            self._find()
        for name, taker in self._takers.items():
            newest = None
            while (taken := taker.take()) is not None:
                newest = taken.data
            if newest is not None and (found := picture_of(newest)) is not None:
                self._newest[name] = found
        now_ns = self._owner.platform.time_ns()
        return {name: Picture(*found, 1e-9 * (now_ns - found[2])) for name, found in self._newest.items()}

    def _find(self) -> None:
        for topic, types in self._owner.ros.get_topic_names_and_types():
            name = camera_name(topic)
            if TYPE in types and name not in self._takers and len(self._takers) < MOST:
                # Best effort with one message: the page needs the newest picture, and no sender waits for it.
                quality = Qos(depth=1, is_reliable=False)
                self._takers[name] = self._owner.ros.create_taker(message_type(TYPE), topic, quality)


def camera_name(topic: str) -> str:
    """Name of a camera in words: ``front`` for ``/camera/front/image_raw/compressed``."""
    return topic.removesuffix(_END).removeprefix("/").removeprefix("camera/")


def age_text(age: float) -> str:
    """Age of a picture in words."""
    if age < 0.0:
        return f"{-1000.0 * age:.0f} ms ahead of this clock"
    return f"{1000.0 * age:.0f} ms old" if age < 1.0 else f"{age:.1f} s old"
