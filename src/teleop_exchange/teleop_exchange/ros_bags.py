"""ROS bags message by message: this package's reader reads MCAP, the rosbags library reads other storages.

This package's reader is faster, and a wrong length in a damaged file never makes it read beyond the end of the file.
The library's reader of ROS 1 bags gets a file object that also prevents such reads.
"""

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from teleop_core.bags import finding, ros_types
from teleop_core.bags.reader import Bag
from teleop_core.base.errors import RecordingError, TeleopWarning
from teleop_exchange.bag_messages import Raw, plain

_SHORT = re.compile(r"^(\w+)/(\w+)$")
_TRANSFORMS = "geometry_msgs/TransformStamped[] transforms"  # types of tf2_msgs, which that store lacks


class RosBag(Protocol):
    """An opened recording of ROS.

    Attributes:
        types: Message type of each topic with at least one message.
        typestore: Message types of the bag, from rosbags.
        is_ros2: Whether messages are CDR; False for messages of ROS 1.
    """

    types: dict[str, str]
    typestore: Any
    is_ros2: bool

    def raw(self, topic: str) -> Iterator[Raw]:
        """Messages of a topic in the order of the file: time of recording [ns], bytes."""


class OurBag:
    """A recording in MCAP, of ROS 2 or of ROS 1."""

    def __init__(self, bag: Bag) -> None:
        self._bag, self.is_ros2 = bag, not bag.is_ros1
        found = {name: info.type for name, info in bag.topics.items() if info.count}
        self.types, self.typestore = found, ros_types.typestore()
        if bag.is_ros1:  # ROS 1 types are written geometry_msgs/PoseStamped
            self.types = {name: _SHORT.sub(r"\1/msg/\2", kind) for name, kind in found.items()}
            self.typestore = get_typestore(Stores.ROS1_NOETIC)
            self.typestore.register(get_types_from_msg(_TRANSFORMS, "tf2_msgs/msg/TFMessage"))

    def raw(self, topic: str) -> Iterator[Raw]:
        """Messages of a topic in the order of the file: time of recording [ns], bytes."""
        yield from self._bag.stored(topic)


class ForeignBag:
    """A recording that rosbags has opened."""

    def __init__(self, reader: AnyReader) -> None:
        self._reader, self.is_ros2, self.typestore = reader, reader.is2, reader.typestore
        topics = reader.topics.items()
        self.types = {plain(name): str(info.msgtype) for name, info in topics if info.msgcount}

    def raw(self, topic: str) -> Iterator[Raw]:
        """Messages of a topic in the order of the file: time of recording [ns], bytes."""
        chosen = [c for c in self._reader.connections if plain(c.topic) == topic]
        count, listed = 0, sum(connection.msgcount for connection in chosen)
        # Only one file is read, so the merge of several readers is skipped.
        for _, log_ns, data in self._reader.readers[0].messages(connections=chosen):
            count += 1
            yield log_ns, data
        if count != listed:
            warnings.warn(f"{topic}: {count} messages of {listed} that are listed", TeleopWarning, stacklevel=2)


def is_plain_mcap(path: Path) -> bool:
    """Whether a path is MCAP that this package's reader accepts: without compression of whole files or messages.

    Raises:
        RecordingError: The ``metadata.yaml`` of the recording is malformed.
    """
    if not path.is_dir():
        return path.suffix.lower() == ".mcap"
    is_packed = (path / finding.METADATA).exists() and finding.compression_mode(path / finding.METADATA) != "none"
    return not is_packed and any(file.suffix == ".mcap" for file in path.iterdir())


@contextmanager
def opened_by_rosbags(path: Path) -> Iterator[ForeignBag]:
    """A ROS 1 ``.bag``, a ``.db3``, or a recording whose files or messages are compressed.

    Raises:
        RecordingError: Some messages of a ``.db3`` are still in its log file, which is not read.
    """
    for file in [path] if path.suffix == ".db3" else sorted(path.glob("*.db3")):
        _refuse_unmerged(file)
    types = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([_BoundedPath(path)], default_typestore=types) as reader:
        yield ForeignBag(reader)


def _refuse_unmerged(file: Path) -> None:
    """Raise an error if the last changes of an SQLite file are still in its log, because its recorder was killed."""
    for end in ("-wal", "-journal"):
        log = file.with_name(file.name + end)
        if log.exists() and log.stat().st_size:
            mend = f"merge them by `sqlite3 {file} 'PRAGMA integrity_check'`"
            raise RecordingError(file, f"lacks messages that are still in {log.name}: {mend}")


class _BoundedFile(io.BufferedReader):
    """File that limits each read to the remaining bytes, because a reader may trust wrong lengths."""

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self._size = path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """Read at most the remaining bytes."""
        left = max(0, self._size - self.tell())
        return super().read(left if size is None or size < 0 else min(size, left))


class _BoundedPath(type(Path())):  # type: ignore[misc]
    """Path that opens a :class:`_BoundedFile`; rosbags accepts any path with this interface."""

    def open(self, mode: str = "r", *arguments: Any, **named: Any) -> Any:
        """Open the file; for reading bytes, the result is a :class:`_BoundedFile`."""
        return _BoundedFile(self) if mode == "rb" else super().open(mode, *arguments, **named)
