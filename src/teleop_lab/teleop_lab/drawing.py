"""Drawing: curves, published points and layouts that the figures of experiments share."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from teleop_core.evaluation.figure import DARK, FIXTURE, MEASURED, Numbers, axis_suffix, line, span

PUBLISHED = "#111111"
PLANES = ((0, 1), (0, 2), (1, 2))
_MARKS = ("diamond", "circle", "square", "cross", "x", "triangle-up")

Trace = dict[str, Any]
Layout = dict[str, Any]


def published_points(x: Numbers, y: Numbers, name: str, unit: str = "mm") -> Trace:
    """Trace of values that a source printed."""
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "legendgroup": name,
        "x": x,
        "y": y,
        "marker": {"color": PUBLISHED, "size": 9, "symbol": _MARKS[0]},
        "hovertemplate": f"%{{y:.4g}} {unit}",
    }


def points(x: Numbers, y: Numbers, name: str, color: str, unit: str = "mm", mark: int = 1) -> Trace:
    """Trace of separate values."""
    return {
        **published_points(x, y, name, unit),
        "marker": {"color": color, "size": 8, "symbol": _MARKS[mark % len(_MARKS)]},
    }


def joined(x: Numbers, y: Numbers, name: str, color: str, unit: str = "mm") -> Trace:
    """Trace of separate values, joined by a line."""
    return {**line(x, y, name, color, 1.5, unit), "mode": "lines+markers"}


def level(value: float, text: str, axis: str = "y") -> tuple[Layout, Layout]:
    """Horizontal line across a plot at a published number, with a text."""
    look = {"color": PUBLISHED, "width": 1.2, "dash": "dot"}
    shape = {"type": "line", "xref": "paper", "yref": axis, "x0": 0, "x1": 1, "y0": value, "y1": value, "line": look}
    note = {"xref": "paper", "yref": axis, "x": 1, "y": value, "xanchor": "right",
            "yanchor": "bottom", "showarrow": False, "text": text,
            "font": {"size": 11, "color": PUBLISHED},
            "bgcolor": "rgba(255,255,255,0.6)"}  # fmt: skip
    return shape, note


def axis(text: str, unit: str = "", **more: object) -> Layout:
    """An axis with its name and unit."""
    return {"title": {"text": f"{text} [{unit}]" if unit else text}, **more}


def in_planes(names: str, groups: Sequence[tuple[Numbers, str, str, float]], unit: str) -> Any:
    """Traces and layout of paths seen along each axis, with one scale for both axes of a plot.

    Args:
        names: Letters of the three axes.
        groups: Paths (N, 3), each with name, colour and width; NaN interrupts the line.
        unit: Unit of the paths.

    Returns:
        Traces, and layout of three plots side by side.
    """
    every = np.concatenate([path for path, *_ in groups])
    ranges = [span(every[:, k]) or [0.0, 1.0] for k in range(3)]
    traces: list[Trace] = []
    layout: Layout = {"grid": {"rows": 1, "columns": 3, "pattern": "independent"}}
    for plot, (across, up) in enumerate(PLANES):
        suffix = axis_suffix(plot)
        for path, name, color, width in groups:
            trace = line(path[:, across], path[:, up], name, color, width, unit)
            shown = plot == 0
            traces.append({**trace, "xaxis": f"x{suffix}", "yaxis": f"y{suffix}", "showlegend": shown})
        layout[f"xaxis{suffix}"] = axis(names[across], unit, range=ranges[across], constrain="domain")
        layout[f"yaxis{suffix}"] = axis(names[up], unit, range=ranges[up], constrain="domain", scaleanchor=f"x{suffix}")
    return traces, layout


def in_space(path: Numbers, name: str, color: str, width: float, mode: str = "lines", **marker: object) -> Trace:
    """Trace of a path or of points in space (N, 3)."""
    x, y, z = np.asarray(path, dtype=np.float64).T
    return {
        "type": "scatter3d",
        "mode": mode,
        "name": name,
        "legendgroup": name,
        "x": x,
        "y": y,
        "z": z,
        "line": {"color": color, "width": width},
        "marker": {"color": color, "size": 2, **marker},
        "hovertemplate": "x %{x:.3f}<br>y %{y:.3f}<br>z %{z:.3f}",
    }


def scene(unit: str) -> Layout:
    """Layout of a plot in space with one scale for all axes."""
    axes = {f"{name}axis": axis(name, unit) for name in "xyz"}
    eye = {"eye": {"x": 1.5, "y": -1.6, "z": 0.8}}
    return {"scene": {**axes, "domain": {"y": [0.08, 1.0]}, "aspectmode": "data", "camera": eye}}


__all__ = [
    "DARK",
    "FIXTURE",
    "MEASURED",
    "PLANES",
    "PUBLISHED",
    "axis",
    "in_planes",
    "in_space",
    "joined",
    "level",
    "line",
    "points",
    "published_points",
    "scene",
]
