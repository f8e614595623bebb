"""Accumulators: statistics of a stream that is passed in parts.

The memory of an accumulator does not grow with the number of samples, so a recording of any length can be scored.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from teleop_core.kernels.geometry import Array

Integers = NDArray[np.int64]
_US = 1000  # resolution of a distribution [ns]


@dataclass(frozen=True)
class Spread:
    """Root mean square, sample standard deviation (n − 1) and largest magnitude of an error.

    A value is None if there are too few samples: ``rms`` and ``max`` need one sample, ``sd`` needs two.
    """

    rms: float | None
    sd: float | None
    max: float | None


@dataclass(frozen=True)
class DelaySpread:
    """Median, 99th percentile and maximum of a delay, [ms]; None without samples."""

    median: float | None
    p99: float | None
    max: float | None


class Moments:
    """Accumulates the spread of scalar samples; samples that are not finite are left out.

    Source:
        Chan, Golub and LeVeque 1983, eq. 2.1: merging means and squared deviations.
    """

    def __init__(self) -> None:
        self.count = 0
        self._mean = self._deviations = self._squares = self._largest = 0.0

    def add(self, samples: Array) -> None:
        """Add samples, shape (N,)."""
        finite = np.isfinite(samples)
        if not finite.all():
            samples = samples[finite]
        count = len(samples)
        if not count:
            return
        mean = float(samples.mean())
        centred = samples - mean
        step, total = mean - self._mean, self.count + count
        self._deviations += float(centred @ centred) + step * step * self.count * count / total
        self._mean += step * count / total
        self._squares += float(samples @ samples)
        self._largest = max(self._largest, float(np.abs(samples).max()))
        self.count = total

    def spread(self) -> Spread:
        """Spread of all samples added so far."""
        if not self.count:
            return Spread(None, None, None)
        sd = math.sqrt(self._deviations / (self.count - 1)) if self.count > 1 else None
        return Spread(math.sqrt(self._squares / self.count), sd, self._largest)


class Distribution:
    """Counts durations, rounded to microseconds, so that quantiles need no stored samples."""

    def __init__(self) -> None:
        self.values_us: Integers = np.empty(0, np.int64)
        self.counts: Integers = np.empty(0, np.int64)

    def add(self, durations_ns: Integers) -> None:
        """Add durations, shape (N,), [ns]."""
        values, counts = np.unique((durations_ns + _US // 2) // _US, return_counts=True)
        if np.array_equal(values, self.values_us):
            self.counts = self.counts + counts
            return
        merged = np.union1d(self.values_us, values)
        total = np.zeros(len(merged), np.int64)
        total[np.searchsorted(merged, self.values_us)] += self.counts
        total[np.searchsorted(merged, values)] += counts
        self.values_us, self.counts = merged, total

    @property
    def count(self) -> int:
        """Number of durations."""
        return int(self.counts.sum())

    def quantile_us(self, share: float) -> int | None:
        """Quantile [µs]: the smallest duration for which at least a share (0 to 1) of all durations is not longer."""
        if not len(self.counts):
            return None
        rank = max(1, math.ceil(share * self.count))
        return int(self.values_us[np.searchsorted(np.cumsum(self.counts), rank)])

    def delay(self) -> DelaySpread:
        """Median, 99th percentile and maximum of the durations added so far, [ms]."""
        median, p99, largest = (self.quantile_us(share) for share in (0.5, 0.99, 1.0))
        return DelaySpread(_ms(median), _ms(p99), _ms(largest))

    def histogram(self, width_us: int) -> tuple[Array, Array]:
        """Share of the durations per bin, for drawing.

        The last bin contains the 99th percentile and all longer durations.

        Args:
            width_us: Width of each bin, [µs].

        Returns:
            Middle of each bin [ms], shape (n,); share of the durations in each bin [%], shape (n,).
        """
        low, high = int(self.values_us[0]), self.quantile_us(0.99)
        assert high is not None
        at = np.minimum(self.values_us - low, high - low) // width_us
        shares: Any = np.bincount(at, self.counts) * (100.0 / self.count)
        middles: Array = low + (np.arange(len(shares), dtype=np.float64) + 0.5) * width_us
        return middles * 1e-3, shares


def _ms(value_us: int | None) -> float | None:
    return None if value_us is None else value_us * 1e-3
