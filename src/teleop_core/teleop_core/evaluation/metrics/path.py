"""Path: plots of the tip's path in space, per plane and against time. This metric has no values."""

from typing import Any, NamedTuple

import numpy as np

from teleop_core.evaluation import TRACKED, Context, Envelope, Metric, Window, figure, number, tracked
from teleop_core.evaluation.metrics import fixture, position_error
from teleop_core.evaluation.outlines import Outline, kinds_of, largest, outlines_of
from teleop_core.evaluation.plain import Values
from teleop_core.graph.signals import STATE

_PLANES = ((0, 1), (0, 2), (1, 2))
_TIME_BAR = {
    "title": {"text": "measured, time [s]", "side": "top"},
    "orientation": "h",
    "thickness": 8,
    "len": 0.5,
    "y": 0.0,
    "yanchor": "bottom",
}
_CAMERA = {"eye": {"x": 1.4, "y": -1.7, "z": 0.85}, "center": {"x": 0, "y": 0, "z": -0.1}}


class _Path(NamedTuple):
    """Paths of reference and tip: times (N,) [s], points (N, 3) [mm], and the intervals in which they are drawn."""

    times: figure.Numbers
    reference: figure.Numbers
    measured: figure.Numbers
    during: list[tuple[float, float]] | None

    @property
    def shown(self) -> figure.Numbers:
        """Measured points, shape (N, 3); NaN at times that are not drawn."""
        if self.during is None:
            return self.measured
        ends = np.array(self.during).ravel()
        is_shown = np.searchsorted(ends, self.times, side="right") % 2 == 1
        return np.where(is_shown[:, None], self.measured, np.nan)


class PathMetric(Metric):
    """Draws the paths of command, reference and tip, with the fixture."""

    name = "path"
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        self._context = context
        self._error = context.shared(position_error.PositionErrorMetric)
        self._fixture = context.shared(fixture.FixtureMetric)
        # Columns: x, y, z of the command, of the setpoint and of the measured pose, [mm].
        self._position = Envelope(context.bag.start_ns, context.bag.end_ns, columns=9)

    def add(self, window: Window) -> None:
        """Process one window."""
        found = tracked(window)
        poses = (found.commands, found.setpoints, found.poses)
        rows = np.concatenate([pose[:, :3] for pose in poses], axis=1) * 1e3
        self._position.add(found.log_ns, rows)

    def values(self) -> Values:
        """No values: this metric only draws."""
        return {}

    def figures(self) -> list[figure.Figure]:
        """Plots of the paths in space and per plane, and of the positions against time."""
        outlines = outlines_of(self._context)
        path = self._path(outlines)
        return [
            _in_space(path, outlines, self._sentence(outlines)),
            _in_planes(path, outlines),
            self._against_time(outlines),
        ]

    def _path(self, outlines: list[Outline]) -> _Path:
        """The whole path. It is drawn while a fixture is on, or always if no fixture was ever on."""
        times, values = self._position.line()
        during = [(outline.begin_s, outline.end_s) for outline in outlines]
        return _Path(times, values[:, 3:6], values[:, 6:], _in_a_row(during) or None)

    def _sentence(self, outlines: list[Outline]) -> str:
        largest_mm = number(self._error.values().max)
        text = f"The tip stays within {largest_mm} mm of its reference"
        shown, score = largest(outlines), self._fixture.values()
        if not shown:
            return text + "; no fixture was on."
        kinds, sizes = kinds_of(outlines), " and ".join(filter(None, map(_size, shown)))
        outside_mm = number(score.penetration_max_mm)
        if score.unscored is None:
            text += f" and leaves the {kinds}{f' ({sizes} mm)' if sizes else ''} by at most "
            text += f"{outside_mm} mm."
        else:
            text += f". Drawn as a box and not scored: {score.unscored}."
        return f"{text} Only the time with the {kinds} on is drawn."

    def _against_time(self, outlines: list[Outline]) -> figure.Figure:
        times, values = self._position.line()
        layout, shapes, traces = figure.stacked_axes("xyz", "mm"), [], []
        for row in range(3):
            suffix = figure.axis_suffix(row)
            traces += [
                {**trace, "yaxis": f"y{suffix}", "showlegend": row == 0}
                for trace in (
                    figure.line(times, values[:, row], "command", figure.COMMAND, 1),
                    figure.line(times, values[:, row + 3], "reference", figure.REFERENCE, 5),
                    figure.line(times, values[:, row + 6], "measured", figure.MEASURED, 1.6),
                )
            ]
            for outline in outlines[: figure.DRAWN_FIXTURES]:
                shapes += outline.wall_lines(row, suffix)
        layout |= {"shapes": shapes, "hovermode": "x unified"}
        layout["xaxis"]["range"] = self._interesting(outlines)
        sentence = (
            "The reference is the command after the low-pass and lags behind it; the tip stays "
            f"within {number(self._error.values().max)} mm of the reference."
        )
        if outlines:
            sentence += f" Dashed: where the {kinds_of(outlines)} ends, from its middle along each axis."
        sentence += " Drag to zoom, all plots follow; double-click to see the whole recording."
        return figure.Figure("Position against time", sentence, traces, layout, 640)

    def _interesting(self, outlines: list[Outline]) -> list[float]:
        """Interval [s] shown first: the time with a fixture on, else the time since the slave began to follow."""
        bag, history = self._context.bag, self._context.history
        if outlines:
            return [outlines[0].begin_s, outlines[-1].end_s]
        follows = history.stamp_ns[history.rows[:, STATE["is_following"]] > 0.0]
        begin_ns = max(bag.start_ns, int(follows[0])) if len(follows) else bag.start_ns
        return [(begin_ns - bag.start_ns) * 1e-9, (bag.end_ns - bag.start_ns) * 1e-9]


