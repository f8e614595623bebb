"""Density: where a long path spent its time, per plane."""

from typing import Any

import numpy as np

from teleop_core.evaluation.figure import Numbers

LONG = 25.0
"""Lengths, in diagonals of what it fills, from which a path in a plane is no longer readable."""
_CELLS = 110
_COLORS = [[0.0, "#f1f3f5"], [0.4, "#ced4da"], [1.0, "#495057"]]


def is_long(points: Numbers) -> bool:
    """Whether a path (N, 3) crosses itself too often to be read as a line; NaN lifts the pen."""
    thin = points[:: max(1, len(points) // 20_000)]
    steps = np.sqrt(np.square(np.diff(thin, axis=0)).sum(axis=1))
    known = thin[np.isfinite(thin).all(axis=1)]
    if len(known) < 2:
        return False
    diagonal = float(np.sqrt(np.square(np.ptp(known, axis=0)).sum()))
    return float(np.nansum(steps)) > LONG * diagonal > 0.0


def time_spent(
    across: Numbers, up: Numbers, ranges: tuple[list[float], list[float]], sample_s: float
) -> dict[str, Any]:
    """Trace with the time in each square of a plane, dark where it is long, on a logarithmic scale.

    Args:
        across: Places, shape (N,); NaN is left out.
        up: The same along the other axis, shape (N,).
        ranges: Smallest and largest place along both axes.
        sample_s: Time that each of the places stands for, [s].
    """
    (left, right), (bottom, top) = ranges
    side = max(right - left, top - bottom) / _CELLS
    shape = [max(1, int(np.ceil((high - low) / side))) for low, high in ranges]
    is_known = np.isfinite(across) & np.isfinite(up)
    column = np.clip(((across[is_known] - left) / side).astype(np.int64), 0, shape[0] - 1)
    row = np.clip(((up[is_known] - bottom) / side).astype(np.int64), 0, shape[1] - 1)
    counts = np.bincount(row * shape[0] + column, minlength=shape[0] * shape[1])
    tens = np.round(np.log10(np.maximum(counts, 1) * sample_s), 2).astype(object)
    tens[counts == 0] = None
    z = tens.reshape(shape[1], shape[0]).tolist()
    return {
        "type": "heatmap", "name": "time spent", "legendgroup": "time spent", "z": z,
        "x0": left + side / 2, "dx": side, "y0": bottom + side / 2, "dy": side,
        "colorscale": _COLORS, "showscale": False, "hoverinfo": "skip",
        "meta": {"surrounds": True},
    }  # fmt: skip
