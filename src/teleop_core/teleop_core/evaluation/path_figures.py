"""Path figures: where the tip went, in space and per plane."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from teleop_core.evaluation.figure import BOX, DRAWN_BOXES, MEASURED, REFERENCE, Figure, line
from teleop_core.evaluation.metrics import Study
from teleop_core.evaluation.summary import number
from teleop_core.evaluation.traces import Box, Drawing
from teleop_core.geometry import Array

_PLANES = ((0, 1), (0, 2), (1, 2))
_CAMERA = {"eye": {"x": 1.35, "y": -1.65, "z": 0.8}, "center": {"x": 0, "y": 0, "z": -0.12}}


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
        _line3(reference, "reference", REFERENCE, 8),
        _line3(measured, "measured", MEASURED, 4),
        *(_line3(_edges(box), "box", BOX, 3, hidden=i > 0) for i, box in enumerate(largest(boxes))),
    ]
    axes = {f"{axis}axis": {"title": {"text": f"{axis} [mm]"}} for axis in "xyz"}
    scene = {**axes, "aspectmode": "data", "camera": _CAMERA}
    return Figure("Path in space", _path_sentence(study, boxes), traces, {"scene": scene}, 560)


def _path_sentence(study: Study, boxes: list[Box]) -> str:
    score = study.score
    text = f"The tip follows its reference within {number(score.position_error_mm.max)} mm at worst"
    if not boxes:
        return text + "; no box was on."
    box = largest(boxes)[0]
    size = " × ".join(f"{side:.3g}" for side in box.size)
    return (
        f"{text} and leaves the box of {size} mm by at most "
        f"{number(score.fixture.penetration_max_mm)} mm; only the time with the box on is drawn."
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
    traces: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"grid": {"rows": 1, "columns": 3, "pattern": "independent"}}
    layout["shapes"] = []
    for plot, (across, up) in enumerate(_PLANES, start=1):
        place = {"xaxis": f"x{plot}", "yaxis": f"y{plot}", "showlegend": plot == 1}
        for points, name, color, width in (
            (reference, "reference", REFERENCE, 6), (measured, "measured", MEASURED, 1.6),
        ):  # fmt: skip
            trace = line(points[:, across], points[:, up], name, color, width)
            traces.append({**trace, **place})
        layout |= _plane_axes(plot, "xyz"[across], "xyz"[up])
        layout["shapes"] += [_outline(box, across, up, plot) for box in largest(boxes)]
    sentence = "The same path seen along each axis; the green outline is the box."
    if not boxes:
        sentence = "The same path seen along each axis."
    return Figure("Path per plane", sentence, traces, layout, 420)


def _plane_axes(plot: int, across: str, up: str) -> dict[str, Any]:
    return {
        f"xaxis{plot}": {"title": {"text": f"{across} [mm]"}, "constrain": "domain"},
        f"yaxis{plot}": {
            "title": {"text": f"{up} [mm]"}, "scaleanchor": f"x{plot}", "constrain": "domain",
        },
    }  # fmt: skip


def _outline(box: Box, across: int, up: int, plot: int) -> dict[str, Any]:
    (x0, x1), (y0, y1) = box.walls(across), box.walls(up)
    return {
        "type": "rect", "xref": f"x{plot}", "yref": f"y{plot}",
        "x0": x0, "x1": x1, "y0": y0, "y1": y1, "line": {"color": BOX, "width": 2},
    }  # fmt: skip
