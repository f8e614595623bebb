"""Bands: time intervals in which the slave was limited; pages draw them behind curves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.state_history import StateHistory
from teleop_core.graph import STATE, topics
from teleop_core.kernels.geometry import Array

_STRETCHES = 20_000  # largest number of intervals per cause; a screen has fewer pixels
_FINEST_S = 1e-3
# Colours that red-green colour-blind readers can distinguish. No curve has one of these colours.
LIMIT_COLORS = {
    topics.Limit.JOINT: "#e8590c",
    topics.Limit.WORKSPACE: "#7048e8",
    topics.Limit.SINGULARITY: "#d6336c",
    topics.Limit.SPEED: "#15aabf",
}
"""CSS colour of each cause, the same on every page."""
_COLORS = {
    topics.Limit.JOINT: ("joint limit", LIMIT_COLORS[topics.Limit.JOINT]),
    topics.Limit.WORKSPACE: ("outside of the workspace", LIMIT_COLORS[topics.Limit.WORKSPACE]),
    topics.Limit.SINGULARITY: ("near a singularity", LIMIT_COLORS[topics.Limit.SINGULARITY]),
    topics.Limit.SPEED: ("speed limit", LIMIT_COLORS[topics.Limit.SPEED]),
}
_CLUTCHED = ("clutched", "#adb5bd")


@dataclass(frozen=True, eq=False)
class Band:
    """All time intervals with one cause.

    Attributes:
        cause: Cause as text.
        color: CSS colour.
        stretches: Begin and end of each interval since the start of the recording, sorted and without overlap, shape
            (N, 2), [s].
    """

    cause: str
    color: str
    stretches: Array


def bands_of(context: Context) -> tuple[Band, ...]:
    """Bands of a recording: one for each cause that limited the slave, and one for the pressed clutch.

    A cause that did not occur has no band. Recordings of earlier versions do not contain limits.
    """
    history, bag = context.history, context.bag
    if not len(history.rows):
        return ()
    limit = history.rows[:, STATE["limit"]]
    masks = [(label, limit == float(cause)) for cause, label in _COLORS.items()]
    masks.append((_CLUTCHED, history.rows[:, STATE["is_clutched"]] > 0.0))
    found = []
    for (cause, color), is_so in masks:
        stretches = stretches_of(history, is_so, bag.start_ns, bag.end_ns)
        if len(stretches):
            found.append(Band(_named(cause, history, is_so), color, merged(stretches)))
    return tuple(found)


def stretches_of(history: StateHistory, is_so: NDArray[np.bool_], start_ns: int, end_ns: int) -> Array:
    """Time intervals in which a condition on rows of a history is true, shape (M, 2), [s].

    Args:
        history: States. Each row is valid until the next row begins; the last row is valid until the recording ends.
        is_so: Whether the condition is true in each row, shape (N,).
        start_ns: Start of the recording [ns]; the intervals are measured from this time.
        end_ns: End of the recording, [ns].
    """
    is_begin = is_so & ~np.concatenate(([False], is_so[:-1]))
    is_end = ~is_so & np.concatenate(([False], is_so[:-1]))
    begins, ends = history.stamp_ns[is_begin], history.stamp_ns[is_end]
    if len(ends) < len(begins):
        ends = np.append(ends, end_ns)
    both = np.clip(np.stack((begins, ends), axis=1), start_ns, end_ns)
    return np.asarray((both[both[:, 1] > both[:, 0]] - start_ns) * 1e-9, dtype=float)


def merged(stretches: Array, count: int = _STRETCHES) -> Array:
    """Merge intervals until at most ``count`` are left: neighbours with the smallest distance become one interval.

    Args:
        stretches: Intervals, sorted and without overlap, shape (N, 2), [s].
        count: Largest number of intervals in the result.
    """
    apart = _FINEST_S
    while len(stretches) > count:
        is_new = np.concatenate(([True], stretches[1:, 0] - stretches[:-1, 1] > apart))
        is_last = np.append(is_new[1:], True)
        stretches = np.stack((stretches[is_new, 0], stretches[is_last, 1]), axis=1)
        apart *= 2.0
    return stretches


def _named(cause: str, history: StateHistory, is_so: NDArray[np.bool_]) -> str:
    if cause != _COLORS[topics.Limit.JOINT][0]:
        return cause
    joints = np.unique(history.rows[is_so, STATE["limited_joint"]])
    names = [str(int(joint) + 1) for joint in joints if joint >= 0.0]
    return f"{cause} ({'joint' if len(names) == 1 else 'joints'} {', '.join(names)})" if names else cause
