"""Figure: one plot of the report page before it is encoded. A long path is drawn as the time spent in each area."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.floating[Any]]

COMMAND, REFERENCE, MEASURED, FIXTURE = "#8a94a0", "#9ed0fb", "#c2370a", "#2b8a3e"
# Colours of three curves that colour-blind readers can also distinguish (Okabe and Ito 2008).
FIRST, SECOND, THIRD = "#0072b2", "#009e73", "#cc79a7"
DARK = "#343a40"
DRAWN_FIXTURES = 4
SURROUNDING = "#ced4da"
_TIME = "time"
PUBLISHED = "#111111"
PLANES = ((0, 1), (0, 2), (1, 2))
_MARKS = ("diamond", "circle", "square", "cross", "x", "triangle-up")


Trace = dict[str, Any]
Layout = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Figure:
    """A plot: a title, one sentence that describes it, and the traces and layout of plotly.js.

    Arrays in the traces contain every sample. The page packs them and draws only as many points as there are pixels. A
    figure without traces is a line of text.
    """

    title: str
    sentence: str
    traces: list[dict[str, Any]]
    layout: dict[str, Any] = field(default_factory=dict)
    height: int = 420


def line(x: Numbers, y: Numbers, name: str, color: str, width: float, unit: str = "mm") -> dict[str, Any]:
    """Trace of a line in a plane; ``unit`` is the unit of y."""
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "legendgroup": name,
        "x": x,
        "y": y,
        "line": {"color": color, "width": width},
        "hovertemplate": f"%{{y:.4g}} {unit}",
    }


def time_axis() -> dict[str, Any]:
    """Time axis that begins at the start of the recording.

    A page links all axes made by this function: they show the same time interval, can zoom to single samples, and show
    bands where the slave was limited. The attribute ``uirevision`` of plotly.js marks such an axis.
    """
    return {"title": {"text": "time [s]"}, "uirevision": _TIME}


def force_figure(title: str, sentence: str, times: Numbers, values: Numbers, of: str) -> Figure:
    """Plot of a force against time.

    The columns of ``values`` (N, 4) are x, y, z and magnitude [N]; ``of`` names the arm whose axes are used.
    """
    traces = [
        line(times, values[:, i], f"{axis} ({of})", color, 1.2, "N")
        for i, (axis, color) in enumerate(zip("xyz", (FIRST, SECOND, THIRD), strict=True))
    ]
    traces.append(line(times, values[:, 3], "magnitude", DARK, 1.4, "N"))
    layout = {"xaxis": time_axis(), "yaxis": {"title": {"text": "force [N]"}}, "hovermode": "x unified"}
    return Figure(title, sentence, traces, layout, 340)


def is_against_time(figure: Figure) -> bool:
    """Whether a plot has an axis that was made by :func:`time_axis`."""
    axes = (axis for name, axis in figure.layout.items() if name.startswith("xaxis"))
    return any(isinstance(axis, dict) and axis.get("uirevision") == _TIME for axis in axes)


def along(
    trace: dict[str, Any],
    times: Numbers,
    during: Sequence[tuple[float, float]] | None = None,
    *,
    colored: bool = False,
    whole: bool = False,
) -> dict[str, Any]:
    """A trace of a path. The page shows only the part within the visible time interval.

    Args:
        trace: Line in a plane or in space.
        times: Time of each point, shape (N,), [s].
        during: Begin and end of the intervals [s] in which the path is drawn; None for the whole time.
        colored: Whether the colour of the line shows the time; possible only for lines in space.
        whole: Whether the whole path stays visible, as background of the visible part.
    """
    stretches = None if during is None else [list(stretch) for stretch in during]
    meta = {"path": True, "during": stretches, "colored": colored, "whole": whole}
    return {**trace, "customdata": times, "meta": meta}


def axis_suffix(row: int) -> str:
    """Suffix that plotly.js appends to the names of the axes of a row."""
    return "" if row == 0 else str(row + 1)


def stacked_axes(names: Sequence[str], unit: str) -> dict[str, Any]:
    """Layout of plots one above the other, with one time axis at the lowest plot."""
    count = len(names)
    layout: dict[str, Any] = {"xaxis": {**time_axis(), "anchor": f"y{axis_suffix(count - 1)}"}}
    for row, name in enumerate(names):
        top = 1.0 - row / count
        layout[f"yaxis{axis_suffix(row)}"] = {
            "title": {"text": f"{name} [{unit}]"},
            "domain": [max(0.0, top - 1.0 / count + 0.03), top],
        }
    return layout


def span(values: Numbers) -> list[float] | None:
    """Range of an axis that shows all values with a margin; None if there are no values."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return None
    low, high = float(finite.min()), float(finite.max())
    margin = 0.05 * max(high - low, 1e-3)
    return [low - margin, high + margin]


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


def intervals(x: Numbers, values: Numbers, name: str, color: str, unit: str, mark: int = 1) -> Trace:
    """Trace of means with intervals, joined by a line; the columns of ``values`` (N, 3) are mean, low and high end."""
    mean, low, high = np.asarray(values, np.float64).reshape(-1, 3).T
    whiskers = {"type": "data", "symmetric": False, "array": high - mean, "arrayminus": mean - low, "color": color}
    marker = points(x, mean, name, color, unit, mark)["marker"]
    return {
        **joined(x, mean, name, color, unit),
        "marker": marker,
        "error_y": whiskers | {"thickness": 1.5, "width": 4},
    }


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


LONG = 25.0
"""Limit of readable paths: a path longer than this many diagonals of its bounding box is not readable as a line."""
_CELLS = 110
_COLORS = [[0.0, "#f1f3f5"], [0.4, "#ced4da"], [1.0, "#495057"]]


def is_long(points: Numbers) -> bool:
    """Whether a path (N, 3) crosses itself too often to be read as a line; NaN interrupts the line."""
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
    """Trace with the time spent in each square of a plane, on a logarithmic scale; dark squares mean long times.

    Args:
        across: Horizontal coordinates, shape (N,); NaN is left out.
        up: Vertical coordinates, shape (N,).
        ranges: Smallest and largest coordinate along both axes.
        sample_s: Time between two samples, [s].
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
