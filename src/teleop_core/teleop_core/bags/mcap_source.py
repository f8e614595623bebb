"""MCAP source: reads the topics of an MCAP file, and tables of the positions of its messages."""

import struct
import zlib
from collections import Counter, deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Footer, Metadata, MetadataIndex, Schema, Statistics

from teleop_core.bags import compression, layouts, mcap_file, walk
from teleop_core.base import RecordingError, damage_told

CUT_OFF = "was cut off while being recorded; `teleop recover {path}` saves its intact messages"
_FOOTER_SIZE = 9 + 20
_WINDOW = 4 << 20
_LOOK_AHEAD = 3
_UNREAD = "{} is damaged ({{}}); `teleop recover` saves the whole parts"


class Records(NamedTuple):
    """Messages of one part of a file: message i is ``data[begin[i] : begin[i] + size[i]]``."""

    data: layouts.Bytes
    channel: layouts.Stamps
    log_ns: layouts.Stamps
    begin: layouts.Stamps
    size: layouts.Stamps


@dataclass(frozen=True)
class FilePart:
    """Part of a file that contains messages: a chunk at ``offset``, or records outside of chunks."""

    offset: int
    start_ns: int
    end_ns: int
    channels: frozenset[int] | None = None  # None if unknown
    end: int = 0  # end of the records outside of chunks; 0 for a chunk


@dataclass
class Contents:
    """Contents of a file; ``end`` is the position at which its last whole record ends."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    places: list[FilePart] = field(default_factory=list)
    counts: Counter[int] = field(default_factory=Counter)
    end: int = 0


class McapSource:
    """Reader of one MCAP file.

    Args:
        path: The file.
        is_whole: True refuses a file that was cut off; False reads the part that exists.

    Raises:
        RecordingError: The file is missing, is no MCAP file, was cut off or is damaged.
    """

    def __init__(self, path: Path, *, is_whole: bool = True) -> None:
        self.path = path
        with damage_told(path, _UNREAD.format("its index")), path.open("rb") as file:
            self._check_magic(file, is_whole)
            self.contents = (is_whole and self._summary()) or self._scan(is_whole=is_whole)

    def _check_magic(self, file: BinaryIO, is_whole: bool) -> None:
        begin = file.read(len(mcap_file.MAGIC))
        if not begin:
            raise RecordingError(self.path, "is an empty file: nothing was recorded")
        if begin != mcap_file.MAGIC:
            kind = "an SQLite file, no MCAP" if begin == b"SQLite f" else "no MCAP file"
            hint = f"`teleop import {self.path} --out DIR` makes a recording of tables and bags"
            raise RecordingError(self.path, f"is {kind}; recordings must be MCAP files; {hint}")
        size = file.seek(0, 2)
        file.seek(max(0, size - len(mcap_file.MAGIC)))
        has_end = size > 2 * len(mcap_file.MAGIC) + _FOOTER_SIZE and file.read() == mcap_file.MAGIC
        if is_whole and not has_end:
            raise RecordingError(self.path, CUT_OFF.format(path=self.path))

    def _summary(self) -> Contents | None:
        """Contents as listed in the file's index; None if the file has no index.

        The index is read like any other part of the file, so that no wrong length in it leads beyond the end of the
        file.
        """
        data = self.mapped()
        footer = len(data) - len(mcap_file.MAGIC) - _FOOTER_SIZE
        start = Footer.read(_stream(data, footer + 9, 20)).summary_start
        if not len(mcap_file.MAGIC) <= start < footer:
            return None
        rows, end = walk.walk(data, start, footer)
        if end != footer:
            raise ValueError(f"it ends at byte {end}, must end at {footer}")
        found, statistics, spans = Contents(), None, [(len(mcap_file.MAGIC), len(mcap_file.MAGIC))]
        _note_cold(found, data, rows)
        for opcode, begin, size in rows[:, :3].tolist():
            if opcode == Opcode.STATISTICS:
                statistics = Statistics.read(_stream(data, begin, size))
            elif opcode == Opcode.CHUNK_INDEX:
                index = ChunkIndex.read(_stream(data, begin, size))
                found.places.append(_place(index))
                spans.append((index.chunk_start_offset, index.chunk_start_offset + index.chunk_length))
            elif opcode == Opcode.METADATA_INDEX:
                entry = MetadataIndex.read(_stream(data, begin, size))
                found.metadata.append(Metadata.read(_stream(data, entry.offset + 9, entry.length)))
        if statistics is None or not found.places or _has_messages_between(data, [*spans, (start, start)]):
            return None
        found.counts = Counter(statistics.channel_message_counts)
        return found if found.counts.total() == statistics.message_count else None

    # -- files without an index ------------------------------------------------------------------

    def _scan(self, *, is_whole: bool) -> Contents:
        """Contents found by reading the whole file. Damaged chunks are left out if ``is_whole`` is False."""
        found = Contents()
        data = self.mapped()
        rows, found.end = walk.walk(data, len(mcap_file.MAGIC), len(data))
        _note_cold(found, data, rows)
        for begin, size in rows[rows[:, walk.OPCODE] == Opcode.CHUNK, 1:3].tolist():
            try:
                with damage_told(self.path, _UNREAD.format(f"the chunk at byte {begin - 9}")):
                    chunk = Chunk.read(_stream(data, begin, size))
                    _note_chunk(found, _uncompressed(chunk), begin - 9)
            except RecordingError:
                if is_whole:
                    raise
        found.places += _loose(found, rows)
        return found

    def mapped(self) -> layouts.Bytes:
        """The file as a memory-mapped array: bytes are read from the disk when they are accessed."""
        return np.memmap(self.path, np.uint8, "r").view(np.ndarray)

    # -- messages --------------------------------------------------------------------------------

    def records(self, places: list[FilePart], window: int = _WINDOW) -> Iterator[Records]:
        """Messages of each part of the file in turn; another thread decompresses the next parts meanwhile.

        Args:
            places: Parts of the file to read.
            window: Size of the tables of messages outside of chunks [bytes].

        Raises:
            RecordingError: A chunk is damaged.
        """
        with self.path.open("rb") as file, ThreadPoolExecutor(1) as pool:
            ahead: deque[Future[layouts.Bytes]] = deque()
            for index, place in enumerate(places):
                for later in places[index + len(ahead) : index + _LOOK_AHEAD]:
                    ahead.append(pool.submit(self._load, file, later))
                data = ahead.popleft().result()
                if place.end:
                    yield from _windows(data, place, window)
                else:
                    yield _table(data, walk.walk(data, 0, len(data))[0])

    def _load(self, file: BinaryIO, place: FilePart) -> layouts.Bytes:
        if place.end:
            return self.mapped()
        with damage_told(self.path, _UNREAD.format(f"the chunk at byte {place.offset}")):
            return _uncompressed(_chunk_at(file, place.offset))


def _has_messages_between(data: layouts.Bytes, spans: list[tuple[int, int]]) -> bool:
    """Whether messages, or chunks without an entry in the index, are between the indexed chunks.

    Args:
        data: The whole file.
        spans: Begin and end of each chunk, of the file's start, and of its index.
    """
    for (_, begin), (end, _) in pairwise(sorted(spans)):
        rows, _ = walk.walk(data, min(begin, end, len(data)), min(end, len(data)))
        if np.isin(rows[:, walk.OPCODE], (Opcode.MESSAGE, Opcode.CHUNK)).any():
            return True
    return False


def _stream(data: layouts.Bytes, begin: int, size: int) -> ReadDataStream:
    """Stream over some bytes of a file, of the type from which the mcap library reads records."""
    return ReadDataStream(BytesIO(data[begin : begin + size].tobytes()))


def _place(index: ChunkIndex) -> FilePart:
    """Place of a chunk, from its entry in the file's index."""
    channels = frozenset(index.message_index_offsets) or None
    return FilePart(index.chunk_start_offset, index.message_start_time, index.message_end_time, channels)


