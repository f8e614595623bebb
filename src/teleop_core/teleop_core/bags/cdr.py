"""CDR: the serialisation of ROS 2 messages, as a template of constant bytes with gaps in it."""

import struct
from dataclasses import dataclass, field

from teleop_core.graph.topics import POSES, Kind

NUMPY_CODES = {"i": "i4", "I": "u4", "d": "f8"}
_ENCAPSULATION = b"\x00\x01"  # plain CDR, little-endian; two bytes of options follow


@dataclass
class Template:
    """A message under construction: constant bytes, and gaps for numbers.

    Alignment is counted from the end of the four-byte encapsulation header (XCDR1).
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

    def numbers(self, code: str, *numbers: float) -> None:
        """Append constant numbers of one struct code."""
        self.block(code, struct.pack(f"<{len(numbers)}{code}", *numbers))

    def block(self, code: str, data: bytes) -> None:
        """Append the bytes of constant numbers of one struct code."""
        self._align(struct.calcsize(code))
        self._extend(data, b"\xff")

    def gap(self, code: str, columns: slice) -> None:
        """Append a gap for numbers of one struct code; each message fills the gap with ``columns`` of its values."""
        self._align(struct.calcsize(code))
        count = columns.stop - columns.start
        self.gaps.append((len(self.template), code, count, columns))
        self._extend(bytes(struct.calcsize(code) * count), b"\0")

    def constants(self) -> list[tuple[int, int]]:
        """Begin and end of each run of constant bytes between gaps."""
        ends = [(at, at + struct.calcsize(code) * count) for at, code, count, _ in self.gaps]
        begins = [0, *(end for _, end in ends)]
        return list(zip(begins, [*(at for at, _ in ends), len(self.template)], strict=True))


def _stamped(frame_id: str) -> Template:
    cdr = Template()
    cdr.gap("i", slice(-2, -1))
    cdr.gap("I", slice(-2, -1))
    cdr.string(frame_id)
    return cdr


def template(kind: Kind, joint_names: tuple[str, ...], frame_id: str) -> Template:
    """Bytes of every message of a stream, with gaps for stamp and values."""
    cdr, count = _stamped(frame_id), len(joint_names)
    if kind in {Kind.POSE, Kind.POSES}:
        if kind is Kind.POSES:
            cdr.length(POSES)
        for begin in range(0, kind.width(0), 7):
            for first, last in ((0, 3), (4, 7), (3, 4)):
                cdr.gap("d", slice(begin + first, begin + last))
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
            is_filled = part == 0 or kind.has_motion
            cdr.length(count * is_filled)
            if is_filled and count:
                cdr.gap("d", slice(part * count, (part + 1) * count))
    return cdr
