"""Bag messages: converts poses and buttons in ROS 1 and 2 bags of other programs to rows of numbers.

The rosbags library reads the messages; reading a message takes about 6 µs.
"""

import struct
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from teleop_core.base.errors import UnknownNameError
from teleop_core.kernels.geometry import Array
from teleop_exchange.times import SECOND_NS, Stamps

POSES = {
    "geometry_msgs/msg/PoseStamped": ("pose", True),
    "geometry_msgs/msg/PoseWithCovarianceStamped": ("pose.pose", True),
    "nav_msgs/msg/Odometry": ("pose.pose", True),
    "geometry_msgs/msg/TransformStamped": ("transform", True),
    "geometry_msgs/msg/Pose": ("", False),
    "geometry_msgs/msg/PoseWithCovariance": ("pose", False),
    "geometry_msgs/msg/Transform": ("", False),
}
"""Message types with a pose: the field of the pose, and whether the message has a header."""
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
JOY = "sensor_msgs/msg/Joy"
BATCH = 8192
_MOST_KNOWN = 4096  # number of different messages that are kept to be recognised
Raw = tuple[int, bytes]
"""Time of recording [ns] and bytes of a message."""
Frames = tuple[str, str]
"""Parent and child frame of a pose; empty if a message names no frame."""


class Rows(NamedTuple):
    """Poses of some messages: stamps [ns], times of recording [ns], and rows (n, 7) with w before x."""

    stamp_ns: Stamps
    log_ns: Stamps
    poses: Array


class PoseReader:
    """Reader of the poses of one topic.

    Args:
        typestore: Types of the bag, from rosbags.
        ros_type: Type of the messages.
        is_ros2: Whether the bytes are CDR; False for bytes of ROS 1.
        frame: Child frame of the wanted poses; empty for any.
        parent: Parent frame of the wanted poses; empty for any.

    Attributes:
        taken: Parent and child frame of the used poses; None before the first pose.
    """

    def __init__(self, typestore: Any, ros_type: str, *, is_ros2: bool, frame: str = "", parent: str = "") -> None:
        self._types, self._type, self._is_ros2 = typestore, ros_type, is_ros2
        self._frame, self._parent = frame, parent
        self.taken: Frames | None = None

    def message(self, data: bytes) -> Any:
        """Message with the attributes of its type."""
        read = self._types.deserialize_cdr if self._is_ros2 else self._types.deserialize_ros1
        return read(data, self._type)

    def frames(self, messages: Iterable[Raw]) -> list[Frames]:
        """All parent and child frames in messages of transforms, in the order of their appearance."""
        found: dict[Frames, None] = {}
        known: set[bytes] = set()
        for _, data in messages:
            # Messages of one transform begin with 16 bytes that vary and end with seven numbers; the bytes between them
            # hold the names, and repeat.
            middle = data[16:-56]
            if middle in known:
                continue
            parts = self._parts(self.message(data))
            found |= dict.fromkeys(map(names_of, parts))
            if len(parts) == 1 and len(known) < _MOST_KNOWN:
                known.add(middle)
        return list(found)

    def blocks(self, messages: Iterable[Raw]) -> Iterator[Rows]:
        """Poses, in blocks of some messages.

        Raises:
            UnknownNameError: Poses of several child frames, or in several parent frames, would be mixed.
        """
        stream = iter(messages)
        while batch := list(islice(stream, BATCH)):
            found = [row for raw in batch for row in self._rows(*raw)]
            times = np.array([row[:2] for row in found], np.int64).reshape(-1, 2)
            poses = np.array([row[2] for row in found], np.float64).reshape(-1, 7)
            yield Rows(times[:, 0], times[:, 1], poses)

    def _rows(self, log_ns: int, data: bytes) -> Iterator[tuple[int, int, tuple[float, ...]]]:
        """Stamp, time of recording [ns] and pose, of each pose of the frame in a message.

        Trackers may send several samples in a message, each with its own stamp.

        Raises:
            UnknownNameError: The pose has another child or parent frame than earlier poses.
        """
        for part in self._parts(self.message(data)):
            parent, child = named = names_of(part)
            if self._frame not in {"", child} or self._parent not in {"", parent}:
                continue
            if self.taken not in {None, named}:
                self._refuse(named)
            self.taken, pose = named, part.pose
            is_transform = hasattr(pose, "translation")
            place, turn = (pose.translation, pose.rotation) if is_transform else (pose.position, pose.orientation)
            stamp = log_ns if part.header is None else _stamp(part.header)
            yield stamp, log_ns, (place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z)

    def _parts(self, message: Any) -> list["_Part"]:
        if self._type in TRANSFORMS:
            return [_Part(t.header, t.child_frame_id, t.transform) for t in message.transforms]
        where, has_header = POSES[self._type]
        pose = message
        for name in filter(None, where.split(".")):
            pose = getattr(pose, name)
        header = message.header if has_header else None
        return [_Part(header, getattr(message, "child_frame_id", ""), pose)]

    def _refuse(self, named: Frames) -> NoReturn:
        """Raise an error for a pose whose frames differ from those of earlier poses."""
        assert self.taken is not None
        index = 0 if self.taken[0] != named[0] else 1
        option = ("--parent (poses stand in several)", "--frame (poses are of several)")[index]
        raise UnknownNameError(option, "", sorted({self.taken[index], named[index]}))


