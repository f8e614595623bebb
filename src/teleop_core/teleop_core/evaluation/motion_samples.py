"""Motion samples: resamples a pose stream of any rate to 30 Hz and computes its tremor, while the stream is read."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation.motion_measures import GAP, RATE, SLOWEST_FOR_TREMOR, WINDOW, resampled, tremor_power
from teleop_core.kernels.geometry import Array

REST = 1e-3
"""Largest extent of the motion within a second that counts as rest [m]."""
_REGULAR = 0.01  # share by which steps may differ and still count as equal
_ENOUGH = 150.0  # samples are averaged down to about this rate [Hz]; this reduces a wave of 12 Hz by 1 %


class MotionSamples:
    """Interpolates a motion at :data:`RATE` while the motion is read, and computes the tremor at the full rate.

    The samples are at whole multiples of 1/30 s after the first sample; an hour has 108 000 samples. The amount of
    stored data at the full rate does not grow.

    Attributes:
        tremor: Tremor, computed from the samples at the full rate.
    """

    def __init__(self) -> None:
        self.tremor = TremorWindows()
        self._parts: list[tuple[Array, Array]] = []
        self._last: tuple[Array, Array] = (np.empty(0), np.empty((0, 7)))
        self._next = 0  # number of the next sample
        self._begin: float | None = None

    def add(self, times: Array, rows: Array) -> None:
        """Add samples.

        Args:
            times: Times (N,) [s]; samples that are not later than the previous sample are left out.
            rows: Position [m] and quaternion w, x, y, z (N, 7); rows that are not finite are left out.
        """
        times, rows = self._valid(times, rows)
        if not len(times):
            return
        if self._begin is None:
            self._begin = float(times[0])
        self.tremor.add(times, rows[:, :3])
        at, all_rows = np.append(self._last[0], times), np.vstack((self._last[1], rows))
        self._last = (at[-1:].copy(), all_rows[-1:].copy())
        stop = int(np.floor((at[-1] - self._begin) * RATE + 1e-6)) + 1
        wanted = self._begin + _numbers(at - self._begin, self._next, stop) / RATE
        self._next = max(stop, self._next)
        after = np.minimum(np.searchsorted(at, wanted), len(at) - 1)
        before = np.maximum(after - 1, 0)
        is_known = at[after] - at[before] <= GAP
        if is_known.any():
            keep = np.flatnonzero(is_known)
            found = _between(at, all_rows, before[keep], after[keep], wanted[keep])
            self._parts.append((wanted[keep], found))

    def _valid(self, times: Array, rows: Array) -> tuple[Array, Array]:
        if not np.isfinite(rows).all():
            is_finite = np.isfinite(rows).all(axis=1)
            times, rows = times[is_finite], rows[is_finite]
        before = self._last[0] if len(self._last[0]) else np.array([-np.inf])
        highest = np.maximum.accumulate(np.append(before, times))
        is_later = times > highest[:-1]
        return (times, rows) if is_later.all() else (times[is_later], rows[is_later])

    def rows(self) -> tuple[Array, Array]:
        """Times (M,) [s] and rows (M, 7); gaps contain no samples."""
        if not self._parts:
            return np.empty(0), np.empty((0, 7))
        times, rows = zip(*self._parts, strict=True)
        return np.concatenate(times), np.concatenate(rows)


def _numbers(at: Array, first: int, stop: int) -> NDArray[np.int64]:
    """Numbers from ``first`` to below ``stop`` of the samples that are not in a gap.

    Gaps contain no samples, so a single time that is years later needs no extra memory.

    Args:
        at: Times since sample number 0 (N,) [s].
        first: Smallest number.
        stop: End of the numbers, exclusive.
    """
    ends = np.flatnonzero(np.diff(at) > GAP)
    low = np.floor(at[np.append(0, ends + 1)] * RATE).astype(np.int64)
    high = np.floor(at[np.append(ends, len(at) - 1)] * RATE + 1e-6).astype(np.int64) + 1
    low, high = np.maximum(low, first), np.minimum(high, stop)
    counts = np.maximum(high - low, 0)
    offsets = np.cumsum(counts) - counts
    return np.unique(np.repeat(low - offsets, counts) + np.arange(counts.sum()))


def _between(at: Array, rows: Array, before: Array, after: Array, wanted: Array) -> Array:
    """Rows at the wanted times, linearly interpolated between two samples, with normalised quaternions."""
    step = at[after] - at[before]
    share = np.where(step > 0.0, (wanted - at[before]) / np.where(step > 0.0, step, 1.0), 1.0)
    share = np.clip(share, 0.0, 1.0)[:, None]
    first, second = rows[before], rows[after].copy()
    is_turned = np.einsum("ij,ij->i", first[:, 3:], second[:, 3:]) < 0.0
    second[is_turned, 3:] *= -1.0
    found: Array = first + share * (second - first)
    length = np.linalg.norm(found[:, 3:], axis=1, keepdims=True)
    found[:, 3:] /= np.where(length > 0.0, length, 1.0)
    return found


class TremorWindows:
    """Mean square of the motion in 8 to 12 Hz, for windows of :data:`WINDOW` and for seconds of rest."""

    def __init__(self) -> None:
        self._times, self._places = np.empty(0), np.empty((0, 3))
        self._windows: list[tuple[float, float, float]] = []
        self._rests: list[tuple[float, float, float]] = []

    def add(self, times: Array, places: Array) -> None:
        """Add samples: times (N,) [s], all later than the times added before, and positions (N, 3) [m]."""
        times = np.append(self._times, times)
        places = np.vstack((self._places, places))
        first = 0
        gaps = [*(np.flatnonzero(np.diff(times) > GAP) + 1).tolist(), len(times)]
        for end in gaps:
            while first < end and times[end - 1] - times[first] >= WINDOW:
                last = int(np.searchsorted(times, times[first] + WINDOW))
                self._take(times[first : last + 1], places[first : last + 1])
                first = last
            first = end if end < len(times) else first
        self._times, self._places = times[first:].copy(), places[first:].copy()

    def _take(self, times: Array, places: Array) -> None:
        """Process one window. Its last sample is also the first sample of the next window."""
        begin, count = float(times[0]), len(times) - 1
        length = float(times[-1]) - begin
        rate = count / length
        if rate < SLOWEST_FOR_TREMOR:
            return
        steps = np.diff(times)
        if np.ptp(steps) > _REGULAR / rate:
            places = resampled(times, places, rate)
        each = max(1, int(rate / _ENOUGH))
        used = count // each * each
        means: Array = np.einsum("ijk->ik", places[:used].reshape(-1, each, 3)) / each
        rate /= each
        self._windows.append((begin, begin + length, tremor_power(means, rate)))
        second = round(rate)
        for at in range(0, len(means) - second + 1, second):
            rest = means[at : at + second]
            if (np.ptp(rest, axis=0) < REST).all():
                moment = begin + at / rate
                self._rests.append((moment, moment + 1.0, tremor_power(rest, rate)))

    def between(self, spans: Sequence[tuple[float, float]]) -> tuple[float | None, float | None]:
        """Mean squares [m²] of the windows in the spans [s], and of the seconds of rest in the spans.

        A value is None if the spans contain no window or no second of rest.
        """
        return _mean(self._windows, spans), _mean(self._rests, spans)


def _mean(windows: Sequence[tuple[float, float, float]], spans: Sequence[tuple[float, float]]) -> float | None:
    table = np.array(windows).reshape(-1, 3)
    is_in = np.zeros(len(table), np.bool_)
    for begin, end in spans:
        is_in |= (table[:, 0] >= begin - 0.5 / RATE) & (table[:, 1] <= end + 1.5 / RATE)
    return float(table[is_in, 2].mean()) if is_in.any() else None
