"""Layouts: where each number of a fixed-size message stands in its CDR bytes.

All messages of a stream have the same frame and the same joint names, hence the same size: their
bytes are one constant template with a stamp and some numbers in it. Batches are therefore built
and read as packed numpy records, single messages with one ``struct`` call.

Padding between fields is zero in what is written here and ignored in what is read: rclpy leaves
it uninitialised, and pads the end of some messages too.
"""

import struct
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags.topics import Kind, Topic
from teleop_core.errors import ShapeError

Bytes = NDArray[np.uint8]
Stamps = NDArray[np.int64]
Values = NDArray[np.float64]

SECOND_NS = 1_000_000_000
_ENCAPSULATION = b"\x00\x01"  # plain CDR, little-endian; two bytes of options follow
_QUATERNION = (3, 7)  # columns w, x, y, z of a pose; in the message x, y, z, w


@dataclass
class _Cdr:
    """A message as it grows: constant bytes, and gaps for numbers.

    Alignment counts from after the four bytes of the encapsulation header (XCDR1).
    """

    template: bytearray = field(default_factory=lambda: bytearray(_ENCAPSULATION + b"\0\0"))
    mask: bytearray = field(default_factory=lambda: bytearray(b"\xff\xff\0\0"))
    gaps: list[tuple[int, str, int, slice]] = field(default_factory=list)

    def _extend(self, data: bytes, mask: bytes) -> None:
        self.template += data
        self.mask += mask * len(data)

    def _align(self, size: int) -> None:
        self._extend(bytes((4 - len(self.template)) % size), b"\0")

    def length(self, count: int) -> None:
        """Append the length of a sequence."""
        self._align(4)
        self._extend(struct.pack("<I", count), b"\xff")

    def string(self, text: str) -> None:
        """Append a constant string."""
        data = text.encode() + b"\0"
        self.length(len(data))
        self._extend(data, b"\xff")

    def gap(self, code: str, columns: slice) -> None:
        """Append numbers of one struct code that vary: these columns of the values."""
        self._align(struct.calcsize(code))
        count = columns.stop - columns.start
        self.gaps.append((len(self.template), code, count, columns))
        self._extend(bytes(struct.calcsize(code) * count), b"\0")

    def constants(self) -> list[tuple[int, int]]:
        """Begin and end of each run of bytes between gaps."""
        ends = [(at, at + struct.calcsize(code) * count) for at, code, count, _ in self.gaps]
        begins = [0, *(end for _, end in ends)]
        return list(zip(begins, [*(at for at, _ in ends), len(self.template)], strict=True))


def _stamped(frame_id: str) -> _Cdr:
    """Message with a header."""
    cdr = _Cdr()
    cdr.gap("i", slice(-2, -1))
    cdr.gap("I", slice(-2, -1))
    cdr.string(frame_id)
    return cdr


def _describe(kind: Kind, joint_names: tuple[str, ...], frame_id: str) -> _Cdr:
    cdr, count = _stamped(frame_id), len(joint_names)
    if kind is Kind.POSE:
        for columns in (slice(0, 3), slice(4, 7), slice(3, 4)):
            cdr.gap("d", columns)
    elif kind in {Kind.TWIST, Kind.WRENCH}:
        cdr.gap("d", slice(0, 6))
    elif kind is Kind.BUTTONS:
        cdr.length(0)
        cdr.length(3)
        cdr.gap("i", slice(0, 3))
    else:
        cdr.length(count)
        for name in joint_names:
            cdr.string(name)
        for part in range(3):
            is_filled = part == 0 or kind is Kind.STATE
            cdr.length(count * is_filled)
            if is_filled and count:
                cdr.gap("d", slice(part * count, (part + 1) * count))
    return cdr


