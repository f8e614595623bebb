"""Path: where the tip went, in space, per plane and against time; drawn only."""

from typing import Any

import numpy as np

from teleop_core.evaluation.boxes import Box, boxes_of, largest
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.figure import (
    BOX,
    COMMAND,
    DRAWN_BOXES,
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
    """Draws the paths of command, reference and tip, with the box."""

    name = "path"
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        self._context = context
        self._error = context.shared(PositionErrorMetric)
        self._fixture = context.shared(FixtureMetric)
        # x, y, z of command, setpoint and measured, [mm].
        self._position = Envelope(context.bag.start_ns, context.bag.end_ns, columns=9)
        # Setpoint x, y, z and measured x, y, z [mm], and whether the box was on.
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
        boxes = boxes_of(self._context)
        reference, measured = self._paths()
        return [
            _in_space(reference, measured, boxes, self._sentence(boxes)),
            _in_planes(reference, measured, boxes),
            self._against_time(boxes),
        ]

    def _paths(self) -> tuple[Array, Array]:
        """Setpoint and measured points (N, 3) [mm] while the box was on, or all if it never was."""
        rows = self._path.rows()
        if rows[:, 6].any():
            rows = np.where(rows[:, 6:] > 0.0, rows, np.nan)
        return rows[:, :3], rows[:, 3:6]

    def _sentence(self, boxes: list[Box]) -> str:
        largest_mm = number(self._error.values().max)
        text = f"The tip stays within {largest_mm} mm of its reference"
        shown = largest(boxes)
        if not shown:
            return text + "; no box was on."
        sizes = " and ".join(" × ".join(f"{side:.3g}" for side in box.size) for box in shown)
        outside_mm = number(self._fixture.values().penetration_max_mm)
        return (
            f"{text} and leaves the box ({sizes} mm) by at most "
            f"{outside_mm} mm. Only the time with the box on is drawn."
        )

    def _against_time(self, boxes: list[Box]) -> Figure:
        times, values = self._position.line()
        begin, end = self._interesting(boxes)
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
            for box in boxes[:DRAWN_BOXES]:
                shapes += box.wall_lines(row, suffix)
        layout |= {"shapes": shapes, "hovermode": "x unified"}
        layout["xaxis"]["range"] = [begin, end]
        sentence = (
            "The reference is the command after the low-pass and lags behind it; the tip stays "
            f"within {number(self._error.values().max)} mm of the reference."
        )
        if boxes:
            sentence += " Dashed: walls of the box. Double-click to see the whole recording."
        return Figure("Position against time", sentence, traces, layout, 640)

    def _interesting(self, boxes: list[Box]) -> tuple[float, float]:
        """Time [s] that is shown first: with the box on, or all if it never was."""
        if not boxes:
            bag = self._context.bag
            return 0.0, (bag.end_ns - bag.start_ns) / 1e9
        return boxes[0].begin_s, boxes[-1].end_s


def _in_space(reference: Array, measured: Array, boxes: list[Box], sentence: str) -> Figure:
    """Paths of reference and tip in 3-D, with the box."""
    traces = [
        # Both lines at once would hide each other in turns.
        {**_line3(reference, "reference", REFERENCE, 4), "visible": "legendonly"},
        _line3(measured, "measured", MEASURED, 4),
        *(_line3(box.edges(), "box", BOX, 3, hidden=i > 0) for i, box in enumerate(largest(boxes))),
    ]
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


def _in_planes(reference: Array, measured: Array, boxes: list[Box]) -> Figure:
    """The same along each axis."""
    shown = largest(boxes)
    corners = [box.edges() for box in shown]
    ranges = [span(np.concatenate((reference, measured, *corners))[:, axis]) for axis in range(3)]
    traces: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"grid": {"rows": 1, "columns": 3, "pattern": "independent"}}
    for plot, (across, up) in enumerate(_PLANES, start=1):
        place = {"xaxis": f"x{plot}", "yaxis": f"y{plot}", "showlegend": plot == 1}
        traces += [
            {**line(points[:, across], points[:, up], name, color, width), **place}
            for points, name, color, width in (
                (reference, "reference", REFERENCE, 6.0),
                (measured, "measured", MEASURED, 1.6),
            )
        ]
        layout |= _plane_axes(plot, "xyz"[across], "xyz"[up], ranges[across], ranges[up])
    layout["shapes"] = [
        box.outline(across, up, plot)
        for plot, (across, up) in enumerate(_PLANES, start=1)
        for box in shown
    ]
    sentence = "The same path seen along each axis" + ("; green: the box." if shown else ".")
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
