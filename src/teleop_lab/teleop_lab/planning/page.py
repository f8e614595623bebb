"""Page: plots of the motion that a slave can follow, in space and against time, for given and proposed settings."""

from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as plots
from plotly.subplots import make_subplots

from teleop_console.report.plain_page import Figures, plain_page
from teleop_core.evaluation.bands import LIMIT_COLORS
from teleop_core.graph.topics import Limit
from teleop_core.kernels.geometry import Array, rotation_vectors
from teleop_core.robots.dexterity import sample_workspace
from teleop_lab.planning import asked, walk
from teleop_lab.planning.reach_result import LABELS, Followed, Reach

COLORS = {Limit.NONE: "#1c7c54", **LIMIT_COLORS}
"""Colour of a sample by the cause that keeps the slave from following it; ``Limit.NONE`` for followed samples."""
_POINTS = 6_000  # largest number of drawn samples of a path; more make the page slow, and the plot no clearer
_WORKSPACE = 3_000  # drawn positions that the tip can reach
_LEAST_VIEW = 0.02  # smallest half of the side of the drawn space [m]
_BINS = 1_500  # time bins in which causes are drawn
_ROWS = (1, 2)  # rows of the figure that show curves over time
_AXES = (("x", "#1971c2"), ("y", "#868e96"), ("z", "#b08900"))
_NOTES = """\
<p>In space: the path of the hand as it is asked of the slave, with nothing cut off, over places
that the tip can reach (grey). Against time: as a session follows it, where a limit cuts off what is
beyond; bands are the times in which the slave does not follow.</p>
"""


def write_reach_page(reaches: "Sequence[Reach]", file: Path) -> None:
    """Write one self-contained page.

    Args:
        reaches: Result for each recording, at least one.
        file: Path of the page; the folder must exist.

    Raises:
        OSError: The file cannot be written.
    """
    figures, parts = Figures(), list[str]()
    for reach in reaches:
        parts.append(f"<h2>{escape(reach.path.name)}: reach of {escape(reach.robot.name)}</h2>")
        parts += [f'<pre class="card">{escape(str(reach))}</pre>', _NOTES, '<div class="pair">']
        kinds = [("as given", reach.given)]
        kinds += [] if reach.is_given else [("proposed", reach.proposed)]
        for name, followed in kinds:
            parts.append(
                figures.card(*_space(reach, followed), f"{name}, in space: {followed.in_place.share:.1%} within reach")
            )
        for name, followed in kinds:
            drawn = _times(reach.path, followed.session)
            parts.append(figures.card(drawn.data, drawn.layout, f"{name}, against time: {followed.share:.1%} followed"))
        parts.append("</div>")
    title = "Reach of " + ", ".join(reach.path.name for reach in reaches)
    file.write_text(plain_page(title, parts, figures), encoding="utf-8")


def _space(reach: "Reach", followed: "Followed") -> tuple[list[Any], dict[str, Any]]:
    """Traces and layout of the path in space; the path fills the view, and the workspace goes on around it."""
    places = followed.in_place.asked[:, :3]
    low, high = places.min(axis=0), places.max(axis=0)
    half = max(float((high - low).max()), _LEAST_VIEW)
    axes = {
        f"{axis}axis": {"title": {"text": f"{axis} [m]"}, "range": [middle - half, middle + half]}
        for axis, middle in zip("xyz", (0.5 * (low + high)).tolist(), strict=True)
    }
    scene = {**axes, "aspectmode": "cube"}
    legend = {"orientation": "h", "y": 0.0, "yanchor": "top", "itemsizing": "constant"}
    margin = {"l": 10, "r": 10, "t": 10, "b": 10}
    return [*_workspace(reach), *_in_space(followed)], {
        "height": 520, "template": "none", "scene": scene, "legend": legend, "margin": margin,
    }  # fmt: skip


def _times(path: asked.AskedPath, walked: walk.Walked) -> Any:
    """Figure of position and rotation against time."""
    double = [{"secondary_y": True}]
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.08, specs=[double, double])
    _add_times(figure, path, walked)
    legend = {"orientation": "h", "y": 1.02, "yanchor": "bottom", "itemsizing": "constant"}
    figure.update_layout(height=520, template="none", legend=legend, margin={"l": 60, "r": 10, "t": 40, "b": 45})
    return figure