def _chunk_at(file: BinaryIO, offset: int) -> Chunk:
    """Chunk record at an offset; wrong lengths in it cannot lead beyond its end."""
    size = file.seek(0, 2)
    if offset > size:
        raise ValueError(f"the file has {size} bytes")
    file.seek(offset)
    opcode, length = struct.unpack("<BQ", file.read(9))
    if opcode != Opcode.CHUNK or length > size - offset - 9:
        raise ValueError("no chunk is there")
    return Chunk.read(ReadDataStream(BytesIO(file.read(length))))


def _uncompressed(chunk: Chunk) -> layouts.Bytes:
    data = compression.decompress(chunk.compression, chunk.data, chunk.uncompressed_size)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("its checksum is wrong")
    return np.frombuffer(data, np.uint8)


def _table(data: layouts.Bytes, rows: walk.Rows) -> Records:
    rows = rows[rows[:, walk.OPCODE] == Opcode.MESSAGE]
    return Records(data, rows[:, walk.CHANNEL], rows[:, walk.LOG], rows[:, walk.BEGIN], rows[:, walk.SIZE])


def _windows(data: layouts.Bytes, place: FilePart, window: int) -> Iterator[Records]:
    """Messages outside of chunks, as tables of about ``window`` bytes of the file."""
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


def _note_cold(found: Contents, data: layouts.Bytes, rows: walk.Rows) -> None:
    """Add the schemas, channels and metadata among some records to ``found``."""
    is_cold = np.isin(rows[:, walk.OPCODE], (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA))
    for opcode, begin, size in rows[is_cold, :3].tolist():
        stream = _stream(data, begin, size)
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            found.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            found.channels[channel.id] = channel
        else:
            found.metadata.append(Metadata.read(stream))


def _note_chunk(found: Contents, data: layouts.Bytes, offset: int) -> None:
    rows, _ = walk.walk(data, 0, len(data))
    _note_cold(found, data, rows)
    messages = rows[rows[:, walk.OPCODE] == Opcode.MESSAGE]
    if len(messages):
        logs = messages[:, walk.LOG]
        found.counts.update(messages[:, walk.CHANNEL].tolist())
        found.places.append(FilePart(offset, int(logs.min()), int(logs.max())))


def _loose(found: Contents, rows: walk.Rows) -> list[FilePart]:
    """Part of the file that contains messages outside of chunks; an empty list if there are none."""
    loose = rows[rows[:, walk.OPCODE] == Opcode.MESSAGE]
    if not len(loose):
        return []
    found.counts.update(loose[:, walk.CHANNEL].tolist())
    logs, last = loose[:, walk.LOG], loose[-1]
    begin = int(loose[0, walk.BEGIN]) - 31
    end = int(last[walk.BEGIN] + last[walk.SIZE])
    return [FilePart(begin, int(logs.min()), int(logs.max()), None, end)]
