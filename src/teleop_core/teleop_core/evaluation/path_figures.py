"""Path figures: where the tip went, in space and per plane."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from teleop_core.evaluation.figure import BOX, DRAWN_BOXES, MEASURED, REFERENCE, Figure, line, span
from teleop_core.evaluation.metrics import Study
from teleop_core.evaluation.summary import number
from teleop_core.evaluation.traces import Box, Drawing
from teleop_core.geometry import Array

_PLANES = ((0, 1), (0, 2), (1, 2))
_CAMERA = {"eye": {"x": 1.25, "y": -1.52, "z": 0.76}, "center": {"x": 0, "y": 0, "z": -0.1}}


def _path(drawing: Drawing) -> tuple[Array, Array]:
    """Setpoint and measured points (N, 3) [mm] while the box was on, or all if it never was."""
    rows = drawing.path.rows()
    if rows[:, 6].any():
        rows = np.where(rows[:, 6:] > 0.0, rows, np.nan)
    return rows[:, :3], rows[:, 3:6]


def largest(boxes: Sequence[Box]) -> list[Box]:
    """Boxes that were on longest, one per place."""
    lengths: dict[tuple[Any, Any], float] = {}
    one: dict[tuple[Any, Any], Box] = {}
    for box in boxes:
        place = (box.center, box.size)
        lengths[place] = lengths.get(place, 0.0) + box.end_s - box.begin_s
        one[place] = box
    longest = sorted(one, key=lambda place: -lengths[place])[:DRAWN_BOXES]
    return [one[place] for place in longest]


def path_in_space(study: Study, boxes: list[Box]) -> Figure:
    """Paths of reference and tip in 3-D, with the box."""
    reference, measured = _path(study.drawing)
    traces = [
        # Both lines at once would hide each other in turns.
        {**_line3(reference, "reference", REFERENCE, 4), "visible": "legendonly"},
        _line3(measured, "measured", MEASURED, 4),
        *(_line3(_edges(box), "box", BOX, 3, hidden=i > 0) for i, box in enumerate(largest(boxes))),
    ]
    axes = {f"{axis}axis": {"title": {"text": f"{axis} [mm]"}} for axis in "xyz"}
    scene = {**axes, "aspectmode": "data", "camera": _CAMERA}
    return Figure("Path in space", _path_sentence(study, boxes), traces, {"scene": scene}, 560)


def _path_sentence(study: Study, boxes: list[Box]) -> str:
    score = study.score
    text = f"The tip stays within {number(score.position_error_mm.max)} mm of its reference"
    shown = largest(boxes)
    if not shown:
        return text + "; no box was on."
    sizes = " and ".join(" × ".join(f"{side:.3g}" for side in box.size) for box in shown)
    return (
        f"{text} and leaves the box ({sizes} mm) by at most "
        f"{number(score.fixture.penetration_max_mm)} mm. Only the time with the box on is drawn."
    )


def _edges(box: Box) -> Array:
    """One line along all edges of a box, shape (N, 3), [mm]."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 0), (0, 0, 1), (1, 0, 1),
               (1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 1, 0),
               (0, 1, 1), (0, 0, 1)]  # fmt: skip
    edges: Array = np.array(box.center) + (np.array(corners) - 0.5) * np.array(box.size)
    return edges


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


def path_in_planes(study: Study, boxes: list[Box]) -> Figure:
    """The same along each axis."""
    reference, measured = _path(study.drawing)
    shown = largest(boxes)
    corners = [_edges(box) for box in shown]
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
        _outline(box, across, up, plot)
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


def _outline(box: Box, across: int, up: int, plot: int) -> dict[str, Any]:
    (x0, x1), (y0, y1) = box.walls(across), box.walls(up)
    return {
        "type": "rect", "xref": f"x{plot}", "yref": f"y{plot}",
        "x0": x0, "x1": x1, "y0": y0, "y1": y1, "line": {"color": BOX, "width": 2},
    }  # fmt: skip