def _workspace(reach: "Reach") -> list[Any]:
    points, _ = sample_workspace(reach.robot, _WORKSPACE, np.random.default_rng(1))
    x, y, z = points.T
    marker = {"size": 1.5, "color": "#adb5bd", "opacity": 0.4}
    return [plots.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name="workspace", hoverinfo="skip")]


def _in_space(followed: "Followed") -> list[Any]:
    """Path of the hand, coloured by the limit that keeps the slave from following."""
    walked, traces = followed.in_place, []
    kept = _spread(len(walked.asked), _POINTS)
    places, limits = walked.asked[kept, :3], walked.limit[kept]
    for cause, color in COLORS.items():
        x, y, z = places[limits == cause].T
        if len(x):
            traces.append(
                plots.Scatter3d(x=x, y=y, z=z, mode="markers", marker={"size": 2, "color": color}, name=_label(cause))
            )
    x, y, z = ([value] for value in walked.asked[0, :3])
    marker = {"size": 6, "color": "#d6336c", "symbol": "cross"}
    traces.append(plots.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name="start"))
    return traces


def _add_times(figure: Any, path: asked.AskedPath, walked: walk.Walked) -> None:
    """Add curves of position and rotation since the start; bands mark the times at which the slave does not follow."""
    kept, time = _spread(len(path), _POINTS), path.time
    moves = 1e3 * (walked.asked[:, :3] - walked.asked[0, :3])
    turns = np.degrees(rotation_vectors(walked.asked[:, 3:]))
    curves = ((moves, "position [mm]"), (turns, "turn [°]"))
    for row, (values, unit) in zip(_ROWS, curves, strict=True):
        for column, (axis, color) in enumerate(_AXES):
            figure.add_trace(
                plots.Scatter(
                    x=time[kept],
                    y=values[kept, column],
                    mode="lines",
                    name=axis,
                    line={"width": 1.2, "color": color},
                    legendgroup=axis,
                    showlegend=row == _ROWS[0],
                ),
                row=row,
                col=1,
                secondary_y=False,
            )
        # Bands have the second axis: without a curve on the first one, plotly would give it the whole height.
        for cause, bins in _bands(path, walked):
            _add_band(figure, row, bins, cause)
        figure.update_yaxes(title_text=unit, row=row, col=1, secondary_y=False)
        figure.update_yaxes(range=[0, 1], visible=False, row=row, col=1, secondary_y=True)
    figure.update_xaxes(row=_ROWS[1], col=1, title_text="time [s]")


def _add_band(figure: Any, row: int, bins: tuple[Array, Array], cause: Limit) -> None:
    begins, is_so = bins
    red, green, blue = bytes.fromhex(COLORS[cause][1:])
    band = plots.Scatter(
        x=begins, y=is_so, mode="lines", line={"width": 0, "shape": "hv"}, fill="tozeroy",
        fillcolor=f"rgba({red}, {green}, {blue}, 0.35)", name=f"not: {_label(cause)}",
        legendgroup=cause.name, showlegend=row == _ROWS[0], hoverinfo="skip",
    )  # fmt: skip
    figure.add_trace(band, row=row, col=1, secondary_y=True)


def _bands(path: asked.AskedPath, walked: walk.Walked) -> Iterable[tuple[Limit, tuple[Array, Array]]]:
    """Yield each cause that occurs, with the edges of the time bins (M,) [s], and 1 or 0 for each bin.

    The number is 1 if the cause occurs in the bin.

    Even the shortest occurrence fills a whole bin, so it is visible.
    """
    edges = np.linspace(0.0, path.time[-1], _BINS + 1)
    at = np.minimum(np.searchsorted(edges, path.time, side="right") - 1, _BINS - 1)
    for cause in COLORS:
        is_so = walked.limit == cause
        if cause is Limit.NONE or not is_so.any():
            continue
        shown = np.zeros(_BINS + 1)
        shown[at[is_so]] = 1.0
        yield cause, (edges, shown)


def _label(cause: Limit) -> str:
    return "followed" if cause is Limit.NONE else LABELS[cause.name.lower()]


def _spread(count: int, most: int) -> Any:
    """Indices of at most ``most`` of ``count`` samples, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))
