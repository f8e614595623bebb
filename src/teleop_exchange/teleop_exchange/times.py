"""Times of an import: their unit, and the choice of rows if times are repeated or go back."""

from bisect import bisect_right
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from teleop_core.kernels.geometry import Array
from teleop_exchange.options import CLOCKS, TIMES_NS

Stamps = NDArray[np.int64]
SECOND_NS = 1_000_000_000
LARGEST_LAG_NS = SECOND_NS
"""Largest plausible difference between topics in the time from the stamp of a message to its recording [ns]. Topics
with a larger difference were stamped by different clocks."""
RATES_HZ = (5.0, 3000.0)
"""Smallest and largest plausible rate of a hand's recording [Hz]; the guess of the time unit uses them."""
_EPOCH_S = 3e8  # a time in 1979 [s]; larger times are seconds since 1970
_LATEST_S = 2.0**31  # a time in 2038 [s], the first that does not fit into a stamp of ROS
_NEAREST_S = 9.4e8  # a time in 1999 [s]; earlier dates are not those of clocks with another epoch
_LONGEST_S = 60.0  # longest plausible time between two samples [s]
_LONGEST_OF_OTHERS_S = 10.0  # the same for clocks of another epoch, whose days could be seconds
_FAR_OFF = 1.5  # a rate this many times beyond RATES_HZ is not plausible
_STRETCH = 10  # smallest number of rows of a separate recording


class Unit(NamedTuple):
    """A unit of time, and the reason for choosing it."""

    name: str
    reason: str


def guessed_unit(raw: NDArray[np.float64] | Stamps) -> Unit:
    """Unit of times, guessed from their size if they are clock times, else from the steps between them.

    Args:
        raw: Times (N,) in the file's unit, finite.

    Returns:
        The unit; its name is empty if no unit gives a plausible rate.
    """
    middle = float(np.median(raw)) if len(raw) else 0.0
    steps = np.diff(np.sort(raw))
    steps = steps[steps > 0]
    step = float(np.median(steps)) if len(steps) else 0.0
    if step <= 0.0:
        return Unit("s", "")
    for name in (*CLOCKS, *TIMES_NS):
        nanoseconds, epoch = _scale(name)
        seconds, period = (middle - epoch) * nanoseconds / SECOND_NS, step * nanoseconds / SECOND_NS
        first, longest = (_NEAREST_S, _LONGEST_OF_OTHERS_S) if name in CLOCKS else (_EPOCH_S, _LONGEST_S)
        if first < seconds < _LATEST_S and period < longest:
            return Unit(name, "they are times of the clock")
    low, high = RATES_HZ
    rates = {name: SECOND_NS / (step * nanoseconds) for name, nanoseconds in TIMES_NS.items()}
    off = {name: max(low / rate, rate / high, 1.0) for name, rate in rates.items()}
    best = min(off, key=lambda name: off[name])
    if off[best] > _FAR_OFF:
        return Unit("", f"no unit makes a rate of {low:g} to {high:g} Hz of their steps of {step:.4g}")
    return Unit(best, f"that makes {rates[best]:.4g} Hz")


def _scale(unit: str) -> tuple[int, int]:
    """Length of a unit or of a clock's unit [ns], and the value at the beginning of 1970; 0 for a unit."""
    return CLOCKS[unit] if unit in CLOCKS else (TIMES_NS[unit], 0)


def joined_ns(parts: list[NDArray[np.float64] | Stamps], unit: str, without: int) -> Stamps:
    """Times of all blocks [ns], with the number ``without`` for invalid times. This empties the list ``parts``.

    Times later than 2038 are invalid, because stamps of ROS cannot hold them.
    """
    nanoseconds_of_unit, epoch = _scale(unit)
    latest = _LATEST_S * SECOND_NS / nanoseconds_of_unit
    out = np.empty(sum(map(len, parts)), np.int64)
    end = len(out)
    while parts:
        raw = parts.pop() - epoch
        begin = end - len(raw)
        known = np.abs(raw) <= latest  # NaN is not
        out[begin:end] = nanoseconds(np.where(known, raw, 0), unit)
        out[begin:end][~known] = without
        end = begin
    return out


def nanoseconds(raw: NDArray[np.float64] | Stamps, unit: str) -> Stamps:
    """Times since the epoch of a unit in nanoseconds; whole numbers keep all digits."""
    factor, _ = _scale(unit)
    if raw.dtype.kind == "i":
        return np.asarray(raw, np.int64) * factor
    whole = np.floor(raw)
    rest = np.rint((raw - whole) * factor).astype(np.int64)
    stamps: Stamps = whole.astype(np.int64) * factor + rest
    return stamps


