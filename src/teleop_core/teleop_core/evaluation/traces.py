"""Traces: the curves that a page draws of a recording, collected while the recording is read."""

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation.accumulators import Integers
from teleop_core.kernels.geometry import Array

SAMPLES = 660_000
"""Largest number of samples of a stream for which every sample is stored: eleven minutes at 1 kHz."""
BUCKETS = SAMPLES // 2
"""Number of intervals of a longer recording; only the smallest and largest value of each interval are stored."""
_SECOND_NS = 1e9
Rows = NDArray[np.float32]


def spacing_s(samples: int, duration_s: float) -> float:
    """Length [s] of the intervals of which a page keeps the smallest and largest value; 0 if it keeps all samples.

    Args:
        samples: Number of samples of the stream in the recording.
        duration_s: Length of the recording, [s].
    """
    return duration_s / BUCKETS if samples > SAMPLES else 0.0


class Envelope:
    """Stores columns against time: every sample, if there are no more than :data:`SAMPLES`.

    For a longer recording it keeps the smallest and largest value of each column in each of :data:`BUCKETS` time
    intervals. Peaks are thus kept and the memory use does not grow.

    Args:
        start_ns: Begin of the recording, [ns].
        end_ns: End of the recording, [ns].
        columns: Number of columns.
    """

    def __init__(self, start_ns: int, end_ns: int, columns: int) -> None:
        self._start_ns, self._end_ns, self._columns = start_ns, end_ns, columns
        self._parts: list[tuple[Integers, Rows]] = []
        self._times: Array | None = None
        self._count = 0
        self._buckets: _Buckets | None = None

    def add(self, time_ns: Integers, values: Array) -> None:
        """Add samples: sorted times (N,) [ns] and values (N, columns); NaN is left out."""
        if not len(time_ns):
            return
        rows = values.astype(np.float32)
        if self._buckets is not None:
            self._buckets.add(time_ns, rows)
            return
        self._parts.append((time_ns.copy(), rows))
        self._count += len(time_ns)
        if self._count > SAMPLES:
            self._buckets = _Buckets(self._start_ns, self._end_ns, self._columns)
            for part in self._parts:
                self._buckets.add(*part)
            self._parts.clear()

    def line(self) -> tuple[Array, Rows]:
        """Curve through all samples or extremes: times since the start (M,) [s] and values (M, columns).

        Each interval of a long recording gives two points, ordered so that the line rises or falls as the samples do.
        """
        if self._buckets is not None:
            return self._buckets.line()
        if not self._parts:
            return np.empty(0), np.empty((0, self._columns), np.float32)
        if len(self._parts) > 1 or self._times is None:
            times_ns, rows = (np.concatenate(column) for column in zip(*self._parts, strict=True))
            self._parts = [(times_ns, rows)]  # replace the parts, to free the second copy
            self._times = (times_ns - self._start_ns) / _SECOND_NS
        return self._times, self._parts[0][1]


class _Buckets:
    """Smallest and largest value of each column per time interval."""

    def __init__(self, start_ns: int, end_ns: int, columns: int) -> None:
        self._start_ns, self._length_ns = start_ns, max(1, end_ns - start_ns + 1)
        self._lowest = np.full((BUCKETS, columns), np.inf, np.float32)
        self._highest = np.full((BUCKETS, columns), -np.inf, np.float32)

    def add(self, time_ns: Integers, values: Rows) -> None:
        elapsed = (time_ns - self._start_ns) / self._length_ns
        bucket = np.clip((elapsed * BUCKETS).astype(np.int64), 0, BUCKETS - 1)
        begins = np.flatnonzero(np.diff(bucket, prepend=-1))
        at = bucket[begins]
        low, high = np.fmin.reduceat(values, begins), np.fmax.reduceat(values, begins)
        self._lowest[at] = np.fmin(self._lowest[at], low)
        self._highest[at] = np.fmax(self._highest[at], high)

    def line(self) -> tuple[Array, Rows]:
        width = self._length_ns / BUCKETS / _SECOND_NS
        is_full = np.isfinite(self._lowest).any(axis=1)
        low, high = self._lowest[is_full], self._highest[is_full]
        is_known = np.isfinite(low)
        middle = np.where(is_known, 0.5 * (low + np.where(is_known, high, 0.0)), 0.0)
        low, high = np.where(is_known, low, np.nan), np.where(is_known, high, np.nan)
        rises = np.gradient(middle, axis=0) >= 0.0 if len(low) > 1 else np.ones_like(low, bool)
        pairs = np.stack((np.where(rises, low, high), np.where(rises, high, low)), axis=1)
        times = (np.flatnonzero(is_full)[:, None] + np.array([0.25, 0.75])) * width
        return times.ravel(), pairs.reshape(-1, low.shape[1])