class Layout:
    """Bytes of every message of one stream.

    Attributes:
        kind: What the values are.
        joint_names: Names in the order of the columns; empty without joints.
        frame_id: Frame in the header.
        size: Bytes of one message.
        width: Numbers in one message, the columns of its values.
    """

    def __init__(self, kind: Kind, joint_names: tuple[str, ...], frame_id: str) -> None:
        cdr = _describe(kind, joint_names, frame_id)
        self.kind, self.joint_names, self.frame_id = kind, joint_names, frame_id
        self.size, self.width = len(cdr.template), kind.width(len(joint_names))
        self.template: Bytes = np.frombuffer(bytes(cdr.template), np.uint8)
        self._mask: Bytes = np.frombuffer(bytes(cdr.mask), np.uint8)
        self._columns = [columns for *_, columns in cdr.gaps[2:]]
        self._runs = [slice(a, b) for a, b in cdr.constants() if b > a]
        self._dtype = np.dtype(
            {
                "names": ["sec", "nanosec", *(f"part{i}" for i in range(len(self._columns)))],
                "formats": [f"<{count}{code}" if i > 1 else f"<{code}"
                            for i, (_, code, count, _) in enumerate(_numpy_codes(cdr.gaps))],
                "offsets": [at for at, *_ in cdr.gaps],
                "itemsize": self.size,
            }
        )  # fmt: skip
        self._prepare_single(cdr)

    def _prepare_single(self, cdr: _Cdr) -> None:
        """Struct of one message; every run of constant bytes is one string of it."""
        form, fixed, index = "<", [], 0
        gaps = {at: (code, count) for at, code, count, _ in cdr.gaps}
        for begin, end in cdr.constants():
            if end > begin:
                form, index = f"{form}{end - begin}s", index + 1
                fixed.append(
                    (index - 1, bytes(cdr.template[begin:end]), bytes(cdr.mask[begin:end]))
                )
            if end in gaps:
                code, count = gaps[end]
                form, index = f"{form}{count}{code}", index + count
        single = struct.Struct(form)
        self._pack, self._unpack = single.pack, single.unpack_from
        self._head, self._frame = fixed[0][1], fixed[1][1]
        self._fixed = fixed
        # Strings between or after the numbers: index among the arguments that follow the frame.
        self._inner = [(at - 4, data) for at, data, _ in fixed[2:]]

    # -- batches ---------------------------------------------------------------------------------

    def encode(self, stamps_ns: Stamps, values: Values) -> Bytes:
        """Bytes of N messages.

        Args:
            stamps_ns: Stamps of the headers, shape (N,), [ns].
            values: Columns as in :class:`Kind`, shape (N, width).

        Returns:
            Shape (N, size).

        Raises:
            ShapeError: The values have another shape.
        """
        rows = np.empty((len(stamps_ns), self.size), np.uint8)
        self.encode_into(rows, stamps_ns, values)
        return rows

    def encode_into(self, rows: Bytes, stamps_ns: Stamps, values: Values) -> None:
        """As :meth:`encode`, into rows of shape (N, size) whose bytes follow each other."""
        if values.shape != (len(rows), self.width) or stamps_ns.shape != (len(rows),):
            raise ShapeError("values", (len(rows), self.width), values.shape)
        rows[:] = self.template
        records = rows.view(self._dtype)[:, 0]
        seconds = stamps_ns // SECOND_NS
        records["sec"] = seconds
        records["nanosec"] = stamps_ns - seconds * SECOND_NS
        for index, columns in enumerate(self._columns):
            records[f"part{index}"] = values[:, columns]

    def decode(self, rows: Bytes) -> tuple[Stamps, Values]:
        """Stamps, shape (N,), [ns], and values, shape (N, width), of messages that match.

        Args:
            rows: Whole messages, shape (N, size) or longer by padding at the end.
        """
        records = rows[:, : self.size].view(self._dtype)[:, 0]
        values = np.empty((len(rows), self.width))
        for index, columns in enumerate(self._columns):
            values[:, columns] = records[f"part{index}"]
        return records["sec"].astype(np.int64) * SECOND_NS + records["nanosec"], values

    def matches(self, rows: Bytes) -> bool:
        """Whether messages, shape (N, size or more), differ from the template in numbers only."""
        if rows.shape[1] < self.size:
            return False
        for run in self._runs:
            difference = rows[:, run] ^ self.template[run]
            if difference.any() and (difference & self._mask[run]).any():
                return False
        return True

    # -- single messages -------------------------------------------------------------------------

    def encode_one(self, stamp_ns: int, values: Values) -> bytes:
        """Bytes of one message; ``values`` has shape (width,)."""
        numbers = values.tolist()
        if self.kind is Kind.POSE:
            numbers.append(numbers.pop(3))
        elif self.kind is Kind.BUTTONS:
            numbers = [int(number) for number in numbers]
        for index, text in self._inner:
            numbers.insert(index, text)
        seconds, nanoseconds = divmod(stamp_ns, SECOND_NS)
        return self._pack(self._head, seconds, nanoseconds, self._frame, *numbers)

    def decode_one(self, data: bytes) -> tuple[int, Values] | None:
        """Stamp [ns] and values, shape (width,), of one message; None when it does not match."""
        try:
            head, seconds, nanoseconds, frame, *numbers = self._unpack(data)
        except struct.error:
            return None
        is_exact = head == self._head and frame == self._frame
        if not is_exact and not self._is_same_but_padding(data):
            return None
        for index, text in reversed(self._inner):
            if numbers.pop(index) != text and not self._is_same_but_padding(data):
                return None
        if self.kind is Kind.POSE:
            numbers.insert(3, numbers.pop())
        return seconds * SECOND_NS + nanoseconds, np.array(numbers, np.float64)

    def _is_same_but_padding(self, data: bytes) -> bool:
        return self.matches(np.frombuffer(data, np.uint8)[np.newaxis])


