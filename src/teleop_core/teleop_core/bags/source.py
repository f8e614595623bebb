"""One MCAP file being read: its topics, and its messages as tables of where they are."""

import struct
import zlib
from collections import Counter, deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Metadata, Schema

from teleop_core.bags import walk
from teleop_core.bags.compression import DamagedError, decompress
from teleop_core.bags.layouts import Bytes, Stamps
from teleop_core.bags.mcap_file import MAGIC
from teleop_core.errors import RecordingError
from teleop_core.plain_yaml import UnreadableError, check_regular

CUT_OFF = "was cut off while being recorded; `teleop recover {path}` saves what is there"
_FOOTER_SIZE = 9 + 20
_WINDOW = 4 << 20
_LOOK_AHEAD = 3
_Damage = (
    McapError,
    EndOfFile,
    struct.error,
    UnicodeDecodeError,
    KeyError,
    *DamagedError,
    OverflowError,
    MemoryError,
)


class Records(NamedTuple):
    """Messages of one stretch of a file: message i is ``data[begin[i] : begin[i] + size[i]]``."""

    data: Bytes
    channel: Stamps
    log_ns: Stamps
    begin: Stamps
    size: Stamps


@dataclass(frozen=True)
class Place:
    """Where messages are: a chunk at ``offset``, or records that stand outside of chunks."""

    offset: int
    start_ns: int
    end_ns: int
    channels: frozenset[int] | None = None  # None if unknown
    end: int = 0  # of records outside of chunks


@dataclass
class Contents:
    """What a file says about itself; ``end`` is where its last whole record ends."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    places: list[Place] = field(default_factory=list)
    counts: Counter[int] = field(default_factory=Counter)
    end: int = 0


@contextmanager
def damage_told(path: Path, what: str) -> Iterator[None]:
    """Tell damage found by the libraries as a :class:`RecordingError`."""
    try:
        yield
    except _Damage as error:
        hint = "`teleop recover` saves the whole parts"
        raise RecordingError(path, f"{what} is damaged ({error}); {hint}") from error


class McapSource:
    """An MCAP file.

    Args:
        path: The file.
        is_whole: Whether to refuse a file without an end; False reads what there is of it.

    Raises:
        RecordingError: It is missing, no MCAP file, cut off or damaged.
    """

    def __init__(self, path: Path, *, is_whole: bool = True) -> None:
        self.path = path
        try:
            check_regular(path)
            with path.open("rb") as file:
                self._check_magic(file, is_whole)
                with damage_told(path, "its index"):
                    self.contents = (is_whole and self._summary(file)) or self._scan(
                        is_whole=is_whole
                    )
        except OSError as error:
            raise RecordingError(path, f"cannot be read: {error.strerror}") from error
        except UnreadableError as error:
            raise RecordingError(path, str(error)) from error

    def _check_magic(self, file: BinaryIO, is_whole: bool) -> None:
        begin = file.read(len(MAGIC))
        if not begin:
            raise RecordingError(self.path, "is an empty file: nothing was recorded")
        if begin != MAGIC:
            kind = "an SQLite file" if begin == b"SQLite f" else "no MCAP file"
            raise RecordingError(self.path, f"is {kind}; recordings must have the storage mcap")
        size = file.seek(0, 2)
        file.seek(max(0, size - len(MAGIC)))
        has_end = size > 2 * len(MAGIC) + _FOOTER_SIZE and file.read() == MAGIC
        if is_whole and not has_end:
            raise RecordingError(self.path, CUT_OFF.format(path=self.path))

    def _summary(self, file: BinaryIO) -> Contents | None:
        """Contents by the file's index; None if it has none."""
        file.seek(0)
        reader = SeekingReader(file)
        summary = reader.get_summary()
        if summary is None or summary.statistics is None or not summary.chunk_indexes:
            return None
        places = [
            Place(
                index.chunk_start_offset, index.message_start_time, index.message_end_time,
                frozenset(index.message_index_offsets) or None,
            )
            for index in summary.chunk_indexes
        ]  # fmt: skip
        counts = Counter(summary.statistics.channel_message_counts)
        if counts.total() != summary.statistics.message_count:
            return None
        metadata = list(reader.iter_metadata()) if summary.metadata_indexes else []
        return Contents(summary.schemas, summary.channels, metadata, places, counts)

    # -- files without an index ------------------------------------------------------------------

    def _scan(self, *, is_whole: bool) -> Contents:
        """Contents by reading the file; damaged chunks are left out if it need not be whole."""
        found = Contents()
        data = self.mapped()
        rows, found.end = walk.walk(data, len(MAGIC), len(data))
        _note_cold(found, data, rows)
        for begin, size in rows[rows[:, walk.OPCODE] == Opcode.CHUNK, 1:3].tolist():
            stream = ReadDataStream(BytesIO(data[begin : begin + size].tobytes()))
            try:
                _note_chunk(found, _uncompressed(Chunk.read(stream)), begin - 9)
            except _Damage:
                if is_whole:
                    raise
        found.places += _loose(found, rows)
        return found

    def mapped(self) -> Bytes:
        """The file as an array that is read where it is looked at."""
        return np.memmap(self.path, np.uint8, "r").view(np.ndarray)

    # -- messages --------------------------------------------------------------------------------

    def records(self, places: list[Place], window: int = _WINDOW) -> Iterator[Records]:
        """Messages place by place; the next places are decompressed meanwhile.

        Args:
            places: Where to read.
            window: Bytes outside of chunks that make one table.

        Raises:
            RecordingError: A chunk is damaged.
        """
        with self.path.open("rb") as file, ThreadPoolExecutor(1) as pool:
            ahead: deque[Future[Bytes]] = deque()
            for index, place in enumerate(places):
                for later in places[index + len(ahead) : index + _LOOK_AHEAD]:
                    ahead.append(pool.submit(self._load, file, later))
                data = ahead.popleft().result()
                if place.end:
                    yield from _windows(data, place, window)
                else:
                    yield _table(data, walk.walk(data, 0, len(data))[0])

    def _load(self, file: BinaryIO, place: Place) -> Bytes:
        if place.end:
            return self.mapped()
        with damage_told(self.path, f"the chunk at byte {place.offset}"):
            return _uncompressed(_chunk_at(file, place.offset))


