"""Traces: what a page draws of a recording, thinned while it is read."""

import numpy as np

from teleop_core.evaluation.accumulators import Integers
from teleop_core.geometry import Array

BUCKETS = 1500
"""Stretches of time with a smallest and a largest value each: about one per pixel."""
PATH_POINTS = 5000
"""Points of a path in space."""
_SECOND_NS = 1e9


class Envelope:
    """Smallest and largest value of each column per stretch of time, so that peaks survive.

    Args:
        start_ns: Where the first stretch begins, [ns].
        end_ns: Where the last one ends, [ns].
        columns: Number of columns.
    """

    def __init__(self, start_ns: int, end_ns: int, columns: int) -> None:
        self._start_ns, self._length_ns = start_ns, max(1, end_ns - start_ns + 1)
        self._lowest = np.full((BUCKETS, columns), np.inf)
        self._highest = np.full((BUCKETS, columns), -np.inf)

    def add(self, time_ns: Integers, values: Array) -> None:
        """Take samples: times (N,) in order [ns], values (N, columns); NaN is left out."""
        if not len(time_ns):
            return
        elapsed = (time_ns - self._start_ns) / self._length_ns
        bucket = np.clip((elapsed * BUCKETS).astype(np.int64), 0, BUCKETS - 1)
        begins = np.flatnonzero(np.diff(bucket, prepend=-1))
        at = bucket[begins]
        low, high = np.fmin.reduceat(values, begins), np.fmax.reduceat(values, begins)
        self._lowest[at] = np.fmin(self._lowest[at], low)
        self._highest[at] = np.fmax(self._highest[at], high)

    def line(self) -> tuple[Array, Array]:
        """Times (M,) [s] from the start and values (M, columns) of lines through all extremes.

        Each stretch gives two points, in the order in which the line rises or falls there.
        """
        width = self._length_ns / BUCKETS / _SECOND_NS
        is_full = np.isfinite(self._lowest).any(axis=1)
        low, high = self._lowest[is_full], self._highest[is_full]
        if not len(low):
            return np.empty(0), np.empty((0, low.shape[1]))
        is_known = np.isfinite(low)
        middle = np.where(is_known, 0.5 * (low + np.where(is_known, high, 0.0)), 0.0)
        low, high = np.where(is_known, low, np.nan), np.where(is_known, high, np.nan)
        rises = np.gradient(middle, axis=0) >= 0.0 if len(low) > 1 else np.ones_like(low, bool)
        pairs: Array = np.stack((np.where(rises, low, high), np.where(rises, high, low)), axis=1)
        times = (np.flatnonzero(is_full)[:, None] + np.array([0.25, 0.75])) * width
        return times.ravel(), pairs.reshape(-1, low.shape[1])


class Thinned:
    """Every n-th row of a stream, at most :data:`PATH_POINTS` of the expected number."""

    def __init__(self, expected: int) -> None:
        self.every = max(1, -(-expected // PATH_POINTS))
        self._seen = 0
        self._parts: list[Array] = []

    def add(self, rows: Array) -> None:
        """Take rows, shape (N, columns)."""
        self._parts.append(rows[-self._seen % self.every :: self.every].astype(np.float32))
        self._seen += len(rows)

    def rows(self) -> Array:
        """Rows that were kept, shape (M, columns)."""
        return np.concatenate(self._parts) if self._parts else np.empty((0, 0))
