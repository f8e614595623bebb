"""Page: plots of the motion that a slave can follow, in space and against time, for given and proposed settings."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from teleop_console.report.pages import Printed, Section, Text, page
from teleop_core.evaluation.bands import LIMIT_COLORS, Band, merged
from teleop_core.evaluation.figure import SURROUNDING, Figure, axis, in_space, line, stacked_axes
from teleop_core.graph.topics import Limit
from teleop_core.kernels.geometry import rotation_vectors
from teleop_core.robots.dexterity import sample_workspace
from teleop_lab.planning import asked, walk
from teleop_lab.planning.reach_result import LABELS, Followed, Reach

COLORS = {Limit.NONE: "#1c7c54", **LIMIT_COLORS}
"""Colour of a sample by the cause that keeps the slave from following it; ``Limit.NONE`` for followed samples."""
_POINTS = 6_000  # largest number of drawn samples of a path; more make the page slow, and the plot no clearer
_WORKSPACE = 3_000  # drawn positions that the tip can reach
_LEAST_VIEW = 0.02  # smallest half of the side of the drawn space [m]
_AXES = (("x", "#1971c2"), ("y", "#868e96"), ("z", "#b08900"))
_NOTE = (
    "In space: the path of the hand as it is asked of the slave, with nothing cut off, over places that the tip can "
    "reach (grey). Against time: as a session follows it, where a limit cuts off what is beyond; bands are the times "
    "in which the slave does not follow."
)


def write_reach_page(reaches: Sequence[Reach], file: Path) -> None:
    """Write one self-contained page.

    Args:
        reaches: Result for each recording, at least one.
        file: Path of the page; the folder must exist.

    Raises:
        OSError: The file cannot be written.
    """
    sections = []
    for reach in reaches:
        title = f"{reach.path.name}: reach of {reach.robot.name}"
        sections.append(Section(title, parts=[Printed(str(reach)), Text(_NOTE)]))
        sections.append(_section("as given", reach, reach.given))
        if not reach.is_given:
            sections.append(_section("proposed", reach, reach.proposed))
    title = "Reach of " + ", ".join(reach.path.name for reach in reaches)
    file.write_text(page(title, [], sections), encoding="utf-8")


def _section(name: str, reach: Reach, followed: Followed) -> Section:
    path = reach.path
    figures = [_space(reach, followed), _times(path, followed.session, f"{followed.share:.1%} followed")]
    return Section(name, "", figures, bands=list(_bands(path, followed.session)), duration_s=float(path.time[-1]))


def _space(reach: Reach, followed: Followed) -> Figure:
    """Path in space, coloured by the limit that keeps the slave from following; it fills the view."""
    walked = followed.in_place
    low, high = walked.asked[:, :3].min(axis=0), walked.asked[:, :3].max(axis=0)
    half = max(float((high - low).max()), _LEAST_VIEW)
    axes = {
        f"{name}axis": axis(name, "m", range=[middle - half, middle + half])
        for name, middle in zip("xyz", (0.5 * (low + high)).tolist(), strict=True)
    }
    points, _ = sample_workspace(reach.robot, _WORKSPACE, np.random.default_rng(1))
    traces = [in_space(points, "workspace", SURROUNDING, 1.0, "markers", size=1.5, opacity=0.4)]
    kept = _spread(len(walked.asked), _POINTS)
    places, limits = walked.asked[kept, :3], walked.limit[kept]
    traces += [
        in_space(places[limits == cause], _label(cause), color, 1.0, "markers")
        for cause, color in COLORS.items()
        if (limits == cause).any()
    ]
    traces.append(in_space(walked.asked[:1, :3], "start", "#d6336c", 1.0, "markers", size=6, symbol="cross"))
    legend = {"orientation": "h", "y": 1.02, "yanchor": "bottom", "itemsizing": "constant"}
    layout = {"scene": {**axes, "aspectmode": "cube"}, "legend": legend}
    return Figure("in space", f"{walked.share:.1%} within reach", traces, layout, 520)


def _times(path: asked.AskedPath, walked: walk.Walked, sentence: str) -> Figure:
    """Position and rotation since the start, against time."""
    kept, time = _spread(len(path), _POINTS), path.time
    moves = 1e3 * (walked.asked[:, :3] - walked.asked[0, :3])
    turns = np.degrees(rotation_vectors(walked.asked[:, 3:]))
    traces = [
        line(time[kept], values[kept, column], name, color, 1.2, unit)
        | {"yaxis": "y" if unit == "mm" else "y2", "showlegend": unit == "mm"}
        for values, unit in ((moves, "mm"), (turns, "°"))
        for column, (name, color) in enumerate(_AXES)
    ]
    layout = stacked_axes(("position", "turn"), "mm")
    layout["yaxis2"]["title"] = {"text": "turn [°]"}
    return Figure("against time", sentence, traces, layout, 520)


def _bands(path: asked.AskedPath, walked: walk.Walked) -> Iterator[Band]:
    """Yield the times in which each cause keeps the slave from following, if the cause occurs."""
    ends = np.append(path.time[1:], path.time[-1])
    for cause, color in LIMIT_COLORS.items():
        change = np.diff((walked.limit == cause).astype(np.int8), prepend=0, append=0)
        begins, lasts = np.flatnonzero(change == 1), np.flatnonzero(change == -1) - 1
        if len(begins):
            yield Band(f"not: {_label(cause)}", color, merged(np.column_stack((path.time[begins], ends[lasts]))))


def _label(cause: Limit) -> str:
    return "followed" if cause is Limit.NONE else LABELS[cause.name.lower()]


def _spread(count: int, most: int) -> Any:
    """Indices of at most ``most`` of ``count`` samples, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))