def _stamp(header: Any) -> int:
    """Stamp of a header [ns]."""
    return int(header.stamp.sec) * SECOND_NS + int(header.stamp.nanosec)


def plain(name: str) -> str:
    """Name of a topic or frame without its leading slash."""
    return name.removeprefix("/")


class _Part(NamedTuple):
    """A pose in a message, with the header (or None) and the child frame (or an empty text)."""

    header: Any
    child: str
    pose: Any


def names_of(part: _Part) -> Frames:
    """Parent and child frame of a pose."""
    return "" if part.header is None else plain(part.header.frame_id), plain(part.child)


class JoyReader:
    """Reader of the buttons of a topic of Joy messages.

    Args:
        typestore: Types of the bag.
        is_ros2: Whether the bytes are CDR.
        numbers: Indices of clutch, fixture and mode among the buttons; -1 if there is no such button.
    """

    def __init__(self, typestore: Any, *, is_ros2: bool, numbers: tuple[int, ...]) -> None:
        self._types, self._is_ros2, self._numbers = typestore, is_ros2, numbers
        self._known: dict[bytes, list[int]] = {}

    def message(self, data: bytes) -> Any:
        """Message with the attributes of its type."""
        read = self._types.deserialize_cdr if self._is_ros2 else self._types.deserialize_ros1
        return read(data, JOY)

    def read(self, messages: Iterable[Raw]) -> tuple[Stamps, Stamps, NDArray[np.uint8]]:
        """Stamps and times of recording (n,) [ns], and pressed or not (n, 3)."""
        stamps, logs, rows = [], [], []
        for log, data in messages:
            # Both formats begin with four bytes and the stamp; the bytes after them are often equal.
            sec, nanosec = struct.unpack_from("<II", data, 4)
            row = self._known.get(data[12:])
            if row is None:
                row = self._row(data)
            stamps.append(sec * SECOND_NS + nanosec)
            logs.append(log)
            rows.append(row)
        pressed = np.array(rows, np.uint8).reshape(-1, len(self._numbers))
        return np.array(stamps, np.int64), np.array(logs, np.int64), pressed

    def _row(self, data: bytes) -> list[int]:
        buttons = self.message(data).buttons
        row = [int(0 <= n < len(buttons) and buttons[n] != 0) for n in self._numbers]
        if len(self._known) < _MOST_KNOWN:
            self._known[data[12:]] = row
        return row
