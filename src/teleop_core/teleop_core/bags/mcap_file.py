"""Writing of an MCAP file: complete chunks one after the other, and an index at the end.

Nothing is buffered: when :meth:`McapFile.append` returns, the operating system has the data. A chunk that could not be
written completely is cut off again; complete chunks are always kept. If another program truncates the file meanwhile,
the file goes on after the last chunk that is still there.
"""

import os
import shutil
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from teleop_core import __version__
from teleop_core.bags.chunks import Chunk
from teleop_core.base.background import SYSTEM, Background

MAGIC = b"\x89MCAP0\r\n"
_CHUNK_HEAD = struct.Struct("<BQQQQI")  # opcode, length, start, end, uncompressed size, CRC
_INDEX_HEAD = struct.Struct("<BQHI")  # opcode, length, channel, bytes of entries
_FOOTER_HEAD = struct.Struct("<BQQQ")  # opcode, length, summary start, summary offset start


_ENTRY = 16  # bytes of an entry of a message index


def _end_of(chunk: ChunkIndex) -> int:
    """Place in the file after a chunk and its message indexes."""
    return chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length


def encode(*records: McapRecord) -> bytes:
    """Concatenated bytes of some records."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


class McapFile:
    """Append-only MCAP file of the profile ``ros2``.

    Args:
        path: New file.
        schemas: Message types.
        channels: Topics. Every channel number in a message must be one of them.
        metadata: Maps the name of each metadata record to its entries.
        compression: Name in the chunk's record: ``zstd``, ``lz4`` or empty.
        compress: Function that compresses a chunk.
        background: Functions that write to the disk.

    Attributes:
        truncated: Number of messages that another program has cut off.

    Raises:
        OSError: The file cannot be created or written.
    """

    def __init__(
        self,
        path: Path,
        schemas: list[Schema],
        channels: list[Channel],
        metadata: Mapping[str, dict[str, str]],
        compression: str,
        compress: Callable[[bytes], bytes],
        background: Background = SYSTEM,
    ) -> None:
        self._background = background
        self.path, self.schemas, self.channels = path, schemas, channels
        self._compression, self._compress = compression.encode(), compress
        # A long recording has many chunks, so their index is kept as the bytes that will be written.
        self._index, self._chunk_count = bytearray(), 0
        self._counts = {channel.id: 0 for channel in channels}
        self._start_ns, self._end_ns = 0, 0
        self._metadata: list[MetadataIndex] = []
        self.truncated = 0
        self._file = path.open("x+b", buffering=0)
        start = MAGIC + encode(Header("ros2", f"teleop_core {__version__}"), *schemas, *channels)
        for name, entries in metadata.items():
            record = encode(Metadata(name, entries))
            self._metadata.append(MetadataIndex(len(start), len(record), name))
            start += record
        self._head, self._end = start, len(start)
        try:
            self._write(start)
        except OSError:
            self._file.close()
            raise

    def _write(self, data: bytes | bytearray) -> None:
        view = memoryview(data)
        while view:
            view = view[self._background.write(self._file, view) :]

    def append(self, chunk: Chunk) -> None:
        """Compress and write a chunk and its message indexes.

        Raises:
            OSError: The chunk was not written; all chunks before it are intact.
        """
        # zlib and the compressors accept any buffer, though their type hints require bytes.
        data = self._compress(chunk.data.data)  # type: ignore[arg-type]
        crc = zlib.crc32(chunk.data.data)
        self.append_compressed(chunk, data, crc)

    def append_compressed(self, chunk: Chunk, data: bytes, crc: int) -> None:
        """Write a chunk that is already compressed to ``data``; ``crc`` is the checksum of its uncompressed bytes."""
        self.go_on_after_truncation()
        begin, name = self._end, self._compression
        tail = struct.pack("<I", len(name)) + name + struct.pack("<Q", len(data))
        length = _CHUNK_HEAD.size - 9 + len(tail) + len(data)
        size = len(chunk.data)
        head = _CHUNK_HEAD.pack(Opcode.CHUNK, length, chunk.start_ns, chunk.end_ns, size, crc)
        offsets: dict[int, int] = {}
        index, at = bytearray(), begin + 9 + length
        for channel, entries in chunk.index.items():
            offsets[channel] = at + len(index)
            count = entries.nbytes
            index += _INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + count, channel, count)
            index += entries.tobytes()
        self._write(head + tail)
        self._write(data)
        self._write(index)
        self._index += encode(ChunkIndex(
            message_start_time=chunk.start_ns, message_end_time=chunk.end_ns,
            chunk_start_offset=begin, chunk_length=9 + length, message_index_offsets=offsets,
            message_index_length=len(index), compression=name.decode(),
            compressed_size=len(data), uncompressed_size=size,
        ))  # fmt: skip
        for channel, entries in chunk.index.items():
            self._counts[channel] += len(entries)
        is_first, self._end = not self._chunk_count, at + len(index)
        self._start_ns = chunk.start_ns if is_first else min(self._start_ns, chunk.start_ns)
        self._end_ns = max(self._end_ns, chunk.end_ns)
        self._chunk_count += 1

    def sync(self) -> None:
        """Wait until all appended chunks are on the disk, where they survive a loss of power.

        Raises:
            OSError: The data cannot be written to the disk.
        """
        self._background.sync(self._file)

    def statistics(self) -> Statistics:
        """Numbers and times of the messages in whole chunks."""
        return Statistics(
            attachment_count=0,
            channel_count=len(self.channels),
            channel_message_counts=dict(self._counts),
            chunk_count=self._chunk_count,
            message_count=sum(self._counts.values()),
            message_start_time=self._start_ns,
            message_end_time=self._end_ns,
            metadata_count=len(self._metadata),
            schema_count=len(self.schemas),
        )

    def finish(self) -> None:
        """Write index and footer behind the last whole chunk.

        Raises:
            OSError: The disk has no space for index and footer; the file ends after its last whole chunk.
        """
        self.go_on_after_truncation()
        try:
            self._cut()
            end = encode(DataEnd(0))
            self._write(end + self._summary(self._end + len(end)) + MAGIC)
        except OSError:
            with suppress(OSError):
                self._cut()
            raise

    def go_on_after_truncation(self) -> None:
        """Forget chunks that another program has cut off; without this a hole of zeros would stand in their place."""
        size = os.fstat(self._file.fileno()).st_size
        if size >= self._end:
            return
        before, kept = sum(self._counts.values()), [(raw, one) for raw, one in self._chunks() if _end_of(one) <= size]
        self._index, self._chunk_count = bytearray().join(raw for raw, _ in kept), len(kept)
        self._counts = dict.fromkeys(self._counts, 0)
        for _, one in kept:
            for channel, offset in one.message_index_offsets.items():
                head = os.pread(self._file.fileno(), _INDEX_HEAD.size, offset)
                self._counts[channel] += _INDEX_HEAD.unpack(head)[3] // _ENTRY
        self._start_ns = min((one.message_start_time for _, one in kept), default=0)
        self._end_ns = max((one.message_end_time for _, one in kept), default=0)
        self._end = max((_end_of(one) for _, one in kept), default=len(self._head))
        self.truncated += before - sum(self._counts.values())
        if size < len(self._head):
            self._background.cut(self._file, 0)
            self._write(self._head)
        self._cut()

    def _chunks(self) -> Iterator[tuple[bytes, ChunkIndex]]:
        """Index record of each chunk, as bytes and decoded."""
        at = 0
        while at < len(self._index):
            end = at + 9 + int.from_bytes(self._index[at + 1 : at + 9], "little")
            yield bytes(self._index[at:end]), ChunkIndex.read(ReadDataStream(BytesIO(self._index[at + 9 : end])))
            at = end

    def _cut(self) -> None:
        """Remove all bytes after the last whole chunk."""
        self._background.cut(self._file, self._end)

    @property
    def place(self) -> Path | None:
        """Current path of the file, even if it was moved; None if it was removed."""
        own = os.fstat(self._file.fileno())
        with suppress(OSError):
            if os.path.samestat(own, self.path.stat()):
                return self.path
        if not own.st_nlink:
            return None
        with suppress(OSError):  # Linux gives the current path of an open file
            return Path(os.readlink(f"/proc/self/fd/{self._file.fileno()}"))
        return self.path

    def copy_to(self, path: Path) -> None:
        """Copy the whole content of the file to a new file; this works even after the file was removed.

        Raises:
            OSError: The new file exists already or cannot be written.
        """
        self._file.seek(0)
        with path.open("xb") as copy:
            shutil.copyfileobj(self._file, copy, 1 << 20)

    def _summary(self, start: int) -> bytes:
        groups = {
            Opcode.SCHEMA: encode(*self.schemas),
            Opcode.CHANNEL: encode(*self.channels),
            Opcode.STATISTICS: encode(self.statistics()),
            Opcode.CHUNK_INDEX: bytes(self._index),
            Opcode.METADATA_INDEX: encode(*self._metadata),
        }
        offsets, at = [], start
        for opcode, data in groups.items():
            if data:
                offsets.append(SummaryOffset(opcode, at, len(data)))
            at += len(data)
        summary = b"".join(groups.values()) + encode(*offsets)
        crc = zlib.crc32(summary + _FOOTER_HEAD.pack(Opcode.FOOTER, 20, start, at))
        return summary + encode(Footer(start, at, crc))

    def close(self) -> None:
        """Close the file."""
        self._file.close()
