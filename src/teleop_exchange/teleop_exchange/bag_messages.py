"""Messages of poses and buttons in bags of others, ROS 1 and 2, as rows of numbers.

Messages are read by the rosbags library. Since that takes 20 µs each, those that are alike are read
as one array: the library's own writer tells where the numbers stand in the bytes.
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
"""Messages that hold a pose: where it is in them, and whether they have a header."""
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
JOY = "sensor_msgs/msg/Joy"
BATCH = 8192
_MARK_S, _MARK_NS = 0x5A17C3B1, 0x31234567 % SECOND_NS
Raw = tuple[int, bytes]
"""Time of recording [ns] and bytes of a message."""
Frames = tuple[str, str]
"""Parent and child frame of a pose; empty where a message names none."""


class Rows(NamedTuple):
    """Poses of some messages: stamps and times of recording [ns] and rows (n, 7), w before x."""

    stamp_ns: Stamps
    log_ns: Stamps
    poses: Array


class PoseReader:
    """Reader of the poses of one topic.

    Args:
        typestore: Types of the bag, from rosbags.
        ros_type: Type of the messages.
        is_ros2: Whether the bytes are CDR, not those of ROS 1.
        frame: Child frame that is taken; empty for any.
        parent: Frame in which it is taken; empty for any.

    Attributes:
        taken: Parent and child frame of the poses taken; None before the first.
    """

    def __init__(
        self, typestore: Any, ros_type: str, *, is_ros2: bool, frame: str = "", parent: str = ""
    ) -> None:
        self._types, self._type, self._is_ros2 = typestore, ros_type, is_ros2
        self._frame, self._parent = frame, parent
        self.taken: Frames | None = None
        self._place: _Place | None = None
        self._is_new = True

    def message(self, data: bytes) -> Any:
        """Message with the attributes of its type."""
        read = self._types.deserialize_cdr if self._is_ros2 else self._types.deserialize_ros1
        return read(data, self._type)

    def blocks(self, messages: Iterable[Raw]) -> Iterator[Rows]:
        """Poses, some messages at a time.

        Raises:
            UnknownNameError: Poses of several frames, or in several, would be mixed.
        """
        stream = iter(messages)
        while batch := list(islice(stream, BATCH)):
            yield self._read(batch)

    def _read(self, batch: list[Raw]) -> Rows:
        if self._is_new:
            self._is_new = False
            self._place = self._learned(batch[0][1])
        logs = np.array([log for log, _ in batch], np.int64)
        stamps, poses = logs.copy(), np.full((len(batch), 7), np.nan)
        left = np.ones(len(batch), np.bool_)
        if self._place is not None:
            left = self._place.read([data for _, data in batch], stamps, poses)
        is_there = np.ones(len(batch), np.bool_)
        for i in np.flatnonzero(left).tolist():
            is_there[i] = self._one(batch[i][1], i, stamps, poses)
        return Rows(stamps[is_there], logs[is_there], poses[is_there])

    def _one(self, data: bytes, i: int, stamps: Stamps, poses: Array) -> bool:
        """Read one message; False if it does not hold the frame."""
        part = self._part(self.message(data))
        if part is None:
            return False
        header, place, turn = part
        if header is not None:
            stamps[i] = _stamp(header)
        poses[i] = (place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z)
        return True

    def _part(self, message: Any) -> tuple[Any, Any, Any] | None:
        """Header or None, place and turn in a message; None if it lacks the frame.

        Raises:
            UnknownNameError: The pose is of another frame, or in another, than those before.
        """
        chosen = None
        for part in self._parts(message):
            parent, child = named = names_of(part)
            if self._frame not in {"", child} or self._parent not in {"", parent}:
                continue
            if self.taken not in {None, named}:
                self._refuse(named)
            self.taken, chosen = named, part
        if chosen is None:
            return None
        if hasattr(chosen.pose, "translation"):
            return chosen.header, chosen.pose.translation, chosen.pose.rotation
        return chosen.header, chosen.pose.position, chosen.pose.orientation

    def _parts(self, message: Any) -> list["_Part"]:
        """Poses in a message."""
        if self._type in TRANSFORMS:
            return [_Part(t.header, t.child_frame_id, t.transform) for t in message.transforms]
        where, has_header = POSES[self._type]
        pose = message
        for name in filter(None, where.split(".")):
            pose = getattr(pose, name)
        header = message.header if has_header else None
        return [_Part(header, getattr(message, "child_frame_id", ""), pose)]

    def _refuse(self, named: Frames) -> NoReturn:
        """Refuse a pose of other frames than those before."""
        assert self.taken is not None
        index = 0 if self.taken[0] != named[0] else 1
        option = ("--parent (poses stand in several)", "--frame (poses are of several)")[index]
        raise UnknownNameError(option, "", sorted({self.taken[index], named[index]}))

    def _learned(self, data: bytes) -> "_Place | None":
        """Where the numbers stand in messages like this one; None if that cannot be told."""
        message = self.message(data)
        part = self._part(message)
        if part is None or (self._type in TRANSFORMS and len(message.transforms) != 1):
            return None
        header, place, turn = part
        marks = [(1.0 + i) * 1.2345e-101 for i in range(7)]
        for target, names, values in ((place, "xyz", marks[:3]), (turn, "xyzw", marks[3:])):
            for name, value in zip(names, values, strict=True):
                setattr(target, name, value)
        if header is not None:
            header.stamp.sec, header.stamp.nanosec = _MARK_S, _MARK_NS
        write = self._types.serialize_cdr if self._is_ros2 else self._types.serialize_ros1
        marked = bytes(write(message, self._type))
        pose_at = marked.find(struct.pack("<7d", *marks))
        stamp_at = marked.find(struct.pack("<II", _MARK_S, _MARK_NS)) if header is not None else -1
        if pose_at < 0 or len(marked) > len(data) or (header is not None and stamp_at < 0):
            return None
        return _Place(data, pose_at, stamp_at, has_count=header is not None and not self._is_ros2)


class _Place:
    """Where the numbers stand in messages whose strings before the pose are alike.

    Args:
        first: One of these messages.
        pose_at: Where x, y, z, x, y, z, w begin.
        stamp_at: Where seconds and nanoseconds begin; -1 without.
        has_count: Whether a number of the message stands before the stamp, as in ROS 1.
    """

    def __init__(self, first: bytes, pose_at: int, stamp_at: int, *, has_count: bool) -> None:
        self._size, self._pose, self._stamp = len(first), pose_at, stamp_at
        same = np.ones(pose_at, np.bool_)
        if stamp_at >= 0:
            same[stamp_at - 4 * has_count : stamp_at + 8] = False
        self._same = np.flatnonzero(same)
        self._expected = np.frombuffer(first, np.uint8)[self._same]

    def read(self, batch: list[bytes], stamps: Stamps, poses: Array) -> NDArray[np.bool_]:
        """Write stamps and poses of the messages that are alike; which ones are left to be read."""
        sizes = np.array([len(data) for data in batch])
        left = sizes != self._size
        alike = np.flatnonzero(~left)
        joined = b"".join([data for data in batch if len(data) == self._size])
        rows = np.frombuffer(joined, np.uint8).reshape(-1, self._size)
        sound = (rows[:, self._same] == self._expected).all(axis=1)
        left[alike[~sound]] = True
        rows, at = rows[sound], alike[sound]
        numbers = np.ascontiguousarray(rows[:, self._pose : self._pose + 56]).view("<f8")
        poses[at] = numbers[:, [0, 1, 2, 6, 3, 4, 5]]
        if self._stamp >= 0:
            parts = np.ascontiguousarray(rows[:, self._stamp : self._stamp + 8]).view("<u4")
            stamps[at] = parts[:, 0].astype(np.int64) * SECOND_NS + parts[:, 1]
        return left


def _stamp(header: Any) -> int:
    """Stamp of a header [ns]."""
    return int(header.stamp.sec) * SECOND_NS + int(header.stamp.nanosec)


def plain(name: str) -> str:
    """Name of a topic or frame without the slash before it."""
    return name.removeprefix("/")


class _Part(NamedTuple):
    """A pose in a message, with its header or None, and its child frame or an empty text."""

    header: Any
    child: str
    pose: Any


def names_of(part: _Part) -> Frames:
    """Parent and child frame of a pose."""
    return "" if part.header is None else plain(part.header.frame_id), plain(part.child)


def frames(message: Any) -> list[Frames]:
    """Parent and child frames in a message of transforms."""
    return [(plain(t.header.frame_id), plain(t.child_frame_id)) for t in message.transforms]


class JoyReader:
    """Reader of the buttons of a topic of Joy messages.

    Args:
        typestore: Types of the bag.
        is_ros2: Whether the bytes are CDR.
        numbers: Number of clutch, fixture and mode among the buttons; -1 for none.
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
            # Both formats begin with four bytes and the stamp; what follows is often the same.
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
        if len(self._known) < 4096:
            self._known[data[12:]] = row
        return row
