"""Layouts: the position of each number of a fixed-size message in its CDR bytes.

All messages of a stream have the same frame and the same joint names, hence the same size: their
bytes are one constant template with a stamp and some numbers in it. Batches are therefore built
and read as packed numpy records, single messages with one ``struct`` call.

This module writes zeros as padding between fields and ignores padding when it reads: rclpy leaves padding
uninitialised, and also pads the end of some messages.
"""

import struct
from functools import cache

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags.cdr import NUMPY_CODES, Template, template
from teleop_core.base.errors import ShapeError
from teleop_core.graph.topics import Kind, Topic

Bytes = NDArray[np.uint8]
Stamps = NDArray[np.int64]
Values = NDArray[np.float64]

SECOND_NS = 1_000_000_000
_POSES = (Kind.POSE, Kind.POSES)


class Layout:
    """Template for the bytes of every message of one stream.

    Attributes:
        kind: Kind of the values.
        joint_names: Names in the order of the columns; empty without joints.
        frame_id: Frame in the header.
        size: Size of one message [bytes].
        width: Number of values in one message, which is the number of columns.
        template: One message whose numbers are zero, shape (size,).
        mask: Bits that are equal in all messages, shape (size,).
        places: Place of each value, shape (width,), among the float64 numbers of a message, counted after the
            encapsulation header; for buttons among its int32 numbers, counted from the beginning.
    """

    def __init__(self, kind: Kind, joint_names: tuple[str, ...], frame_id: str) -> None:
        cdr = template(kind, joint_names, frame_id)
        self.kind, self.joint_names, self.frame_id = kind, joint_names, frame_id
        self.size, self.width = len(cdr.template), kind.width(len(joint_names))
        self.template: Bytes = np.frombuffer(bytes(cdr.template), np.uint8)
        mask = np.zeros(self.size, np.uint8)
        for begin, end in cdr.constants():
            mask[begin:end] = np.frombuffer(bytes(cdr.mask[begin:end]), np.uint8)
        mask.flags.writeable = False
        self.mask: Bytes = mask
        self._columns = [columns for *_, columns in cdr.gaps[2:]]
        self._order = [i for columns in self._columns for i in range(columns.start, columns.stop)]
        self.places = np.zeros(self.width, np.int64)
        for at, code, count, columns in cdr.gaps[2:]:
            first = (at - 4) // 8 if code == "d" else at // 4
            self.places[columns] = np.arange(first, first + count)
        self._dtype = np.dtype(
            {
                "names": ["sec", "nanosec", *(f"part{i}" for i in range(len(self._columns)))],
                "formats": [
                    f"<{count}{NUMPY_CODES[code]}" if i > 1 else f"<{NUMPY_CODES[code]}"
                    for i, (_, code, count, _) in enumerate(cdr.gaps)
                ],
                "offsets": [at for at, *_ in cdr.gaps],
                "itemsize": self.size,
            }
        )
        self._prepare_single(cdr)

    def _prepare_single(self, cdr: Template) -> None:
        """Prepare the struct of one message; every run of constant bytes is one string in the struct."""
        form, fixed, index = "<", [], 0
        gaps = {at: (code, count) for at, code, count, _ in cdr.gaps}
        for begin, end in cdr.constants():
            if end > begin:
                form, index = f"{form}{end - begin}s", index + 1
                fixed.append((index - 1, bytes(cdr.template[begin:end]), bytes(cdr.mask[begin:end])))
            if end in gaps:
                code, count = gaps[end]
                form, index = f"{form}{count}{code}", index + count
        single = struct.Struct(form)
        self._pack, self._unpack = single.pack, single.unpack_from
        self._head, self._frame = fixed[0][1], fixed[1][1]
        self._fixed = fixed
        # Strings between or after the numbers: the index of each among the arguments after the frame.
        self._inner = [(at - 4, data) for at, data, _ in fixed[2:]]

    # -- batches ---------------------------------------------------------------------------------

    def encode(self, stamps_ns: Stamps, values: Values) -> Bytes:
        """Bytes of N messages.

        Args:
            stamps_ns: Stamps of the headers, shape (N,), [ns].
            values: Columns as in :class:`Kind`, shape (N, width).

        Returns:
            Bytes of the messages, shape (N, size).

        Raises:
            ShapeError: ``values`` does not have the shape (N, width).
        """
        rows = np.empty((len(stamps_ns), self.size), np.uint8)
        self.encode_into(rows, stamps_ns, values)
        return rows

    def encode_into(self, rows: Bytes, stamps_ns: Stamps, values: Values) -> None:
        """Write the bytes of N messages into ``rows``, shape (N, size); see :meth:`encode`.

        The bytes of each row are contiguous.
        """
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
        """Stamps, shape (N,), [ns], and values, shape (N, width), of messages that match this layout.

        Args:
            rows: Whole messages, shape (N, size), or wider if there is padding at the end.
        """
        records = rows[:, : self.size].view(self._dtype)[:, 0]
        values = np.empty((len(rows), self.width))
        for index, columns in enumerate(self._columns):
            values[:, columns] = records[f"part{index}"]
        return records["sec"].astype(np.int64) * SECOND_NS + records["nanosec"], values

    def matches(self, rows: Bytes) -> bool:
        """Whether all messages, shape (N, size or more), are equal to the template except for the numbers."""
        if rows.shape[1] < self.size:
            return False
        return not ((rows[:, : self.size] ^ self.template) & self.mask).any()

    # -- single messages -------------------------------------------------------------------------

    def encode_one(self, stamp_ns: int, values: Values) -> bytes:
        """Bytes of one message; ``values`` has shape (width,)."""
        numbers = values.tolist()
        if self.kind in _POSES:
            numbers = [numbers[i] for i in self._order]
        elif self.kind is Kind.BUTTONS:
            numbers = [int(number) for number in numbers]
        for index, text in self._inner:
            numbers.insert(index, text)
        seconds, nanoseconds = divmod(stamp_ns, SECOND_NS)
        return self._pack(self._head, seconds, nanoseconds, self._frame, *numbers)

    def decode_one(self, data: bytes) -> tuple[int, Values] | None:
        """Stamp [ns] and values, shape (width,), of one message; None if it does not match this layout."""
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
        values = np.array(numbers, np.float64)
        if self.kind in _POSES:
            values[self._order] = numbers
        return seconds * SECOND_NS + nanoseconds, values

    def _is_same_but_padding(self, data: bytes) -> bool:
        return self.matches(np.frombuffer(data, np.uint8)[np.newaxis])