def _numpy_codes(
    gaps: list[tuple[int, str, int, slice]],
) -> list[tuple[int, str, int, slice]]:
    codes = {"i": "i4", "I": "u4", "d": "f8"}
    return [(at, codes[code], count, columns) for at, code, count, columns in gaps]


def layout_of(kind: Kind, joint_names: tuple[str, ...], frame_id: str) -> Layout:
    """Layout of a kind of message, with the names if it has joints; made once."""
    return _make(kind, joint_names if kind in {Kind.JOINTS, Kind.STATE} else (), frame_id)


@cache
def _make(kind: Kind, joint_names: tuple[str, ...], frame_id: str) -> Layout:
    return Layout(kind, joint_names, frame_id)


def layout(topic: Topic, joint_names: tuple[str, ...], frame_id: str | None = None) -> Layout:
    """Layout of a topic's messages.

    Args:
        topic: A stream; reports have no fixed layout.
        joint_names: Joints of the robot, in the order of the columns.
        frame_id: Frame to write in place of the topic's own.

    Raises:
        ValueError: The topic carries reports.
    """
    if topic.kind is Kind.REPORT:
        raise ValueError(f"{topic.name} carries reports, which have no fixed layout")
    return layout_of(topic.kind, joint_names, topic.frame_id if frame_id is None else frame_id)


def discover(kind: Kind, data: bytes) -> Layout | None:
    """Layout of the stream that a message comes from; None if it fits none.

    Args:
        kind: What the values are; for joints the message says whether it has velocity and effort.
        data: CDR of the stream's first message.
    """
    try:
        frame_id, at = _read_string(data, 12)
        names: list[str] = []
        if kind in {Kind.JOINTS, Kind.STATE}:
            count, at = _read_length(data, at)
            for _ in range(count):
                name, at = _read_string(data, at)
                names.append(name)
    except (struct.error, UnicodeDecodeError):
        return None
    found = layout_of(kind, tuple(names), frame_id)
    return found if found.decode_one(data) is not None else None


def _read_length(data: bytes, at: int) -> tuple[int, int]:
    at += -at % 4
    return struct.unpack_from("<I", data, at)[0], at + 4


def _read_string(data: bytes, at: int) -> tuple[str, int]:
    length, at = _read_length(data, at)
    if length == 0 or at + length > len(data):
        raise struct.error("a string leaves the message")
    return bytes(data[at : at + length - 1]).decode(), at + length
