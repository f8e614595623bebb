"""Page: plots of the motion that a slave can follow, in space and against time, for given and proposed settings."""

from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as plots
from plotly.subplots import make_subplots

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
_BINS = 1_500  # time bins in which causes are drawn
_ROWS = (2, 3)  # rows of the figure that show curves over time
_AXES = (("x", "#1971c2"), ("y", "#495057"), ("z", "#b08900"))
_STYLE = """\
body { font: 15px/1.45 system-ui, sans-serif; margin: 1rem auto; max-width: 1500px;
  padding: 0 1rem; }
pre { overflow-x: auto; background: #f4f4f2; padding: .8rem; font-size: 13px; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 460px), 1fr)); }
.pair > div { min-width: 0; overflow: hidden; }
@media (max-width: 600px) { h1 { font-size: 1.3rem; } pre { font-size: 10px; padding: .4rem; } }
"""
_HEAD = """\
<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">
<title>{title}</title><style>
{style}</style></head><body>
<noscript><p>The plots need JavaScript, which is off here; the tables are all there.</p></noscript>
"""
# The first figure is drawn before the second takes its half of the width.
_TAIL = """\
<script>addEventListener("load", () => dispatchEvent(new Event("resize")));</script>
</body></html>
"""
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
    title = "Reach of " + ", ".join(reach.path.name for reach in reaches)
    parts = [_HEAD.format(title=escape(title), style=_STYLE)]
    for reach in reaches:
        parts.append(f"<h1>{escape(reach.path.name)}: reach of {escape(reach.robot.name)}</h1>")
        parts += [f"<pre>{escape(str(reach))}</pre>", _NOTES, '<div class="pair">']
        kinds = [("as given", reach.given)]
        kinds += [] if reach.is_given else [("proposed", reach.proposed)]
        for name, followed in kinds:
            drawn = reach_figure(reach, followed, name)
            is_first = not any("plotly.js" in part for part in parts)
            html = drawn.to_html(full_html=False, include_plotlyjs=is_first, config={"responsive": True})
            parts.append(f"<div>{html}</div>")
        parts.append("</div>")
    file.write_text("\n".join([*parts, _TAIL]), encoding="utf-8")


def reach_figure(reach: "Reach", followed: "Followed", name: str) -> plots.Figure:
    """Figure of one placement: the path in space, then position and rotation against time."""
    titles = (
        f"{name}, in space: {followed.in_place.share:.1%} within reach",
        f"{name}, against time: {followed.share:.1%} followed",
        "",
    )
    figure = make_subplots(
        rows=3,
        cols=1,
        row_heights=[0.56, 0.22, 0.22],
        vertical_spacing=0.06,
        specs=[[{"type": "scene"}], [{"secondary_y": True}], [{"secondary_y": True}]],
        subplot_titles=titles,
    )
    figure.add_traces([*_workspace(reach), *_in_space(followed)], rows=1, cols=1)
    _add_times(figure, reach.path, followed.session)
    axes = {f"{axis}axis": {"title": f"{axis} [m]"} for axis in "xyz"}
    figure.update_layout(
        height=980,
        template="plotly_white",
        scene={**axes, "aspectmode": "data"},
        legend={"orientation": "h", "y": -0.06, "itemsizing": "constant"},
        margin={"l": 60, "r": 10, "t": 60, "b": 40},
    )
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
    marker = {"size": 6, "color": "#111", "symbol": "cross"}
    traces.append(plots.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name="start"))
    return traces


def _add_times(figure: Any, path: asked.AskedPath, walked: walk.Walked) -> None:
    """Add curves of position and rotation since the start; bands mark the times at which the slave does not follow."""
    kept, time = _spread(len(path), _POINTS), path.time
    moves = 1e3 * (walked.asked[:, :3] - walked.asked[0, :3])
    turns = np.degrees(rotation_vectors(walked.asked[:, 3:]))
    curves = ((moves, "position [mm]"), (turns, "turn [°]"))
    for row, (values, unit) in zip(_ROWS, curves, strict=True):
        for cause, bins in _bands(path, walked):
            _add_band(figure, row, bins, cause)
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
                secondary_y=True,
            )
        figure.update_yaxes(title_text=unit, side="left", tickmode="auto", row=row, col=1, secondary_y=True)
        figure.update_yaxes(range=[0, 1], visible=False, row=row, col=1, secondary_y=False)
    figure.update_xaxes(matches="x", row=_ROWS[1], col=1, title_text="time [s]")


def _add_band(figure: Any, row: int, bins: tuple[Array, Array], cause: Limit) -> None:
    begins, is_so = bins
    red, green, blue = bytes.fromhex(COLORS[cause][1:])
    band = plots.Scatter(
        x=begins, y=is_so, mode="lines", line={"width": 0, "shape": "hv"}, fill="tozeroy",
        fillcolor=f"rgba({red}, {green}, {blue}, 0.35)", name=f"not: {_label(cause)}",
        legendgroup=cause.name, showlegend=row == _ROWS[0], hoverinfo="skip",
    )  # fmt: skip
    figure.add_trace(band, row=row, col=1, secondary_y=False)


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
