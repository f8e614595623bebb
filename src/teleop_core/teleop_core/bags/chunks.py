"""Chunks: messages of one stretch of time as the bytes of an MCAP chunk, with their index.

Messages stand in the order of their log times, whatever topic they belong to; of equal times, in
the order of the streams. So readers that ignore the index see them in the right order too.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode

from teleop_core.bags.layouts import Bytes, Layout, Stamps, Values

HEADER = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_FOREVER = 2**62
_LENGTH_OF_REST = HEADER.size - 9  # of the header, counted by the record's length
_HEADER = np.dtype(
    {
        "names": ["sequence", "log", "publish"],
        "formats": ["<u4", "<u8", "<u8"],
        "offsets": [11, 15, 23],
        "itemsize": HEADER.size,
    }
)


@dataclass(frozen=True, eq=False)
class Chunk:
    """Uncompressed records, and per channel where its messages are.

    ``index`` maps a channel to rows of (log time [ns], offset in ``data`` [bytes]), shape (n, 2).
    """

    data: Bytes
    start_ns: int
    end_ns: int
    index: dict[int, "np.ndarray[tuple[int, int], np.dtype[np.uint64]]"]


# One message of any size on its way into a chunk: channel, sequence, log and publish time [ns],
# CDR. A plain tuple, since one is made for every live message.
Single = tuple[int, int, int, int, bytes]


def _records(singles: Sequence[Single]) -> list[bytes]:
    """Whole MCAP records."""
    pack = HEADER.pack
    return [
        pack(Opcode.MESSAGE, _LENGTH_OF_REST + len(data), channel, sequence, log, publish) + data
        for channel, sequence, log, publish, data in singles
    ]


class Stretch(NamedTuple):
    """Samples of one stream on their way into a chunk."""

    channel: int
    sequence: int  # of the first sample
    layout: Layout
    stamp_ns: Stamps
    values: Values
    log_ns: Stamps

    @property
    def size(self) -> int:
        """Bytes of one record."""
        return HEADER.size + self.layout.size

    def fill(self, rows: Bytes) -> None:
        """Write the records into rows, shape (n, size), whose bytes follow each other."""
        length = _LENGTH_OF_REST + self.layout.size
        head = HEADER.pack(Opcode.MESSAGE, length, self.channel, 0, 0, 0)
        rows[:, : HEADER.size] = np.frombuffer(head, np.uint8)
        fields = rows[:, : HEADER.size].view(_HEADER)[:, 0]
        fields["sequence"] = np.arange(self.sequence, self.sequence + len(rows))
        fields["log"] = fields["publish"] = self.log_ns
        self.layout.encode_into(rows[:, HEADER.size :], self.stamp_ns, self.values)

    def between(self, begin_ns: int, end_ns: int) -> "Stretch":
        """The samples logged from ``begin_ns`` on and before ``end_ns``."""
        first, last = np.searchsorted(self.log_ns, (begin_ns, end_ns))
        part = slice(first, last)
        return self._replace(
            sequence=self.sequence + int(first), stamp_ns=self.stamp_ns[part],
            values=self.values[part], log_ns=self.log_ns[part],
        )  # fmt: skip


Messages = tuple[list[Stretch], list[Single]]


def split(stretches: list[Stretch], singles: list[Single], size: int) -> list[Messages]:
    """Messages in parts of about ``size`` bytes of streams that follow each other in time."""
    total = sum(s.size * len(s.log_ns) for s in stretches)
    if total <= 2 * size:
        return [(stretches, singles)]
    logs = np.sort(np.concatenate([s.log_ns for s in stretches]))
    count = -(-total // size)
    cuts = np.unique(logs[[len(logs) * i // count for i in range(1, count)]]).tolist()
    parts = []
    for begin, end in pairwise([-_FOREVER, *cuts, _FOREVER]):
        stretched = [s.between(begin, end) for s in stretches]
        single = [s for s in singles if begin <= s[2] < end]
        if single or any(len(s.log_ns) for s in stretched):
            parts.append((stretched, single))
    return parts


def assemble(stretches: Sequence[Stretch], singles: Sequence[Single] = ()) -> Chunk:
    """Chunk of all these messages, of which there is at least one."""
    stretches = [stretch for stretch in stretches if len(stretch.log_ns)]
    records = _records(singles)
    logs = np.concatenate(
        [s.log_ns for s in stretches] + [np.array([log for _, _, log, _, _ in singles], np.int64)]
    )
    sizes = np.concatenate(
        [np.full(len(s.log_ns), s.size) for s in stretches]
        + [np.array([len(record) for record in records], np.int64)]
    )
    order = np.argsort(logs, kind="stable")
    offsets, sorted_sizes = np.empty(len(logs), np.int64), sizes[order]
    offsets[order] = np.cumsum(sorted_sizes) - sorted_sizes
    data = np.empty(int(sizes.sum()), np.uint8)
    begin = 0
    for stretch in stretches:
        end = begin + len(stretch.log_ns)
        _place(data, offsets[begin:end], stretch)
        begin = end
    view = data.data
    for record, offset in zip(records, offsets[begin:].tolist(), strict=True):
        view[offset : offset + len(record)] = record
    index = _index(stretches, singles, logs, offsets)
    return Chunk(data, int(logs[order[0]]), int(logs[order[-1]]), index)


def _place(data: Bytes, offsets: Stamps, stretch: Stretch) -> None:
    """Write the records at their offsets; without a copy if these are evenly spaced."""
    shape, step = (len(offsets), stretch.size), 0
    if len(offsets) > 1:
        steps = np.diff(offsets)
        step = int(steps[0]) if (steps == steps[0]).all() else -1
    if step >= 0:
        rows: Bytes = np.ndarray(shape, np.uint8, data, int(offsets[0]), (step, 1))
        stretch.fill(rows)
        return
    copy = np.empty(shape, np.uint8)
    stretch.fill(copy)
    data[offsets[:, np.newaxis] + np.arange(stretch.size)] = copy


def _index(
    stretches: Sequence[Stretch], singles: Sequence[Single], logs: Stamps, offsets: Stamps
) -> dict[int, "np.ndarray[tuple[int, int], np.dtype[np.uint64]]"]:
    entries = np.column_stack((logs, offsets)).astype("<u8")
    index, begin = {}, 0
    for stretch in stretches:
        end = begin + len(stretch.log_ns)
        index[stretch.channel] = entries[begin:end]
        begin = end
    channels = np.array([channel for channel, *_ in singles], np.int64)
    for channel in np.unique(channels).tolist():
        own = entries[begin:][channels == channel]
        index[channel] = np.concatenate((index[channel], own)) if channel in index else own
    return index
