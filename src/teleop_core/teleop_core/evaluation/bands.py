"""Bands: stretches of time in which the slave was held back, as pages draw them behind curves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.state_history import StateHistory
from teleop_core.graph import STATE, topics
from teleop_core.kernels.geometry import Array

_STRETCHES = 20_000  # per cause; more than a screen has pixels
_FINEST_S = 1e-3
# Told apart without seeing red or green too; none is the colour of a curve.
LIMIT_COLORS = {
    topics.Limit.JOINT: "#e8590c",
    topics.Limit.WORKSPACE: "#7048e8",
    topics.Limit.SINGULARITY: "#d6336c",
    topics.Limit.SPEED: "#15aabf",
}
"""Colour of each cause on every page, as in CSS."""
_COLORS = {
    topics.Limit.JOINT: ("joint limit", LIMIT_COLORS[topics.Limit.JOINT]),
    topics.Limit.WORKSPACE: ("outside of the workspace", LIMIT_COLORS[topics.Limit.WORKSPACE]),
    topics.Limit.SINGULARITY: ("near a singularity", LIMIT_COLORS[topics.Limit.SINGULARITY]),
    topics.Limit.SPEED: ("speed limit", LIMIT_COLORS[topics.Limit.SPEED]),
}
_CLUTCHED = ("clutched", "#adb5bd")


@dataclass(frozen=True, eq=False)
class Band:
    """All stretches of one cause.

    Attributes:
        cause: In words.
        color: As in CSS.
        stretches: Begin and end of each from the start of the recording, in their order and apart
            from each other, shape (N, 2), [s].
    """

    cause: str
    color: str
    stretches: Array


def bands_of(context: Context) -> tuple[Band, ...]:
    """Bands of a recording: what limited the slave, and the clutch; only causes that occurred.

    Recordings of earlier versions do not tell limits.
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
    """Stretches in which something that rows of a history say holds, shape (M, 2), [s].

    Args:
        history: Each of its rows holds until the next one, the last one until the end.
        is_so: Whether each row says it, shape (N,).
        start_ns: Start of the recording, from which times count, [ns].
        end_ns: Its end, [ns].
    """
    is_begin = is_so & ~np.concatenate(([False], is_so[:-1]))
    is_end = ~is_so & np.concatenate(([False], is_so[:-1]))
    begins, ends = history.stamp_ns[is_begin], history.stamp_ns[is_end]
    if len(ends) < len(begins):
        ends = np.append(ends, end_ns)
    both = np.clip(np.stack((begins, ends), axis=1), start_ns, end_ns)
    return np.asarray((both[both[:, 1] > both[:, 0]] - start_ns) * 1e-9, dtype=float)


def merged(stretches: Array, count: int = _STRETCHES) -> Array:
    """At most so many stretches: those nearest to each other become one, none is lost.

    Args:
        stretches: In order and apart from each other, shape (N, 2), [s].
        count: How many there may be.
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
