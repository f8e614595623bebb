"""Sketch: a small picture of a recording for a notebook; needs no plotting library."""

from collections.abc import Mapping
from html import escape

import numpy as np

from teleop_core.evaluation.figure import MEASURED, REFERENCE
from teleop_core.kernels.geometry import Array

_WIDTH, _HEIGHT, _MARGIN, _POINTS = 260, 200, 26, 600
_PANELS = ((0, 1), (0, 2), (1, 2))


def sketch(title: str, paths: Mapping[str, tuple[Array, Array]]) -> str:
    """Inline SVG with each arm's tip path seen along each axis, below a title.

    Args:
        title: A line of facts.
        paths: For each arm, the reference positions and the measured positions of the tip, both (N, 3) [m].
    """
    parts = [f"<p><b>{escape(title)}</b></p>"]
    for arm, (wanted, reached) in paths.items():
        panels = "".join(
            _panel(column, axes, wanted[:, axes] * 1e3, reached[:, axes] * 1e3) for column, axes in enumerate(_PANELS)
        )
        size = f'width="{3 * _WIDTH}" height="{_HEIGHT}" viewBox="0 0 {3 * _WIDTH} {_HEIGHT}"'
        head = f"<p>{escape(arm)}</p>" if arm else ""
        parts.append(f'{head}<svg xmlns="http://www.w3.org/2000/svg" {size}>{panels}</svg>')
    parts.append("<p>tip in mm: wide, the reference; narrow, measured</p>")
    return "".join(parts)


def _panel(column: int, axes: tuple[int, int], wanted: Array, reached: Array) -> str:
    both = np.concatenate((wanted, reached))
    both = both[np.isfinite(both).all(axis=1)]
    if not len(both):
        return ""
    low, high = both.min(axis=0), both.max(axis=0)
    room = min(_WIDTH, _HEIGHT) - 2 * _MARGIN
    scale = room / max(float((high - low).max()), 1e-6)
    middle = 0.5 * (low + high)
    left = column * _WIDTH + 0.5 * _WIDTH
    lines = []
    for points, color, width in ((wanted, REFERENCE, 4.0), (reached, MEASURED, 1.2)):
        thin = points[:: max(1, len(points) // _POINTS)]
        x = left + (thin[:, 0] - middle[0]) * scale
        y = 0.5 * _HEIGHT - (thin[:, 1] - middle[1]) * scale
        path = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True) if np.isfinite(a + b))
        lines.append(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="{width}"/>')
    ranges = (f"{'xyz'[axis]} {low[i]:.0f} … {high[i]:.0f}" for i, axis in enumerate(axes))
    text = f"{', '.join(ranges)} mm"
    label = f'<text x="{left}" y="{_HEIGHT - 6}" font-size="11" text-anchor="middle">{text}</text>'
    return "".join(lines) + label
