"""Path: where the tip went, in space, per plane and against time; drawn only."""

from typing import Any

import numpy as np

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.figure import (
    COMMAND,
    DRAWN_FIXTURES,
    FIXTURE,
    MEASURED,
    REFERENCE,
    Figure,
    axis_suffix,
    line,
    span,
    stacked_axes,
)
from teleop_core.evaluation.metric import Metric
from teleop_core.evaluation.metrics.fixture import FixtureMetric
from teleop_core.evaluation.metrics.position_error import PositionErrorMetric
from teleop_core.evaluation.outlines import Outline, kinds_of, largest, outlines_of
from teleop_core.evaluation.plain import Values
from teleop_core.evaluation.rows import Row, number
from teleop_core.evaluation.traces import Envelope, Thinned
from teleop_core.evaluation.tracking import TRACKED, tracked
from teleop_core.evaluation.windows import Window
from teleop_core.geometry import Array
from teleop_core.topics import SLAVE_MEASURED_CP

_PLANES = ((0, 1), (0, 2), (1, 2))
_CAMERA = {"eye": {"x": 1.25, "y": -1.52, "z": 0.76}, "center": {"x": 0, "y": 0, "z": -0.1}}


class PathMetric(Metric):
    """Draws the paths of command, reference and tip, with the fixture."""

    name = "path"
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        self._context = context
        self._error = context.shared(PositionErrorMetric)
        self._fixture = context.shared(FixtureMetric)
        # x, y, z of command, setpoint and measured, [mm].
        self._position = Envelope(context.bag.start_ns, context.bag.end_ns, columns=9)
        # Setpoint x, y, z and measured x, y, z [mm], and whether a fixture was on.
        self._path = Thinned(context.expected(SLAVE_MEASURED_CP))

    def add(self, window: Window) -> None:
        """Take one window."""
        found = tracked(window)
        poses = (found.commands, found.setpoints, found.poses)
        rows = np.concatenate([pose[:, :3] for pose in poses], axis=1) * 1e3
        self._position.add(found.log_ns, rows)
        is_on = window.states(SLAVE_MEASURED_CP).column("is_fixture_on")[:, None]
        self._path.add(np.concatenate((rows[:, 3:], is_on), axis=1))

    def values(self) -> Values:
        """Nothing: it only draws."""
        return {}

    def rows(self) -> list[Row]:
        """None."""
        return []

    def figures(self) -> list[Figure]:
        """Paths in space and per plane, and positions against time."""
        outlines = outlines_of(self._context)
        reference, measured = self._paths()
        return [
            _in_space(reference, measured, outlines, self._sentence(outlines)),
            _in_planes(reference, measured, outlines),
            self._against_time(outlines),
        ]

    def _paths(self) -> tuple[Array, Array]:
        """Setpoint and measured points (N, 3) [mm] with a fixture on, or all if none ever was."""
        rows = self._path.rows()
        if rows[:, 6].any():
            rows = np.where(rows[:, 6:] > 0.0, rows, np.nan)
        return rows[:, :3], rows[:, 3:6]

    def _sentence(self, outlines: list[Outline]) -> str:
        largest_mm = number(self._error.values().max)
        text = f"The tip stays within {largest_mm} mm of its reference"
        shown, score = largest(outlines), self._fixture.values()
        if not shown:
            return text + "; no fixture was on."
        kinds, sizes = kinds_of(outlines), " and ".join(map(_size, shown))
        outside_mm = number(score.penetration_max_mm)
        if score.unscored is None:
            text += f" and leaves the {kinds} ({sizes} mm) by at most {outside_mm} mm."
        else:
            text += f". Drawn as a box and not scored: {score.unscored}."
        return f"{text} Only the time with the {kinds} on is drawn."

    def _against_time(self, outlines: list[Outline]) -> Figure:
        times, values = self._position.line()
        begin, end = self._interesting(outlines)
        is_shown = (times >= begin) & (times <= end)
        layout, shapes, traces = stacked_axes("xyz", "mm"), [], []
        for row in range(3):
            suffix = axis_suffix(row)
            layout[f"yaxis{suffix}"]["range"] = span(values[is_shown][:, [row + 3, row + 6]])
            traces += [
                {**trace, "yaxis": f"y{suffix}", "showlegend": row == 0}
                for trace in (
                    line(times, values[:, row], "command", COMMAND, 1),
                    line(times, values[:, row + 3], "reference", REFERENCE, 5),
                    line(times, values[:, row + 6], "measured", MEASURED, 1.6),
                )
            ]
            for outline in outlines[:DRAWN_FIXTURES]:
                shapes += outline.wall_lines(row, suffix)
        layout |= {"shapes": shapes, "hovermode": "x unified"}
        layout["xaxis"]["range"] = [begin, end]
        sentence = (
            "The reference is the command after the low-pass and lags behind it; the tip stays "
            f"within {number(self._error.values().max)} mm of the reference."
        )
        if outlines:
            sentence += f" Dashed: where the {kinds_of(outlines)} ends."
            sentence += " Double-click to see the whole recording."
        return Figure("Position against time", sentence, traces, layout, 640)

    def _interesting(self, outlines: list[Outline]) -> tuple[float, float]:
        """Time [s] that is shown first: with a fixture on, or all if none ever was."""
        if not outlines:
            bag = self._context.bag
            return 0.0, (bag.end_ns - bag.start_ns) / 1e9
        return outlines[0].begin_s, outlines[-1].end_s


