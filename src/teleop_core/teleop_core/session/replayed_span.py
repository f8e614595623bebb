"""Replayed span: the samples of a recorded hand that belong together; single wrong stamps are left out."""

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags.series import Series
from teleop_core.base.errors import RecordingError, TeleopWarning
from teleop_core.graph.signals import TICK_NS

LONGEST_GAP_NS = 60_000_000_000
"""Longest pause of a hand within one session [ns]. A longer pause means that a clock was wrong. The replay would last
as long as this wrong pause."""


def in_order(series: Series) -> Series:
    """The samples sorted by stamp; the same series if it is already sorted."""
    if not (np.diff(series.stamp_ns) < 0).any():
        return series
    return series[np.argsort(series.stamp_ns, kind="stable")]


def replayed_span(path: Path, name: str, stamp_ns: NDArray[np.int64]) -> tuple[int, int]:
    """First and last stamp [ns] of the longest sequence of samples without a gap.

    A warning reports samples before and after this sequence, which are left out.

    Args:
        path: Recording, for messages.
        name: Topic, for messages.
        stamp_ns: Stamps of all samples (N,), in order, [ns].

    Raises:
        RecordingError: There is no sample.
    """
    if not len(stamp_ns):
        raise RecordingError(path, f"has no readable sample of {name} to replay")
    # Floating point, because the difference of two wrong stamps can exceed 64 bits.
    ends = np.flatnonzero(np.diff(stamp_ns.astype(np.float64)) > LONGEST_GAP_NS) + 1
    stretches = np.split(stamp_ns, ends)
    longest = max(stretches, key=len)
    if left_out := len(stamp_ns) - len(longest):
        seconds = (int(longest[-1]) - int(longest[0])) * 1e-9
        warnings.warn(
            f"{path.name}: the replay uses {seconds:.3g} s of {name}; it leaves out {left_out} "
            f"samples beyond gaps of more than {LONGEST_GAP_NS * 1e-09:g} s",
            TeleopWarning,
            stacklevel=2,
        )
    return int(longest[0]), int(longest[-1])


def tick_times(begin_ns: int, count: int) -> NDArray[np.int64]:
    """Times of ``count`` ticks, the first at ``begin_ns`` (count,) [ns]."""
    return begin_ns + TICK_NS * np.arange(count, dtype=np.int64)
