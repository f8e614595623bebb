"""Page: a study as one HTML file: lines with intervals, heat maps, and paired differences."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from teleop_console.report.pages import Part, Section, Table, Text, page, plain_table
from teleop_core.evaluation.figure import FIRST, FIXTURE, SECOND, THIRD, Figure, axis
from teleop_core.kernels.geometry import Array
from teleop_lab.studies.study import SEED, is_number
from teleop_lab.studies.summary import Mean, conditions, differences, mean_of
from teleop_lab.studies.tuning import Range

if TYPE_CHECKING:
    import xarray

    from teleop_lab.studies.study import Study
    from teleop_lab.studies.tuning import Tuned, Tuning

_COLORS = (FIRST, SECOND, THIRD, FIXTURE, "#7f7f7f", "#17becf", "#bcbd22", "#8c564b")


def study_page(study: "Study", found: "xarray.Dataset", title: str) -> str:
    """HTML page of a study; it works offline, with plotly.js inside."""
    facts = ", ".join(f"{name} {value}" for name, value in found.attrs.items() if value)
    errors = sorted({str(error) for error in found["error"].values.ravel() if error})
    parts: list[Part] = [
        Text(f"{facts}. Means over the seeds, with 95 % intervals by the bootstrap."),
        _table(study, found),
        *(Text(f"failed: {error}") for error in errors),
    ]
    return page(title, parts, [Section(metric, parts=_parts(study, found, metric)) for metric in study.metrics])


def _parts(study: "Study", found: "xarray.Dataset", metric: str) -> list[Part]:
    """Figures and table of one score."""
    parts: list[Part] = []
    if study.swept:
        parts.append(condition_figure(study, found, metric, condition_lines(study, found, metric)))
    if len(study.swept) > 1:
        parts.append(_heat(study, found, metric))
    rows = [
        [name, str(value), str(mean)]
        for name, means in differences(study, found, metric).items()
        for value, mean in zip(study.swept[name][1:], means, strict=True)
    ]
    return [*parts, *[plain_table((metric, "against the first value", "difference"), rows)] * bool(rows)]


def tuning_page(tuning: "Tuning", tuned: "Tuned", title: str) -> str:
    """HTML page of a search. It shows the score by trial and by each parameter, and works offline."""
    numbers = [str(n) for n in range(1, len(tuned.trials) + 1)]
    columns: dict[str, list[Any]] = {"trial": [int(n) for n in numbers]}
    columns |= {name: [trial.values[name] for trial in tuned.trials] for name in tuning.searched}
    figures: list[Part] = []
    for name, values in columns.items():
        trace = {
            "type": "scatter",
            "mode": "markers",
            "marker": {"color": FIRST},
            "text": numbers,
            "x": [x if is_number(x) else str(x) for x in values],
            "y": [trial.score for trial in tuned.trials],
            "hovertemplate": "trial %{text}: %{y:.4g}<extra></extra>",
        }
        where = tuning.searched.get(name)
        kind = {"type": "log"} if isinstance(where, Range) and where.is_log else {}
        layout = {"xaxis": axis(name, **kind), "yaxis": axis(tuning.metric)}
        figures.append(Figure(name, "", [trace], layout, 300))
    best = ", ".join(
        f"{name}={value:.4g}" if isinstance(value, float) else f"{name}={value}"
        for name, value in tuned.best.values.items()
    )
    told = f"Best: {best}, with {tuning.metric} {tuned.best.score:.4g}. {tuned.told(tuning.metric)}"
    return page(title, [Text(told)], [Section(parts=figures)])


def _label(found: "xarray.Dataset", metric: str) -> dict[str, Any]:
    unit = found[metric].attrs.get("units", "1")
    return axis(metric, "" if unit == "1" else unit)


def condition_lines(
    study: "Study", found: "xarray.Dataset", metric: str, figure: Callable[[Array], Mean] = mean_of
) -> list[dict[str, Any]]:
    """A line over the first swept parameter for each combination of the others, with intervals."""
    name = next(iter(study.swept))
    lines: dict[str, list[tuple[Any, Mean]]] = {}
    for values, part in conditions(study, found):
        others = ", ".join(f"{key}={value}" for key, value in values.items() if key != name)
        lines.setdefault(others, []).append((values[name], figure(part[metric].values)))
    traces = []
    for number, (others, points) in enumerate(lines.items()):
        means = [mean for _, mean in points]
        traces.append(
            {
                "type": "scatter",
                "mode": "lines+markers",
                "name": others,
                "x": [x if is_number(x) else str(x) for x, _ in points],
                "y": [mean.value for mean in means],
                "error_y": {
                    "type": "data",
                    "symmetric": False,
                    "array": [mean.high - mean.value for mean in means],
                    "arrayminus": [mean.value - mean.low for mean in means],
                },
                "line": {"color": _COLORS[number % len(_COLORS)]},
            }
        )
    return traces


def condition_figure(study: "Study", found: "xarray.Dataset", metric: str, traces: list[dict[str, Any]]) -> Figure:
    """Figure of lines over the first swept parameter."""
    name = next(iter(study.swept))
    layout = {"xaxis": axis(name), "yaxis": _label(found, metric)}
    return Figure("", f"{metric} over {name}", traces, layout, 340)


def _heat(study: "Study", found: "xarray.Dataset", metric: str) -> Figure:
    """Heat map of means for the values of the first two parameters."""
    first, second = list(study.swept)[:2]
    others = [name for name in (*study.swept, SEED) if name not in {first, second}]
    means = found[metric].mean(others).transpose(second, first)
    trace = {
        "type": "heatmap",
        "z": np.asarray(means.values),
        "colorscale": "Viridis",
        "x": [str(value) for value in study.swept[first]],
        "y": [str(value) for value in study.swept[second]],
        "colorbar": {"title": {"text": metric}},
    }
    return Figure("", f"means over {', '.join(others)}", [trace], {"xaxis": axis(first), "yaxis": axis(second)}, 340)


def _table(study: "Study", found: "xarray.Dataset") -> Table:
    rows = [
        [*map(str, values.values()), *(str(mean_of(part[metric].values)) for metric in study.metrics)]
        for values, part in conditions(study, found)
    ]
    return plain_table((*study.swept, *study.metrics), rows)
