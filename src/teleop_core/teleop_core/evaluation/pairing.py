"""Pairing: which samples of two topics belong together."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from teleop_core.evaluation.accumulators import Integers

NONE = -1
"""Index of a sample that has no partner."""
_SMOOTHED = 21  # samples; bursts of half as many leave the pairing alone
_FARTHEST_NS = 50_000_000
_FAR = 2**62


def same_tick(log_ns: Integers, other_log_ns: Integers) -> Integers:
    """Partners of samples that one node publishes in pairs, tick by tick, without a common stamp.

    Where the nearest sample in log time is far nearer than any other, it is the partner. Where
    several ticks came at once, partners are counted off: the difference of the two indices is
    constant until a message is lost. It is the running median of the difference to the nearest
    sample, which ignores bursts and follows losses at once (a median keeps edges).

    Args:
        log_ns: Log times of one topic, shape (N,), in order, [ns].
        other_log_ns: Those of the other, shape (M,).

    Returns:
        Index into the other topic for each sample, shape (N,); :data:`NONE` where its partner was
        lost or would be more than 50 ms away.
    """
    index = np.arange(len(log_ns))
    if np.array_equal(log_ns, other_log_ns):
        return index
    if not len(log_ns) or not len(other_log_ns):
        return np.full(len(log_ns), NONE)
    nearest = _nearest(log_ns, other_log_ns)
    is_clear = _is_clear(log_ns, other_log_ns, nearest)
    partner = np.where(is_clear, nearest, index + _running_median(nearest - index))
    is_inside = (partner >= 0) & (partner < len(other_log_ns))
    apart = np.abs(other_log_ns[np.where(is_inside, partner, 0)] - log_ns)
    step = np.diff(partner)
    is_taken = np.append(step <= 0, False) | np.insert(step <= 0, 0, False)
    return np.where(is_inside & (apart <= _FARTHEST_NS) & (is_clear | ~is_taken), partner, NONE)


def latest(stamp_ns: Integers, other_stamp_ns: Integers) -> Integers:
    """Index of the newest sample of another topic that is not newer than each stamp, or NONE.

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


def _order(stamps: Integers) -> Integers:
    if (np.diff(stamps) >= 0).all():
        return np.arange(len(stamps))
    return np.argsort(stamps, kind="stable")


def _nearest(times: Integers, others: Integers) -> Integers:
    after = np.searchsorted(others, times)
    before, after = np.maximum(after - 1, 0), np.minimum(after, len(others) - 1)
    is_before: NDArray[np.bool_] = times - others[before] < others[after] - times
    return np.where(is_before, before, after)


def _is_clear(times: Integers, others: Integers, nearest: Integers) -> NDArray[np.bool_]:
    """Whether the nearest is four times nearer than the next sample of either topic."""
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