def layout_of(kind: Kind, joint_names: tuple[str, ...], frame_id: str) -> Layout:
    """Layout of a kind of message, with the joint names if it has joints. Equal layouts are built once and shared."""
    return _make(kind, joint_names if kind.has_names else (), frame_id)


@cache
def _make(kind: Kind, joint_names: tuple[str, ...], frame_id: str) -> Layout:
    return Layout(kind, joint_names, frame_id)


def layout(topic: Topic, joint_names: tuple[str, ...], frame_id: str | None = None) -> Layout:
    """Layout of a topic's messages.

    Args:
        topic: A stream; reports have no fixed layout.
        joint_names: Joints of the robot, in the order of the columns.
        frame_id: Frame to write instead of the topic's own frame.

    Raises:
        ValueError: The topic carries reports.
    """
    if topic.kind is Kind.REPORT:
        raise ValueError(f"{topic.name} carries reports, which have no fixed layout")
    names = topic.names(joint_names)
    return layout_of(topic.kind, names, topic.frame_id if frame_id is None else frame_id)


def discover(kind: Kind, data: bytes) -> Layout | None:
    """Layout of the stream that a message comes from; None if the message fits no layout.

    Args:
        kind: Kind of the values. For joints, the message itself decides whether it has velocity and effort.
        data: CDR of the stream's first message.
    """
    try:
        frame_id, at = _read_string(data, 12)
        names: list[str] = []
        if kind.has_names:
            count, at = _read_length(data, at)
            for _ in range(count):
                name, at = _read_string(data, at)
                names.append(name)
    except (struct.error, UnicodeDecodeError):
        return None
    found = layout_of(kind, tuple(names), frame_id)
    return found if found.decode_one(data) is not None else None


def frame_of(data: bytes) -> str:
    """Frame in the header of a message; empty if the message has no frame."""
    try:
        return _read_string(data, 12)[0]
    except (struct.error, UnicodeDecodeError):
        return ""


def _read_length(data: bytes, at: int) -> tuple[int, int]:
    at += -at % 4
    return struct.unpack_from("<I", data, at)[0], at + 4


def _read_string(data: bytes, at: int) -> tuple[str, int]:
    length, at = _read_length(data, at)
    if length == 0 or at + length > len(data):
        raise struct.error("a string leaves the message")
    return bytes(data[at : at + length - 1]).decode(), at + length
