"""Overview: what a report page opens with, each session beside the others."""

from collections.abc import Iterator, Sequence
from html import escape
from typing import Any

import numpy as np

from teleop_core.evaluation.bands import Band
from teleop_core.evaluation.figure import Figure, Numbers
from teleop_core.evaluation.preview import preview
from teleop_core.evaluation.rows import number
from teleop_core.evaluation.score import Score
from teleop_core.evaluation.verdict import SHARE, Verdict, percent

SHOWN = 5
"""Figures of a session."""
_FIGURES = (
    (SHARE, "%", "time followed"),
    ("asked_error_mm.max", "mm", "largest lag behind the hand"),
    ("position_error_mm.rms", "mm", "tracking error RMS"),
    ("true_error_mm.rms", "mm", "error of the true tip RMS"),
    ("orientation_error_deg.angle.rms", "°", "orientation error RMS"),
    ("fixture.penetration_max_mm", "mm", "largest fixture penetration"),
    ("latency_ms.total.p99", "ms", "delay p99, hand to setpoint"),
    ("force_n.max", "N", "peak force on the hand"),
    ("motion.hand.speed_median_mm_s", "mm/s", "median speed of the hand"),
)
_OFTEN_NOTHING = {"latency_ms.total.p99", "force_n.max", "fixture.penetration_max_mm"}
_SIZE, _MARGIN, _POINTS = 200, 10, 400
_UPRIGHT = 5.0
"""Height over width from which on a path is seen from the side: from above it is a dot."""


def overview(
    scores: Sequence[Score], figures: Sequence[Sequence[Figure]], bands: Sequence[Sequence[Band]]
) -> str:
    """Card of each session: verdict, five figures, the path from above, the error against time."""
    cards = [
        f'<article class="card session"><h2><a href="#recording-{i}">{escape(score.session.place)}'
        f"</a></h2>{_verdict(score.verdict)}{_figures(score)}{_pictures(plots, of_time)}</article>"
        for i, (score, plots, of_time) in enumerate(zip(scores, figures, bands, strict=True))
    ]
    return f'<div class="sessions">{"".join(cards)}</div>'


def _verdict(found: Verdict) -> str:
    kind = "good" if found.is_good else "bad"
    advice = f'<p class="advice">{escape(found.advice)}</p>' if found.advice else ""
    return f'<p class="verdict {kind}">{escape(found.text)}</p>{advice}'


def _figures(score: Score) -> str:
    found = list(_known(score))[:SHOWN]
    items = (
        f"<div><dd>{value}<small> {escape(unit)}</small></dd><dt>{escape(text)}</dt></div>"
        for value, unit, text in found
    )
    return f'<dl class="figures">{"".join(items)}</dl>'


def _known(score: Score) -> Iterator[tuple[str, str, str]]:
    """Value, unit and meaning of figures that the score has, and that say something."""
    values = score.to_dict()
    for key, unit, text in _FIGURES:
        value = values.get(key)
        if key == SHARE and isinstance(value, float):
            yield percent(value), unit, text
        elif isinstance(value, int | float) and not (value == 0.0 and key in _OFTEN_NOTHING):
            yield number(value), unit, text


def _pictures(plots: Sequence[Figure], bands: Sequence[Band]) -> str:
    path = next((drawn for plot in plots if (drawn := _path(plot))), "")
    curve = next((drawn for plot in plots if (drawn := preview(plot, bands))), "")
    return f'<div class="pictures">{path}{curve}</div>'


def _path(plot: Figure) -> str:
    """The curves of a plot in space, seen from above, or from the side where that shows more."""
    curves = [trace for trace in plot.traces if trace.get("type") == "scatter3d" and _drawn(trace)]
    if not curves or "meta" in plot.layout:
        return ""
    points = [_thin(*(trace[axis] for axis in "xyz")) for trace in curves]
    whole = np.concatenate(points)
    low, extent = whole.min(axis=0), np.ptp(whole, axis=0)
    seen, told = (0, 1), "from above"
    if extent[2] > _UPRIGHT * max(extent[0], extent[1]):
        seen, told = (int(extent[1] > extent[0]), 2), "from the side"
    axes = list(seen)
    middle, size = (low + 0.5 * extent)[axes], extent[axes]
    scale = (_SIZE - 2 * _MARGIN) / max(float(size.max()), 1e-6)
    lines = "".join(_line(trace, (place[:, axes] - middle) * scale, trace is curves[-1])
                    for trace, place in zip(curves, points, strict=True))  # fmt: skip
    told += f", {size[0]:.3g} × {size[1]:.3g} mm"
    return (
        f'<figure><svg viewBox="0 0 {_SIZE} {_SIZE}" role="img" aria-label="path">'
        f"{lines}</svg><small>{told}</small></figure>"
    )


def _drawn(trace: dict[str, Any]) -> bool:
    arrays = [trace.get(axis) for axis in "xyz"]
    return all(isinstance(a, np.ndarray) and len(a) > 1 for a in arrays) and "lines" in str(
        trace.get("mode", "")
    )


def _thin(*places: Numbers) -> Numbers:
    points = np.column_stack(places).astype(np.float64)
    points = points[np.isfinite(points).all(axis=1)]
    thin: Numbers = points[:: max(1, len(points) // _POINTS)]
    return thin if len(thin) else np.zeros((1, 3))


def _line(trace: dict[str, Any], points: Numbers, is_last: bool) -> str:
    color = trace.get("line", {}).get("color")
    color = color if isinstance(color, str) else "#c2370a" if is_last else "#9ed0fb"
    places = " ".join(f"{0.5 * _SIZE + x:.1f},{0.5 * _SIZE - y:.1f}" for x, y in points.tolist())
    look = f'fill="none" stroke="{escape(color)}" stroke-width="1.5" stroke-linecap="round"'
    return f'<polyline points="{places}" {look}/>'
