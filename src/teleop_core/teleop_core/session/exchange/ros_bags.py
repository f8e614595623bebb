"""ROS bags message by message: MCAP by our own reader, the other storages by the rosbags library.

Our reader is the faster one, and no length in a file leads it beyond the file's end. The library's
reader of ROS 1 is handed a file that keeps it to that too.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from teleop_core.bags import ros_types
from teleop_core.bags.finding import METADATA, compression_mode
from teleop_core.bags.reader import Bag
from teleop_core.session.exchange.bag_messages import Raw, plain


class RosBag(Protocol):
    """An opened recording of ROS.

    Attributes:
        types: Topics with at least one message, to their message types.
        typestore: Message types as rosbags knows them.
        is_ros2: Whether messages are CDR, not those of ROS 1.
    """

    types: dict[str, str]
    typestore: Any
    is_ros2: bool

    def raw(self, topic: str) -> Iterator[Raw]:
        """Messages of a topic: time of recording [ns], bytes."""


class OurBag:
    """A recording in MCAP."""

    is_ros2 = True

    def __init__(self, bag: Bag) -> None:
        self._bag = bag
        self.types = {name: info.type for name, info in bag.topics.items() if info.count}
        self.typestore = ros_types.typestore()

    def raw(self, topic: str) -> Iterator[Raw]:
        """As of any recording."""
        for _, _, log_ns, data in self._bag.raw([topic]):
            yield log_ns, data


class ForeignBag:
    """A recording that rosbags has opened."""

    def __init__(self, reader: AnyReader) -> None:
        self._reader, self.is_ros2, self.typestore = reader, reader.is2, reader.typestore
        topics = reader.topics.items()
        self.types = {plain(name): str(info.msgtype) for name, info in topics if info.msgcount}

    def raw(self, topic: str) -> Iterator[Raw]:
        """As of any recording."""
        chosen = [c for c in self._reader.connections if plain(c.topic) == topic]
        # There is one file: its own reader need not be merged with others.
        for _, log_ns, data in self._reader.readers[0].messages(connections=chosen):
            yield log_ns, data


def is_plain_mcap(path: Path) -> bool:
    """Whether a path is MCAP that our reader takes: not packed file by file or message by message.

    Raises:
        RecordingError: Its ``metadata.yaml`` is not what it must be.
    """
    if not path.is_dir():
        return path.suffix.lower() == ".mcap"
    is_packed = (path / METADATA).exists() and compression_mode(path / METADATA) != "none"
    return not is_packed and any(file.suffix == ".mcap" for file in path.iterdir())


@contextmanager
def opened_by_rosbags(path: Path) -> Iterator[ForeignBag]:
    """A ROS 1 ``.bag``, a ``.db3``, or a recording whose files or messages are compressed."""
    types = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([_BoundedPath(path)], default_typestore=types) as reader:
        yield ForeignBag(reader)


class _BoundedFile(io.BufferedReader):
    """File that is asked for no more than it has: a reader may believe any length."""

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self._size = path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """At most as many bytes as are left."""
        left = max(0, self._size - self.tell())
        return super().read(left if size is None or size < 0 else min(size, left))


class _BoundedPath(type(Path())):  # type: ignore[misc]
    """Path that opens such a file; rosbags takes any path of this interface."""

    def open(self, mode: str = "r", *arguments: Any, **named: Any) -> Any:
        """Open for reading bytes, or as any path does."""
        return _BoundedFile(self) if mode == "rb" else super().open(mode, *arguments, **named)
