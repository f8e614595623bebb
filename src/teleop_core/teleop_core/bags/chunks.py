"""Chunks: converts the messages of a time interval to the bytes of MCAP chunks, and makes the index of the chunks.

Messages of all topics are sorted by log time; messages with equal log times are in the order of the streams. Readers
that ignore the index therefore also read the messages in the right order.

Most streams of a session have one message in every tick. These *streams in step* form a table with one row of bytes
for each tick. The records of all other messages are inserted between the records of the table.
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode

from teleop_core.bags.layouts import Bytes, Layout, Stamps, Values

HEADER = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_FOREVER = 2**62
_LENGTH_OF_REST = HEADER.size - 9  # number of header bytes that the record's length includes
_HEADER = np.dtype(
    {
        "names": ["sequence", "log", "publish"],
        "formats": ["<u4", "<u8", "<u8"],
        "offsets": [11, 15, 23],
        "itemsize": HEADER.size,
    }
)


Entries = np.ndarray[tuple[int, int], np.dtype[np.uint64]]


@dataclass(frozen=True, eq=False)
class Chunk:
    """Uncompressed records, and the positions of the messages of each channel.

    ``index`` maps a channel to rows of (log time [ns], offset in ``data`` [bytes]), shape (n, 2).
    """

    data: Bytes
    start_ns: int
    end_ns: int
    index: dict[int, Entries]


# One message of any size that will be written into a chunk: channel, sequence, log and publish time [ns],
# CDR. A plain tuple, since one is made for every live message.
Single = tuple[int, int, int, int, bytes]


def _record(channel: int, sequence: int, log_ns: int, publish_ns: int, data: bytes) -> bytes:
    """Whole MCAP record of a single message."""
    length = _LENGTH_OF_REST + len(data)
    return HEADER.pack(Opcode.MESSAGE, length, channel, sequence, log_ns, publish_ns) + data


class _Loose(NamedTuple):
    """A record outside the table. ``begin`` is the byte of a table row at which this record would be inserted."""

    log_ns: int
    begin: int
    channel: int
    record: bytes


_order = itemgetter(0, 1)


class Stretch(NamedTuple):
    """Samples of one stream that will be written into a chunk."""

    channel: int
    sequence: int  # sequence number of the first sample
    layout: Layout
    stamp_ns: Stamps
    values: Values
    log_ns: Stamps

    @property
    def size(self) -> int:
        """Size of one record [bytes]."""
        return HEADER.size + self.layout.size

    def fill(self, rows: Bytes) -> None:
        """Write the records into ``rows``, shape (n, size); the bytes of each row are contiguous."""
        length = _LENGTH_OF_REST + self.layout.size
        head = HEADER.pack(Opcode.MESSAGE, length, self.channel, 0, 0, 0)
        rows[:, : HEADER.size] = np.frombuffer(head, np.uint8)
        fields = rows[:, : HEADER.size].view(_HEADER)[:, 0]
        fields["sequence"] = np.arange(self.sequence, self.sequence + len(rows))
        fields["log"] = fields["publish"] = self.log_ns
        self.layout.encode_into(rows[:, HEADER.size :], self.stamp_ns, self.values)

    def loose(self, begin: int) -> "list[_Loose]":
        """The records as single records; all get ``begin`` as the byte of a table row at which they are inserted."""
        rows = np.empty((len(self.log_ns), self.size), np.uint8)
        self.fill(rows)
        return [
            _Loose(log_ns, begin, self.channel, row.tobytes())
            for log_ns, row in zip(self.log_ns.tolist(), rows, strict=True)
        ]


Messages = tuple[list[Stretch], list[Single]]


class _Scratch:
    """Memory that is reused, because allocating memory takes longer than filling it."""

    def __init__(self) -> None:
        self._bytes: Bytes = np.empty(0, np.uint8)

    def take(self, size: int) -> Bytes:
        """Bytes (size,) of the same memory in each call."""
        if len(self._bytes) < size:
            self._bytes = np.empty(size, np.uint8)
        return self._bytes[:size]


class Assembly:
    """Maker of the chunks of one file.

    Args:
        size: Approximate size of a chunk [bytes].
    """

    def __init__(self, size: int) -> None:
        self._size, self._table, self._data = size, _Scratch(), _Scratch()

    def chunks(self, stretches: Sequence[Stretch], singles: Sequence[Single]) -> Iterator[Chunk]:
        """All given messages as chunks in the order of time.

        The bytes of these chunks are valid until the next call.
        """
        stretches = [stretch for stretch in stretches if len(stretch.log_ns)]
        if not stretches and not singles:
            return
        data, index = self._merged(_Table(stretches, self._table), singles) if stretches else _in_order(singles)
        first, begin = dict.fromkeys(index, 0), 0
        for cut_ns in (*_cuts(stretches, len(data), self._size), _FOREVER):
            cut = np.uint64(cut_ns)  # with another type, NumPy would convert all times
            last = {c: int(np.searchsorted(rows[:, 0], cut)) for c, rows in index.items()}
            nexts = [int(rows[last[c], 1]) for c, rows in index.items() if last[c] < len(rows)]
            end = min(nexts, default=len(data))
            own = {c: rows[first[c] : last[c]] for c, rows in index.items() if first[c] < last[c]}
            if own:
                yield _chunk(data[begin:end], begin, own)
            first, begin = last, end

    def _merged(self, table: "_Table", singles: Sequence[Single]) -> tuple[Bytes, dict[int, Entries]]:
        """Records of all messages in their order, and the positions of the records of each channel."""
        loose = table.loose + [_Loose(s[2], table.width, s[0], _record(*s)) for s in singles]
        loose.sort(key=_order)
        places = table.places(loose)
        before = np.cumsum([0, *(len(one.record) for one in loose)])
        index = table.index(places, before)
        logs, channels = (np.array([one[i] for one in loose], np.int64) for i in (0, 2))
        offsets = places + before[:-1]
        for channel in np.unique(channels).tolist():
            own = _entries(logs[channels == channel], offsets[channels == channel])
            if channel in index:
                own = np.concatenate((index[channel], own))
                own = own[np.argsort(own[:, 1])]
            index[channel] = own
        return self._joined(table, loose, places.tolist()), index

    def _joined(self, table: "_Table", loose: Sequence[_Loose], places: Sequence[int]) -> Bytes:
        """Bytes of the table with each loose record inserted at its position."""
        rows = table.rows.reshape(-1)
        if not loose:
            return rows
        data = self._data.take(len(rows) + sum(len(one.record) for one in loose))
        source, view, begin, at = rows.data, data.data, 0, 0
        for one, end in zip(loose, places, strict=True):
            middle = at + end - begin
            view[at:middle] = source[begin:end]
            begin, at = end, middle + len(one.record)
            view[middle:at] = one.record
        view[at:] = source[begin:]
        return data


def _in_order(singles: Sequence[Single]) -> tuple[Bytes, dict[int, Entries]]:
    """As ``Assembly._merged``, without a table."""
    ordered = sorted(singles, key=itemgetter(2))
    records = [_record(*one) for one in ordered]
    logs, channels = (np.array([one[i] for one in ordered], np.int64) for i in (2, 0))
    sizes = np.fromiter(map(len, records), np.int64, len(records))
    offsets = np.cumsum(sizes) - sizes
    index = {}
    for channel in np.unique(channels).tolist():
        own = channels == channel
        index[channel] = _entries(logs[own], offsets[own])
    return np.frombuffer(b"".join(records), np.uint8), index


def _cuts(stretches: Sequence[Stretch], total: int, size: int) -> list[int]:
    """Log times [ns] at which ``total`` bytes are cut into chunks; empty if they fit into two chunks."""
    if total <= 2 * size or not stretches:
        return []
    logs = max((stretch.log_ns for stretch in stretches), key=len)
    count = -(-total // size)
    return sorted({int(logs[len(logs) * i // count]) for i in range(1, count)})


def _chunk(data: Bytes, begin: int, index: Mapping[int, Entries]) -> Chunk:
    base = np.array((0, begin), np.uint64)
    start_ns = min(int(rows[0, 0]) for rows in index.values())
    end_ns = max(int(rows[-1, 0]) for rows in index.values())
    return Chunk(data, start_ns, end_ns, {c: rows - base for c, rows in index.items()})


class _Table:
    """Streams in step as a table of bytes, and the records of all other streams.

    Attributes:
        times: Log times of the rows, shape (n,), [ns]; they increase.
        width: Size of a row [bytes].
        rows: Records of the streams in step, shape (n, width).
        begins: Maps the channel of each stream in step to the byte of the row at which its record begins.
        loose: Records of the other streams.
    """

    def __init__(self, stretches: Sequence[Stretch], room: _Scratch) -> None:
        longest = max((s.log_ns for s in stretches), key=len, default=np.empty(0, np.int64))
        self.times = longest if (longest[1:] > longest[:-1]).all() else longest[:0]
        is_in_step = [np.array_equal(stretch.log_ns, self.times) for stretch in stretches]
        self.width = sum(s.size * own for s, own in zip(stretches, is_in_step, strict=True))
        shape = (len(self.times), self.width)
        self.rows: Bytes = room.take(shape[0] * shape[1]).reshape(shape)
        self.begins: dict[int, int] = {}
        self.loose: list[_Loose] = []
        begin = 0
        for stretch, own in zip(stretches, is_in_step, strict=True):
            if own:
                self.begins[stretch.channel] = begin
                stretch.fill(self.rows[:, begin : begin + stretch.size])
                begin += stretch.size
            else:
                self.loose += stretch.loose(begin)

    def places(self, loose: Sequence[_Loose]) -> Stamps:
        """Byte of the table before which each loose record is inserted, shape (n,)."""
        logs = np.array([one.log_ns for one in loose], np.int64)
        begins = np.array([one.begin for one in loose], np.int64)
        rows = np.searchsorted(self.times, logs)
        has_row = np.append(self.times, _FOREVER)[rows] == logs
        places: Stamps = rows * self.width + begins * has_row
        return places

    def index(self, places: Stamps, before: Stamps) -> dict[int, Entries]:
        """Positions of the records of each stream in step, by channel.

        Args:
            places: Bytes of the table before which loose records are inserted, shape (n,).
            before: Total size of the loose records before each loose record, then of all of them, shape (n + 1,)
                [bytes].
        """
        rows, index = np.arange(len(self.times)) * self.width, {}
        for channel, begin in self.begins.items():
            at = rows + begin
            index[channel] = _entries(self.times, at + before[np.searchsorted(places, at, "right")])
        return index


def _entries(logs: Stamps, offsets: Stamps) -> Entries:
    entries: Entries = np.column_stack((logs, offsets)).astype("<u8")
    return entries
