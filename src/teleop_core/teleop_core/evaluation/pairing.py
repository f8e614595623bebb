"""Pairing: which samples of two topics belong together."""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from teleop_core.evaluation.accumulators import Integers

NONE = -1
"""Index of a sample that has no partner."""
_ROW = 3  # samples in a row that must be clear with the same offset
_SMOOTHED = 21  # samples of the running median: a burst of up to 10 late samples does not change the pairing
_FARTHEST_NS = 50_000_000  # samples that are farther apart are no pair
_FAR = 2**62  # later than any time stamp [ns]


def same_tick(log_ns: Integers, other_log_ns: Integers) -> Integers:
    """Partners of samples that one node publishes in pairs, tick by tick, without a common stamp.

    Partners are found by counting: the difference of both indices is constant until a message is lost. The difference
    is certain if, for several samples in a row, the nearest sample in log time is far nearer than any other. Elsewhere
    a late recorder or network may have changed the order of the ticks. If the difference before such a gap is equal to
    the difference after it, it holds in the gap too. If not, a message was lost in the gap. There the running median
    of the difference to the nearest sample is used; a median ignores bursts and keeps edges.

    Args:
        log_ns: Log times of one topic, shape (N,), in order, [ns].
        other_log_ns: Log times of the other topic, shape (M,).

    Returns:
        Index into the other topic for each sample, shape (N,); :data:`NONE` if the partner was lost or would be
        more than 50 ms away.
    """
    index = np.arange(len(log_ns))
    if np.array_equal(log_ns, other_log_ns):
        return index
    if not len(log_ns) or not len(other_log_ns):
        return np.full(len(log_ns), NONE)
    offset, is_certain = _offsets(log_ns, other_log_ns)
    partner = index + offset
    is_inside = (partner >= 0) & (partner < len(other_log_ns))
    apart = np.abs(other_log_ns[np.where(is_inside, partner, 0)] - log_ns)
    is_step = np.diff(partner) <= 0
    is_taken = np.append(is_step, False) | np.insert(is_step, 0, False)
    return np.where(is_inside & (apart <= _FARTHEST_NS) & (is_certain | ~is_taken), partner, NONE)


def latest(stamp_ns: Integers, other_stamp_ns: Integers) -> Integers:
    """For each stamp, the index of the newest sample of another topic that is not newer than the stamp, or NONE.

    Args:
        stamp_ns: Wanted times, shape (N,), [ns].
        other_stamp_ns: Stamps of the other topic, shape (M,), in any order.
    """
    order = _order(other_stamp_ns)
    at = np.searchsorted(other_stamp_ns[order], stamp_ns, side="right") - 1
    return np.where(at >= 0, order[at], NONE) if len(order) else np.full(len(stamp_ns), NONE)


def same_stamp(stamp_ns: Integers, other_stamp_ns: Integers) -> Integers:
    """Index of the first sample of another topic with the same stamp, or NONE.

    Args:
        stamp_ns: Wanted stamps, shape (N,), [ns].
        other_stamp_ns: Stamps of the other topic, shape (M,), in any order.
    """
    if not len(other_stamp_ns):
        return np.full(len(stamp_ns), NONE)
    order = _order(other_stamp_ns)
    ordered = other_stamp_ns[order]
    at = np.minimum(np.searchsorted(ordered, stamp_ns), len(ordered) - 1)
    return np.where(ordered[at] == stamp_ns, order[at], NONE)


def mean_wait_s(begins_ns: Sequence[int], ends_ns: Sequence[int]) -> float | None:
    """Mean time [s] from the latest begin at or before an end to that end; None if no end has a begin."""
    before = np.searchsorted(begins_ns, ends_ns, side="right")
    waits = [1e-9 * (end - begins_ns[i - 1]) for end, i in zip(ends_ns, before.tolist(), strict=True) if i]
    return float(np.mean(waits)) if waits else None


def _order(stamps: Integers) -> Integers:
    if (np.diff(stamps) >= 0).all():
        return np.arange(len(stamps))
    return np.argsort(stamps, kind="stable")


def _nearest(times: Integers, others: Integers) -> Integers:
    after = np.searchsorted(others, times)
    before, after = np.maximum(after - 1, 0), np.minimum(after, len(others) - 1)
    is_before: NDArray[np.bool_] = times - others[before] < others[after] - times
    return np.where(is_before, before, after)


def _offsets(log_ns: Integers, other_log_ns: Integers) -> tuple[Integers, NDArray[np.bool_]]:
    """Partner's index minus own index, and whether this difference is certain, both of shape (N,)."""
    nearest = _nearest(log_ns, other_log_ns)
    offset = nearest - np.arange(len(log_ns))
    is_certain = _in_a_row(_is_clear(log_ns, other_log_ns, nearest), offset)
    known = np.flatnonzero(is_certain)
    median = _running_median(offset)
    if not len(known):
        return median, is_certain
    at = np.searchsorted(known, np.arange(len(offset)), side="right")
    before, after = offset[known[np.maximum(at - 1, 0)]], known[np.minimum(at, len(known) - 1)]
    return np.where(is_certain | (before == offset[after]), before, median), is_certain


def _in_a_row(is_clear: NDArray[np.bool_], offset: Integers) -> NDArray[np.bool_]:
    """Mask of the samples in a run of at least :data:`_ROW` clear samples with the same offset."""
    is_new = np.diff(np.where(is_clear, offset, _FAR), prepend=_FAR - 1) != 0
    run = np.cumsum(is_new) - 1
    in_a_row: NDArray[np.bool_] = is_clear & (np.bincount(run)[run] >= _ROW)
    return in_a_row


def _is_clear(times: Integers, others: Integers, nearest: Integers) -> NDArray[np.bool_]:
    """Whether the nearest sample is four times nearer than the next sample of either topic."""
    own = np.concatenate(([_FAR], np.diff(times), [_FAR]))
    padded = np.concatenate(([-_FAR], others, [_FAR]))
    second = np.minimum(times - padded[nearest], padded[nearest + 2] - times)
    room = np.minimum(second, np.minimum(own[:-1], own[1:]))
    clear: NDArray[np.bool_] = 4 * np.abs(others[nearest] - times) < room
    return clear


def _running_median(values: Integers) -> Integers:
    if (values == values[0]).all():
        return values
    half = _SMOOTHED // 2
    padded = np.pad(values, half, mode="edge")
    rows = sliding_window_view(padded, _SMOOTHED)
    return np.partition(rows, half, axis=1)[:, half]
