"""Curves: columns that are thinned to the pixels of the strip, and bands and tick marks of states and events."""

import math
from collections.abc import Mapping

import numpy as np

from teleop_console.past import Past, Rows
from teleop_console.recorded_arms import in_words
from teleop_core.graph.operation import State
from teleop_core.graph.topics import OPERATION, SLAVE_OPERATION, TELEOP_STATE, Limit, limit_text
from teleop_core.kernels.geometry import Array

STRETCHES = 400
"""Largest number of stretches drawn in a band; the worst and the longest stretches are drawn."""
TICKS = 200
"""Largest number of tick marks; faults have priority."""
_GAP = 0.5  # shortest pause [s]
_GAPS = 10.0  # shortest pause, as a multiple of the usual time between two samples
_FAULTS = 100.0  # larger than the number of kinds of faults
_STATES = {
    float(state): (state.name, meaning) for state, meaning in zip(State, ("idle", "good", "held", "wrong"), strict=True)
}
Told = dict[str, object]


def thinned(samples: Rows, begin: float, end: float, pixels: int, *, is_held: bool = False) -> dict[str, list[object]]:
    """Smallest and largest value of the samples in each pixel, with one sample beyond each end; no peak is left out.

    Args:
        samples: Times (N,) [s], ascending, and values (N,); values that are not finite are unknown.
        begin: Left end of the strip [s].
        end: Right end [s], later.
        pixels: Number of pixels, at least one.
        is_held: Whether a value is valid until the next value; then the samples have no pauses.

    Returns:
        ``times``, ``low`` and ``high``, with at most two entries for each pixel, and None between the values before and
        after a pause.
    """
    times, values = samples[0], np.asarray(samples[1], np.float64)
    first = max(0, int(np.searchsorted(times, begin, side="right")) - 1)
    last = int(np.searchsorted(times, end, side="left")) + 1
    at, values = times[first:last], values[first:last]
    if not len(at):
        return {"times": [], "low": [], "high": []}
    values = np.where(np.isfinite(values), values, np.nan)
    is_after = np.zeros(len(at), bool)
    if not is_held and len(at) > 1:
        steps = np.diff(at)
        is_after[1:] = steps > max(_GAP, _GAPS * float(np.median(steps)))
    pixel = np.clip(np.floor((at - begin) / (end - begin) * pixels), -1, pixels)
    begins = np.arange(len(at)) if len(at) <= pixels else np.flatnonzero(np.diff(pixel, prepend=-2.0))
    low, high = np.fmin.reduceat(values, begins), np.fmax.reduceat(values, begins)
    gaps = np.flatnonzero(np.logical_or.reduceat(is_after, begins))
    shown = (np.insert(one, gaps, np.nan) for one in (at[begins], low, high))
    return dict(zip(("times", "low", "high"), map(_short_numbers, shown), strict=True))


def _short_numbers(values: Array) -> list[object]:
    """Convert numbers to short JSON values."""
    return [float(f"{value:.7g}") if math.isfinite(value) else None for value in values.tolist()]


def bands(past: Past, begin: float, end: float) -> tuple[list[Told], list[Told]]:
    """Bands and ticks of all arms between two times [s], without topics that are still being read.

    Returns:
        Rows, each with its name ``row`` and ``stretches`` (begin, end, text, meaning of the colour), and ticks with
        ``time``, ``text`` and ``meaning``.
    """
    rows: list[Told] = []
    ticks = [(1, time, text, "wanted") for time, text in past.marks() if begin <= time <= end]
    for arm, joints in past.joints.items():
        label = f"{arm} " if arm else ""
        below = f"{arm}/" if arm else ""
        if (found := past.rows(below + SLAVE_OPERATION.name)) is not None and len(found[0]):
            numbers = _columns(found, OPERATION)
            runs = _runs(found[0], _FAULTS * numbers["state"] + numbers["fault"], begin, end)
            told = [(a, b, *_STATES.get(both // _FAULTS, ("unknown", "idle"))) for a, b, both, _ in runs]
            rows.append({"row": f"{label}state", "stretches": _most(told)})
            for _, _, both, i in runs:
                if both // _FAULTS == State.FAULT and found[0][i] >= begin:
                    text = in_words(dict(zip(OPERATION, found[1][i].tolist(), strict=False)), joints)
                    ticks.append((0, float(found[0][i]), label + (text or "FAULT"), "wrong"))
        if (found := past.rows(below + TELEOP_STATE.name)) is not None and len(found[0]):
            rows += _hand_rows(found, label, joints, begin, end)
    ticks = sorted(sorted(ticks)[:TICKS], key=lambda tick: tick[1])
    return rows, [{"time": time, "text": text, "meaning": meaning} for _, time, text, meaning in ticks]


def _hand_rows(found: Rows, label: str, joints: tuple[str, ...], begin: float, end: float) -> list[Told]:
    """Bands of the hand, the mode and the limits of the slave."""
    column = _columns(found, TELEOP_STATE.columns)
    rows: list[Told] = []
    hand = np.where(column["is_clutched"] > 0.0, 1.0, np.where(column["is_following"] > 0.0, 2.0, 0.0))
    names = {
        "hand": (hand, (("rests", "idle"), ("clutched", "held"), ("follows", "good"))),
        "mode": (column["is_fine"], (("coarse", "idle"), ("fine", "hand"))),
    }
    for name, (values, told) in names.items():
        runs = [(a, b, *told[int(v)]) for a, b, v, _ in _runs(found[0], values, begin, end) if v in range(len(told))]
        rows.append({"row": label + name, "stretches": _most(runs)})
    limit, joint = column["limit"], column["limited_joint"]
    both = np.where(limit > 0.0, 100.0 * limit + joint, 0.0)
    held = [
        (a, b, _limit_text(limit[i], joint[i], joints), "held")
        for a, b, value, i in _runs(found[0], both, begin, end)
        if value > 0.0
    ]
    return [*rows, {"row": f"{label}limit", "stretches": _most(held)}] if held else rows


def _limit_text(limit: float, joint: float, joints: tuple[str, ...]) -> str:
    known = limit in set(Limit) and math.isfinite(joint)
    return limit_text(int(limit), int(joint), joints) if known else "limited"


def _columns(found: Rows, names: tuple[str, ...]) -> Mapping[str, Array]:
    return {name: found[1][:, i] for i, name in enumerate(names)}


def _runs(times: Array, values: Array, begin: float, end: float) -> list[tuple[float, float, float, int]]:
    """Begin, end, value and index of the first row of each stretch of constant value that overlaps an interval."""
    is_new = np.ones(len(values), bool)
    is_new[1:] = ~((values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1])))
    starts = np.flatnonzero(is_new)
    ends = np.append(times[starts[1:]], max(end, float(times[-1])))
    seen = np.flatnonzero((times[starts] <= end) & (ends >= begin) & ~np.isnan(values[starts]))
    return [
        (max(begin, float(times[starts[i]])), min(end, float(ends[i])), float(values[starts[i]]), int(starts[i]))
        for i in seen.tolist()
    ]


def _most(runs: list[tuple[float, float, str, str]]) -> list[tuple[float, float, str, str]]:
    """Return the stretches that are drawn, in order of time."""
    kept = sorted(runs, key=lambda run: (run[3] != "wrong", run[0] - run[1]))[:STRETCHES]
    return [(round(a, 4), round(b, 4), text, meaning) for a, b, text, meaning in sorted(kept)]