@dataclass(frozen=True, eq=False)
class Order:
    """Used rows and their order.

    Attributes:
        rows: Indices of the used rows (M,).
        doubled: Number of rows that were left out because an earlier row has the same time.
        backwards: Number of rows with a time before the time of an earlier row.
    """

    rows: NDArray[np.int32]
    doubled: int
    backwards: int


def ordered(stamps: Stamps, *, is_sorted: bool = False) -> Order:
    """Choose rows with increasing times; of rows with equal times, the first is used.

    As few rows as possible are left out.

    Args:
        stamps: Times (N,) [ns] in the order of the file.
        is_sorted: Whether rows that go back are sorted in.
    """
    if (stamps[1:] > stamps[:-1]).all():
        return Order(np.arange(len(stamps), dtype=np.int32), 0, 0)
    rising = _longest_rising(stamps)
    rows = np.argsort(stamps, kind="stable") if is_sorted else rising
    kept = stamps[rows]
    first = np.ones(len(rows), np.bool_)
    first[1:] = kept[1:] > kept[:-1]
    return Order(rows[first].astype(np.int32), int((~first).sum()), len(stamps) - len(rising))


def _longest_rising(stamps: Stamps) -> NDArray[np.int64]:
    """Largest set of rows in which no time is before the time of an earlier row (Fredman 1975).

    So a wrong stamp in the future removes only its own row, not all rows until this time.
    """
    newest, oldest = np.maximum.accumulate(stamps), np.minimum.accumulate(stamps[::-1])[::-1]
    is_kept = (stamps == newest) & (stamps == oldest)  # rows whose order agrees with all other rows
    others = np.flatnonzero(~is_kept)
    before = np.empty(len(others), np.int64)
    ends: list[int] = []  # smallest last time of each number of rows, and the index of that row
    last: list[int] = []
    for row, stamp in enumerate(stamps[others].tolist()):
        count = bisect_right(ends, stamp)
        before[row] = last[count - 1] if count else -1
        ends[count : count + 1], last[count : count + 1] = [stamp], [row]
    row = last[-1] if last else -1
    while row >= 0:
        is_kept[others[row]] = True
        row = int(before[row])
    return np.flatnonzero(is_kept)


def restarts(stamps: Stamps) -> NDArray[np.int64]:
    """Rows at which another recording begins: the time jumps back and then increases again.

    At such a row the time jumps back by more than half of the preceding stretch, and then continues within this
    stretch. Rows that are only stored late do not meet this condition. Single rows with a different time do not count.

    Args:
        stamps: Times (N,) [ns] in the order of the file.
    """
    if (stamps[1:] >= stamps[:-1]).all():
        return np.zeros(0, np.int64)
    stamps = median_filter(stamps, 3, mode="nearest")
    begins = np.flatnonzero(np.diff(stamps, prepend=stamps[:1] + 1) < 0)
    ends = np.append(begins[1:], len(stamps))
    first, middle, last = stamps[begins], stamps[(begins + ends) // 2], stamps[ends - 1]
    sizes = ends - begins
    is_long = (sizes[1:] >= _STRETCH) & (sizes[:-1] >= _STRETCH)
    is_anew = (first[1:] < middle[:-1]) & (last[1:] > first[:-1])
    return begins[1:][is_long & is_anew]


def gaps(stamps: Stamps, periods: float) -> tuple[tuple[float, float], ...]:
    """Gaps: intervals without a sample that are longer than ``periods`` median periods.

    Returns:
        Begin since the first stamp [s] and length [s] of each gap, the longest gap first.
    """
    steps = np.diff(stamps)
    if not len(steps):
        return ()
    at = np.flatnonzero(steps > periods * float(np.median(steps)))
    at = at[np.argsort(-steps[at], kind="stable")]
    return tuple(((int(stamps[i]) - int(stamps[0])) * 1e-9, int(steps[i]) * 1e-9) for i in at)


def spread_ms(stamps: Stamps) -> tuple[float, float, float]:
    """Median, 5th and 95th percentile of the periods [ms]."""
    steps = np.diff(stamps) * 1e-6
    low, middle, high = np.percentile(steps, (5, 50, 95)) if len(steps) else (0.0, 0.0, 0.0)
    return float(middle), float(low), float(high)


def is_constant(stamps: Array | Stamps) -> bool:
    """Whether all stamps are equal, such as zero, so that they contain no information."""
    return len(stamps) > 1 and bool((stamps == stamps[0]).all())


def clock_offset(stamps: Stamps, logs: Stamps) -> int:
    """Median of the stamps minus the times of recording [ns]; 0 without stamps."""
    middle = len(stamps) // 2
    return int(np.partition(stamps - logs, middle)[middle]) if len(stamps) else 0  # a float would be too coarse