def _in_a_row(stretches: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Time intervals in order; adjacent intervals are joined."""
    found: list[tuple[float, float]] = []
    for begin, end in stretches:
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((begin, end))
    return found


def _size(outline: Outline) -> str:
    return " × ".join(f"{side:.3g}" for side in outline.size)


def _in_space(path: _Path, outlines: list[Outline], sentence: str) -> figure.Figure:
    """Paths of reference and tip in 3-D, with the fixture."""
    whole = _line3(path.measured, "whole path", figure.SURROUNDING, 1)
    reference, measured = (
        _line3(points, name, color, 4)
        for points, name, color in (
            (path.reference, "reference", figure.REFERENCE),
            (path.measured, "measured", figure.MEASURED),
        )
    )
    measured |= {"showlegend": False}  # the colour bar explains the colours of this line
    measured["line"] |= {"colorscale": "Viridis", "showscale": True, "colorbar": _TIME_BAR}
    traces = [
        {**figure.along(whole, path.times, path.during, whole=True), "opacity": 0.5, "hoverinfo": "skip"},
        # If both lines were drawn, each would hide parts of the other.
        {**figure.along(reference, path.times, path.during), "visible": "legendonly"},
        figure.along(measured, path.times, path.during, colored=True),
    ]
    named: set[str] = set()
    for outline in largest(outlines):
        is_known = outline.kind in named
        traces.append(_line3(outline.points, outline.kind, figure.FIXTURE, 3, hidden=is_known))
        named.add(outline.kind)
    axes = {f"{axis}axis": {"title": {"text": f"{axis} [mm]"}} for axis in "xyz"}
    scene = {**axes, "domain": {"y": [0.12, 1.0]}, "aspectmode": "data", "camera": _CAMERA}
    return figure.Figure("Path in space", sentence, traces, {"scene": scene}, 560)


def _line3(points: figure.Numbers, name: str, color: str, width: int, *, hidden: bool = False) -> dict[str, Any]:
    x, y, z = points.T
    return {
        "type": "scatter3d",
        "mode": "lines",
        "name": name,
        "legendgroup": name,
        "showlegend": not hidden,
        "x": x,
        "y": y,
        "z": z,
        "line": {"color": color, "width": width},
        "hovertemplate": "x %{x:.3f}<br>y %{y:.3f}<br>z %{z:.3f} mm",
    }


def _in_planes(path: _Path, outlines: list[Outline]) -> figure.Figure:
    """Plots of the paths seen along each axis; the background is the whole path, or the time spent in each area."""
    shown = path.shown
    fixtures = largest(outlines)
    every = np.concatenate([shown, path.reference[np.isfinite(shown[:, 0])], *(outline.points for outline in fixtures)])
    ranges = [figure.span(every[:, axis]) or [0.0, 1.0] for axis in range(3)]
    traces: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"grid": {"rows": 1, "columns": 3, "pattern": "independent"}}
    is_dense = figure.is_long(shown)
    for plot, (across, up) in enumerate(_PLANES):
        place = {"xaxis": f"x{figure.axis_suffix(plot)}", "yaxis": f"y{figure.axis_suffix(plot)}"}
        drawn = [_surroundings(path, shown, across, up, (ranges[across], ranges[up]), is_dense)]
        drawn += _plane_lines(path, across, up)
        drawn += [
            figure.line(outline.points[:, across], outline.points[:, up], outline.kind, figure.FIXTURE, 2.0)
            for outline in fixtures
        ]
        named: set[str] = set()
        for trace in drawn:
            traces.append({**trace, **place, "showlegend": plot == 0 and trace["name"] not in named})
            named.add(trace["name"])
        layout |= _plane_axes(plot, "xyz"[across], "xyz"[up], ranges[across], ranges[up])
    sentence = (
        f"The same path seen along each axis{f', in the {kinds_of(outlines)}' * bool(fixtures)}."
        f"{' Dark: where it spent more time.' * is_dense}"
    )
    return figure.Figure("Path per plane", sentence, traces, layout, 420)


def _plane_lines(path: _Path, across: int, up: int) -> list[dict[str, Any]]:
    """Reference and tip seen along an axis."""
    lines = ((path.reference, "reference", figure.REFERENCE, 6.0), (path.measured, "measured", figure.MEASURED, 1.6))
    return [
        figure.along(figure.line(points[:, across], points[:, up], name, color, width), path.times, path.during)
        for points, name, color, width in lines
    ]


def _surroundings(
    path: _Path, shown: figure.Numbers, across: int, up: int, ranges: tuple[list[float], list[float]], is_dense: bool
) -> dict[str, Any]:
    """Background of the visible part of a path: the whole path, or the time spent in each area."""
    if is_dense:
        duration_s = float(path.times[-1] - path.times[0])
        sample_s = duration_s / max(1, len(path.times) - 1)
        return figure.time_spent(shown[:, across], shown[:, up], ranges, sample_s)
    points = path.measured
    whole = figure.line(points[:, across], points[:, up], "whole path", figure.SURROUNDING, 1.0)
    return {**figure.along(whole, path.times, path.during, whole=True), "hoverinfo": "skip"}


def _plane_axes(
    plot: int, across: str, up: str, width: list[float] | None, height: list[float] | None
) -> dict[str, Any]:
    """Layout of a plot whose two axes have the same scale."""
    suffix = figure.axis_suffix(plot)
    return {
        f"xaxis{suffix}": {"title": {"text": f"{across} [mm]"}, "constrain": "domain", "range": width},
        f"yaxis{suffix}": {
            "title": {"text": f"{up} [mm]"},
            "constrain": "domain",
            "range": height,
            "scaleanchor": f"x{suffix}",
        },
    }
