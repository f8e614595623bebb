"""Walk: finds the records of an MCAP file.

The functions are compiled, since they process every message of a recording.
"""

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from teleop_core.bags.layouts import Bytes, Stamps
from teleop_core.kernels import inner, kernel

Rows = NDArray[np.int64]
_MESSAGE = int(Opcode.MESSAGE)
_MESSAGE_HEAD = 22  # bytes of a message record before its CDR
OPCODE, BEGIN, SIZE, CHANNEL, LOG = range(5)  # columns of ``Rows``


@inner
def _little_endian(data, at, count):  # type: ignore[no-untyped-def]
    """Unsigned little-endian number of ``count`` bytes; eight bytes give a signed number."""
    number = np.int64(0)
    for i in range(count):
        number |= np.int64(data[at + i]) << (8 * i)
    return number


@kernel
def _walk(data, at, end, rows):  # type: ignore[no-untyped-def]
    """Fill ``rows`` with opcode, begin, size, channel, log time.

    Return the number of filled rows and the end position.
    """
    count = 0
    while at + 9 <= end and count < len(rows):
        size = _little_endian(data, at + 1, 8)
        if size < 0 or size > end - at - 9:
            break
        rows[count, 0] = data[at]
        rows[count, 1] = at + 9
        rows[count, 2] = size
        rows[count, 3] = -1
        rows[count, 4] = -1
        if data[at] == _MESSAGE:
            if size < _MESSAGE_HEAD:
                break
            rows[count, 1] = at + 9 + _MESSAGE_HEAD
            rows[count, 2] = size - _MESSAGE_HEAD
            rows[count, 3] = _little_endian(data, at + 9, 2)
            rows[count, 4] = _little_endian(data, at + 15, 8)
        count += 1
        at += 9 + size
    return count, at


@kernel
def _gather(data, begins, template, mask, out):  # type: ignore[no-untyped-def]
    """Copy pieces of equal size into ``out``.

    Return whether all pieces are equal to ``template`` where ``mask`` is not zero.
    """
    wrong, size = np.uint8(0), out.shape[1]
    for i in range(len(begins)):
        piece = data[begins[i] : begins[i] + size]  # numba does not test the sign of an index into a slice
        row = out[i]
        for j in range(size):
            row[j] = piece[j]
            wrong |= (piece[j] ^ template[j]) & mask[j]
    return wrong == 0


def walk(data: Bytes, begin: int, end: int) -> tuple[Rows, int]:
    """Table of the whole records between two positions.

    Args:
        data: Read-only bytes.
        begin: Position at which the first record begins.
        end: Position at which reading ends; records beyond this position are not read.

    Returns:
        Rows of (opcode, begin of the payload, its size, channel, log time [ns]), shape (n, 5), and the position at
        which the last whole record ends. The payload of a message is its CDR. Records other than messages have channel
        -1 and log time -1.
    """
    parts = []
    while True:
        rows = np.empty(((end - begin) // (9 + _MESSAGE_HEAD) + 16, 5), np.int64)
        count, at = _walk(data, begin, end, rows)
        parts.append(rows[:count])
        if count < len(rows):
            return np.concatenate(parts) if len(parts) > 1 else parts[0], at
        begin = at


def gather(data: Bytes, begins: Stamps, template: Bytes, mask: Bytes) -> Bytes | None:
    """Pieces of equal size that begin at the given positions, shape (n, size).

    The result is None if any piece differs from the template.

    Args:
        data: Read-only bytes.
        begins: Begin of each piece, shape (n,); each piece must end within the data.
        template: Expected bytes of a piece, shape (size,).
        mask: Bits that are compared with the template, shape (size,).
    """
    out = np.empty((len(begins), len(template)), np.uint8)
    return out if _gather(data, np.ascontiguousarray(begins), template, mask, out) else None
