"""Means: the plots of a study, with the same axes for all values of further parameters."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from teleop_core.evaluation import figure
from teleop_core.evaluation.figure import Figure, Layout, Trace, axis, axis_suffix
from teleop_core.kernels.geometry import Array
from teleop_lab.studies.answers import Quantity, parameters_of, score_of
from teleop_lab.studies.study import is_number
from teleop_lab.studies.summary import Mean, conditions, mean_of

if TYPE_CHECKING:
    import xarray

    from teleop_lab.studies.study import Study

_COLORS = (figure.FIRST, figure.SECOND, figure.THIRD, figure.FIXTURE, "#7f7f7f", "#17becf", "#bcbd22", "#8c564b")
_DODGE = 0.015  # between two lines, as a share of the axis, so that intervals do not cover each other
_ROW, _HEIGHT = 4, 320  # most plots in a row, and their height [px]


class _Point(NamedTuple):
    """A condition in a plot: where it stands, its statistic, and its single sessions."""

    panel: str
    line: str
    x: float
    mean: Mean
    sessions: Array


def condition_figure(
    study: "Study", data: "Mapping[str, xarray.Dataset]", metric: str, statistic: Callable[[Array], Mean] = mean_of
) -> Figure:
    """Means with intervals over the first parameter of a study.

    Colours are values of the second parameter, or the data sets if there are several. Each value of the other
    parameters has a plot of its own, side by side. A plot has single sessions, hidden at first.
    People's printed values stand beside the sessions of a study with one parameter.

    Args:
        study: Study.
        data: Results by the name of who made them.
        metric: Key of a score.
        statistic: Mean or median.
    """
    first = next(iter(parameters_of(study).values()))
    score = score_of(metric, [float(value) for one in data.values() for value in one[metric].values.ravel()])
    found = sorted(_points(study, data, metric, statistic), key=lambda one: one.x)
    panels, lines = list(dict.fromkeys(one.panel for one in found)), list(dict.fromkeys(one.line for one in found))
    gap = _DODGE * (found[-1].x - found[0].x or 1.0)
    traces: list[Trace] = []
    for (at, panel), (number, line) in product(enumerate(panels), enumerate(lines)):
        row = [one for one in found if (one.panel, one.line) == (panel, line)]
        place = {"xaxis": f"x{axis_suffix(at)}", "yaxis": f"y{axis_suffix(at)}"}
        shift = gap * (number - 0.5 * (len(lines) - 1))
        traces += [trace | place for trace in _traces(row, shift, number, score)]
    if study.printed and metric in study.printed.values and len(lines) == len(panels) == 1:
        x, people = np.array([one.x for one in found]), score.factor * study.printed.values[metric]
        traces.append(figure.intervals(x + 2.0 * gap, people, study.printed.source, figure.PUBLISHED, score.unit, 0))
    if not all(map(is_number, study.swept[first.name])):
        traces = [trace | {"mode": "markers"} for trace in traces]
    traces.sort(key=lambda trace: "visible" in trace)  # single sessions are last in the legend
    names = [trace["name"] for trace in traces]
    traces = [t | {"showlegend": bool(t["name"]) and names.index(t["name"]) == at} for at, t in enumerate(traces)]
    layout = _axes(panels, first, study.swept[first.name], score)
    return Figure(score.title, score.meaning, traces, layout, _HEIGHT * -(-len(panels) // _ROW))


def _points(
    study: "Study", data: "Mapping[str, xarray.Dataset]", metric: str, statistic: Callable[[Array], Mean]
) -> Iterator[_Point]:
    named, (first, *others) = parameters_of(study), study.swept
    colored = others[: len(data) == 1]
    for who, found in data.items():
        for at, part in conditions(study, found):
            told = {name: named[name].told(at[name]) for name in others}
            panel = ", ".join(text for name, text in told.items() if name not in colored)
            line = who or ", ".join(told[name] for name in colored)
            x = at[first] * named[first].factor if is_number(at[first]) else study.swept[first].index(at[first])
            yield _Point(panel, line, float(x), statistic(part[metric].values), part[metric].values)


def _traces(row: list[_Point], shift: float, number: int, score: Quantity) -> Iterator[Trace]:
    """One line with its intervals, and its single sessions."""
    x = np.array([one.x for one in row]) + shift
    color, means = _COLORS[number % len(_COLORS)], np.array([score.ends(one.mean) for one in row])
    yield figure.intervals(x, means, row[0].line, color, score.unit, number + 1)
    sessions = score.factor * np.array([one.sessions for one in row])
    if sessions.shape[1] > 1:
        dots = figure.points(np.repeat(x, sessions.shape[1]), sessions.ravel(), "single sessions", color, score.unit)
        yield dots | {"visible": "legendonly", "opacity": 0.5}


def _axes(panels: list[str], first: Quantity, values: Sequence[object], score: Quantity) -> Layout:
    """Layout of plots side by side; all have the same axes."""
    columns = min(len(panels), _ROW)
    ticks = [value * first.factor if is_number(value) else at for at, value in enumerate(values)]  # type: ignore[operator]
    apart = (0.2 if columns > 1 else 0.05) * (max(ticks) - min(ticks))
    kept = [at for at, tick in enumerate(ticks) if not any(0.0 < tick - other < apart for other in ticks)]
    legend = {"orientation": "h", "y": 1.02 if len(panels) < 2 else 1.1, "yanchor": "bottom", "x": 0}
    layout: Layout = {"annotations": [], "legend": legend}
    if len(panels) > 1:
        layout["grid"] = {"rows": -(-len(panels) // columns), "columns": columns, "pattern": "independent"}
    marks: Layout = {
        "tickvals": [ticks[k] for k in kept],
        "ticktext": [first.text(values[k]) for k in kept],
        "zeroline": False,
    }
    if not all(map(is_number, values)):
        marks["tickangle"] = -40
    for at, panel in enumerate(panels):
        suffix, same = axis_suffix(at), [{"matches": name} if at else {} for name in "xy"]
        layout[f"xaxis{suffix}"] = axis(first.title, first.unit, **marks, **same[0])
        named = axis("") if at % columns else axis(score.title, score.unit)
        layout[f"yaxis{suffix}"] = named | {"rangemode": "tozero"} | same[1]
        place = {"xref": f"x{suffix} domain", "yref": f"y{suffix} domain", "x": 0.5, "y": 1.0, "yanchor": "bottom"}
        layout["annotations"].append({"text": panel, "showarrow": False, **place})
    return layout
