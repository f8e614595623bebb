"""Preview: a plot as a sketch in SVG, for browsers without scripts and until it is drawn."""

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from teleop_core.evaluation.bands import Band, merged
from teleop_core.evaluation.figure import Figure, Numbers, is_against_time
from teleop_core.evaluation.rows import fixed

_WIDTH, _HEIGHT, _STRETCHES, _BANDS = 1000, 300, 200, 200


def preview(figure: Figure, bands: Sequence[Band]) -> str:
    """Sketch of the curves of a plot against time; nothing for plots of another kind.

    Rows of a plot stand below each other. Bands are drawn behind them.
    """
    curves = [trace for trace in figure.traces if _is_drawn(trace)]
    if not is_against_time(figure) or not curves:
        return ""
    rows = list(dict.fromkeys(str(trace.get("yaxis", "y")) for trace in curves))
    begin, end = _ends([trace["x"] for trace in curves])
    height = _HEIGHT / len(rows)
    parts, told = [_bands(bands, begin, end)], [f"{fixed(begin, 1)} … {fixed(end, 1)} s"]
    for number, row in enumerate(rows):
        members = [trace for trace in curves if trace.get("yaxis", "y") == row]
        low, high = _ends([trace["y"] for trace in members])
        if low > high:
            continue
        frame = (begin, end, low, high, number * height, height)
        parts += [_curve(trace, frame) for trace in members]
        told.append(f"{_axis_name(figure, row)}: {low:.3g} … {high:.3g}")
    picture = (
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none" role="img" '
        f'aria-label="{escape(figure.title)}">{"".join(parts)}</svg>'
    )
    return f'<div class="preview">{picture}<small>{escape(", ".join(told))}</small></div>'


def _is_drawn(trace: dict[str, Any]) -> bool:
    has_curve = isinstance(trace.get("x"), np.ndarray) and isinstance(trace.get("y"), np.ndarray)
    return (
        has_curve
        and trace.get("type") == "scatter"
        and trace.get("visible", True) is True
        and len(trace["x"]) > 0
    )


def _bands(bands: Sequence[Band], begin: float, end: float) -> str:
    scale = _WIDTH / max(end - begin, 1e-9)
    parts = []
    for band in bands:
        look = f'y="0" height="{_HEIGHT}" fill="{escape(band.color)}" opacity="0.22"'
        for first, last in merged(band.stretches, _BANDS).tolist():
            place, width = (first - begin) * scale, max(1.0, (last - first) * scale)
            parts.append(f'<rect x="{place:.1f}" width="{width:.1f}" {look}/>')
    return "".join(parts)


def _curve(trace: dict[str, Any], frame: tuple[float, ...]) -> str:
    begin, end, low, high, top, height = frame
    times, values = _extremes(trace["x"], trace["y"])
    x = (times - begin) * (_WIDTH / max(end - begin, 1e-9))
    y = top + height * (0.95 - 0.9 * (values - low) / max(high - low, 1e-12))
    points = " ".join(f"{a:.0f},{b:.0f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    look = trace.get("line", {})
    color, width = escape(str(look.get("color", "#000"))), min(float(look.get("width", 1)), 3.0)
    return (
        f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="{width:g}" '
        'vector-effect="non-scaling-stroke"/>'
    )


def _ends(arrays: Sequence[Numbers]) -> tuple[float, float]:
    """Smallest and largest of all finite values; infinite and the wrong way round without any."""
    low, high = np.inf, -np.inf
    for array in arrays:
        finite = array if np.isfinite(array).all() else array[np.isfinite(array)]
        if len(finite):
            low, high = min(low, float(finite.min())), max(high, float(finite.max()))
    return low, high


def _extremes(times: Numbers, values: Numbers) -> tuple[Numbers, Numbers]:
    """Smallest and largest value of each of some hundred stretches; NaN is left out."""
    is_known = np.isfinite(values)
    if not is_known.all():
        times, values = times[is_known], values[is_known]
    if len(times) <= 2 * _STRETCHES:
        return times, values
    begins = np.linspace(0, len(times), _STRETCHES, endpoint=False).astype(np.int64)
    both = np.stack((np.minimum.reduceat(values, begins), np.maximum.reduceat(values, begins)), 1)
    return np.repeat(times[begins], 2), both.ravel()


def _axis_name(figure: Figure, row: str) -> str:
    title = figure.layout.get(f"yaxis{row[1:]}", {}).get("title", {})
    return str(title.get("text", "")) if isinstance(title, dict) else str(title)