def _size(outline: Outline) -> str:
    return " × ".join(f"{side:.3g}" for side in outline.size)


def _in_space(reference: Array, measured: Array, outlines: list[Outline], sentence: str) -> Figure:
    """Paths of reference and tip in 3-D, with the fixture."""
    traces = [
        # Both lines at once would hide each other in turns.
        {**_line3(reference, "reference", REFERENCE, 4), "visible": "legendonly"},
        _line3(measured, "measured", MEASURED, 4),
    ]
    named: set[str] = set()
    for outline in largest(outlines):
        is_known = outline.kind in named
        traces.append(_line3(outline.points, outline.kind, FIXTURE, 3, hidden=is_known))
        named.add(outline.kind)
    axes = {f"{axis}axis": {"title": {"text": f"{axis} [mm]"}} for axis in "xyz"}
    scene = {**axes, "aspectmode": "data", "camera": _CAMERA}
    return Figure("Path in space", sentence, traces, {"scene": scene}, 560)


def _line3(
    points: Array, name: str, color: str, width: int, *, hidden: bool = False
) -> dict[str, Any]:
    x, y, z = points.T
    return {
        "type": "scatter3d", "mode": "lines", "name": name, "legendgroup": name,
        "showlegend": not hidden, "x": x, "y": y, "z": z,
        "line": {"color": color, "width": width},
        "hovertemplate": "x %{x:.3f}<br>y %{y:.3f}<br>z %{z:.3f} mm",
    }  # fmt: skip


def _in_planes(reference: Array, measured: Array, outlines: list[Outline]) -> Figure:
    """The same along each axis."""
    shown = [(o.points, o.kind, FIXTURE, 2.0) for o in largest(outlines)]
    lines = [
        (reference, "reference", REFERENCE, 6.0), (measured, "measured", MEASURED, 1.6), *shown
    ]  # fmt: skip
    every = np.concatenate([points for points, *_ in lines])
    ranges = [span(every[:, axis]) for axis in range(3)]
    traces: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"grid": {"rows": 1, "columns": 3, "pattern": "independent"}}
    for plot, (across, up) in enumerate(_PLANES, start=1):
        named: set[str] = set()
        for points, name, color, width in lines:
            has_entry = plot == 1 and name not in named
            place = {"xaxis": f"x{plot}", "yaxis": f"y{plot}", "showlegend": has_entry}
            traces.append({**line(points[:, across], points[:, up], name, color, width), **place})
            named.add(name)
        layout |= _plane_axes(plot, "xyz"[across], "xyz"[up], ranges[across], ranges[up])
    sentence = (
        f"The same path seen along each axis{f', in the {kinds_of(outlines)}' * bool(shown)}."
    )
    return Figure("Path per plane", sentence, traces, layout, 420)


def _plane_axes(
    plot: int, across: str, up: str, width: list[float] | None, height: list[float] | None
) -> dict[str, Any]:
    """Two axes of the same scale."""
    return {
        f"xaxis{plot}": {
            "title": {"text": f"{across} [mm]"}, "constrain": "domain", "range": width,
        },
        f"yaxis{plot}": {
            "title": {"text": f"{up} [mm]"}, "constrain": "domain", "range": height,
            "scaleanchor": f"x{plot}",
        },
    }  # fmt: skip
