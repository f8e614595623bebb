"""Spool: rows of numbers that are kept between two passes, on disk if there are many."""

import tempfile

import numpy as np
from numpy.typing import NDArray

from teleop_core.kernels.geometry import Array

IN_MEMORY = 32 << 20
"""Bytes from which on the rows go to a temporary file."""


class Spool:
    """Rows (N, width), written once in order and then read in any order; to be used with ``with``.

    Args:
        width: Numbers in a row.
    """

    def __init__(self, width: int) -> None:
        self.width, self.count = width, 0
        self._size = 8 * width
        self._file = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY)  # noqa: SIM115

    def add(self, rows: Array) -> None:
        """Append rows (n, width)."""
        self._file.write(np.ascontiguousarray(rows, dtype=np.float64).tobytes())
        self.count += len(rows)

    def rows(self, begin: int, end: int) -> Array:
        """Rows (end - begin, width) from one to before another."""
        self._file.seek(begin * self._size)
        data = self._file.read((end - begin) * self._size)
        return np.frombuffer(data, np.float64).reshape(-1, self.width).copy()

    def chosen(self, numbers: NDArray[np.int32] | NDArray[np.int64]) -> Array:
        """Rows of these numbers, in their order."""
        if not len(numbers):
            return np.empty((0, self.width))
        low, high = int(numbers.min()), int(numbers.max()) + 1
        if high - low <= 4 * len(numbers) + 1000:
            return self.rows(low, high)[numbers - low]
        return np.concatenate([self.rows(number, number + 1) for number in numbers.tolist()])

    def put(self, begin: int, rows: Array) -> None:
        """Write rows over those from ``begin`` on."""
        self._file.seek(begin * self._size)
        self._file.write(np.ascontiguousarray(rows, dtype=np.float64).tobytes())

    def close(self) -> None:
        """Forget the rows."""
        self._file.close()

    def __enter__(self) -> "Spool":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