def _chunk_at(file: BinaryIO, offset: int) -> Chunk:
    """Chunk record; lengths in it cannot lead beyond its end."""
    size = file.seek(0, 2)
    if offset > size:
        raise ValueError(f"the file has {size} bytes")
    file.seek(offset)
    opcode, length = struct.unpack("<BQ", file.read(9))
    if opcode != Opcode.CHUNK or length > size - offset - 9:
        raise ValueError("no chunk is there")
    return Chunk.read(ReadDataStream(BytesIO(file.read(length))))


def _uncompressed(chunk: Chunk) -> Bytes:
    data = decompress(chunk.compression, chunk.data, chunk.uncompressed_size)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("its checksum is wrong")
    return np.frombuffer(data, np.uint8)


def _table(data: Bytes, rows: walk.Rows) -> Records:
    rows = rows[rows[:, walk.OPCODE] == Opcode.MESSAGE]
    return Records(
        data, rows[:, walk.CHANNEL], rows[:, walk.LOG], rows[:, walk.BEGIN], rows[:, walk.SIZE]
    )


def _windows(data: Bytes, place: Place, window: int) -> Iterator[Records]:
    """Messages outside of chunks, some megabytes at a time."""
    at = place.offset
    while at < place.end:
        end = min(at + window, place.end)
        rows, stop = walk.walk(data, at, end)
        if stop == at:  # a record longer than the window
            rows, stop = walk.walk(data, at, place.end)
            if stop == at:
                return
        yield _table(data, rows)
        at = stop


def _note_cold(found: Contents, data: Bytes, rows: walk.Rows) -> None:
    """Note schemas, channels and metadata among records."""
    is_cold = np.isin(rows[:, walk.OPCODE], (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA))
    for opcode, begin, size in rows[is_cold, :3].tolist():
        stream = ReadDataStream(BytesIO(data[begin : begin + size].tobytes()))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            found.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            found.channels[channel.id] = channel
        else:
            found.metadata.append(Metadata.read(stream))


def _note_chunk(found: Contents, data: Bytes, offset: int) -> None:
    """Note what is inside of a chunk."""
    rows, _ = walk.walk(data, 0, len(data))
    _note_cold(found, data, rows)
    messages = rows[rows[:, walk.OPCODE] == Opcode.MESSAGE]
    if len(messages):
        logs = messages[:, walk.LOG]
        found.counts.update(messages[:, walk.CHANNEL].tolist())
        found.places.append(Place(offset, int(logs.min()), int(logs.max())))


def _loose(found: Contents, rows: walk.Rows) -> list[Place]:
    """The place of messages outside of chunks, if there are any."""
    loose = rows[rows[:, walk.OPCODE] == Opcode.MESSAGE]
    if not len(loose):
        return []
    found.counts.update(loose[:, walk.CHANNEL].tolist())
    logs, last = loose[:, walk.LOG], loose[-1]
    begin = int(loose[0, walk.BEGIN]) - 31
    end = int(last[walk.BEGIN] + last[walk.SIZE])
    return [Place(begin, int(logs.min()), int(logs.max()), None, end)]
