"""MCAP file being written: whole chunks behind each other, an index at the end.

Nothing is buffered: what :meth:`McapFile.append` has accepted is with the operating system. The
file can be finished at the end of any of its whole chunks, which is what happens on a full disk.
"""

import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from mcap.data_stream import RecordBuilder
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

MAGIC = b"\x89MCAP0\r\n"
_CHUNK_HEAD = struct.Struct("<BQQQQI")  # opcode, length, start, end, uncompressed size, CRC
_INDEX_HEAD = struct.Struct("<BQHI")  # opcode, length, channel, bytes of entries
_FOOTER_HEAD = struct.Struct("<BQQQ")  # opcode, length, summary start, summary offset start


def encode(*records: McapRecord) -> bytes:
    """Bytes of records behind each other."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


@dataclass(frozen=True)
class _Written:
    """A chunk in the file: its index record, messages per channel, and where it ends."""

    index: ChunkIndex
    counts: dict[int, int]
    end: int


class McapFile:
    """Append-only MCAP file of the profile ``ros2``.

    Args:
        path: New file.
        schemas: Message types.
        channels: Topics; every channel that messages name.
        metadata: Name of a metadata record to its entries.
        compression: Name in the chunk's record: ``zstd``, ``lz4`` or empty.
        compress: Function that does it.

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
    ) -> None:
        self.path, self.schemas, self.channels = path, schemas, channels
        self._compression, self._compress = compression.encode(), compress
        self._chunks: list[_Written] = []
        self._metadata: list[MetadataIndex] = []
        self._file = path.open("xb", buffering=0)
        start = MAGIC + encode(Header("ros2", f"teleop_core {__version__}"), *schemas, *channels)
        for name, entries in metadata.items():
            record = encode(Metadata(name, entries))
            self._metadata.append(MetadataIndex(len(start), len(record), name))
            start += record
        self._data_start = len(start)
        self._write(start)

    @property
    def _end(self) -> int:
        return self._chunks[-1].end if self._chunks else self._data_start

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]

    def append(self, chunk: Chunk) -> None:
        """Compress and write a chunk and its message indexes.

        Raises:
            OSError: Not written; whole chunks before it are unharmed.
        """
        # The cast makes bytes of what zlib and the compressors take as a buffer.
        data = self._compress(chunk.data.data)  # type: ignore[arg-type]
        crc = zlib.crc32(chunk.data.data)
        self.append_compressed(chunk, data, crc)

    def append_compressed(self, chunk: Chunk, data: bytes, crc: int) -> None:
        """As :meth:`append`, of a chunk compressed before."""
        begin, name = self._end, self._compression
        tail = struct.pack("<I", len(name)) + name + struct.pack("<Q", len(data))
        length = _CHUNK_HEAD.size - 9 + len(tail) + len(data)
        size = len(chunk.data)
        head = _CHUNK_HEAD.pack(Opcode.CHUNK, length, chunk.start_ns, chunk.end_ns, size, crc)
        offsets: dict[int, int] = {}
        indexes: list[bytes] = []
        at = begin + 9 + length
        for channel, entries in chunk.index.items():
            offsets[channel] = at + sum(len(other) for other in indexes)
            count = entries.nbytes
            indexes.append(
                _INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + count, channel, count)
                + entries.tobytes()
            )
        index = b"".join(indexes)
        self._write(head + tail)
        self._write(data)
        self._write(index)
        record = ChunkIndex(
            message_start_time=chunk.start_ns, message_end_time=chunk.end_ns,
            chunk_start_offset=begin, chunk_length=9 + length, message_index_offsets=offsets,
            message_index_length=len(index), compression=name.decode(),
            compressed_size=len(data), uncompressed_size=size,
        )  # fmt: skip
        counts = {channel: len(entries) for channel, entries in chunk.index.items()}
        self._chunks.append(_Written(record, counts, at + len(index)))

    def drop_last(self) -> bool:
        """Give up the last chunk, to make room; False if there is none."""
        if not self._chunks:
            return False
        self._chunks.pop()
        return True

    def statistics(self) -> Statistics:
        """Numbers and times of the messages in whole chunks."""
        counts = {channel.id: 0 for channel in self.channels}
        for chunk in self._chunks:
            for channel, count in chunk.counts.items():
                counts[channel] += count
        return Statistics(
            attachment_count=0, channel_count=len(self.channels), channel_message_counts=counts,
            chunk_count=len(self._chunks), message_count=sum(counts.values()),
            message_start_time=min((c.index.message_start_time for c in self._chunks), default=0),
            message_end_time=max((c.index.message_end_time for c in self._chunks), default=0),
            metadata_count=len(self._metadata), schema_count=len(self.schemas),
        )  # fmt: skip

    def finish(self) -> None:
        """Write index and footer behind the last whole chunk.

        Raises:
            OSError: There is no room; :meth:`drop_last` makes some, then try again.
        """
        self._file.seek(self._end)
        self._file.truncate()
        end = encode(DataEnd(0))
        self._write(end + self._summary(self._end + len(end)) + MAGIC)

    def _summary(self, start: int) -> bytes:
        groups = {
            Opcode.SCHEMA: encode(*self.schemas),
            Opcode.CHANNEL: encode(*self.channels),
            Opcode.STATISTICS: encode(self.statistics()),
            Opcode.CHUNK_INDEX: encode(*(chunk.index for chunk in self._chunks)),
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
