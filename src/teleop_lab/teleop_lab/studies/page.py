"""Page: a study as one HTML file: lines with intervals, heat maps, and paired differences."""

from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from teleop_console.report.plain_page import Figures, plain_page
from teleop_core.evaluation.figure import FIRST, FIXTURE, SECOND, THIRD
from teleop_core.kernels.geometry import Array
from teleop_lab.drawing import axis
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
    figures, parts = Figures(), [_table(study, found)]
    for metric in study.metrics:
        parts.append(f"<h2>{escape(metric)}</h2>")
        if study.swept:
            parts.append(figures.card(condition_lines(study, found, metric), label_of(study, found, metric)))
        if (heat := _heat(study, found, metric)) is not None:
            parts.append(figures.card(*heat))
        parts.append(_changes(study, found, metric))
    errors = sorted({str(error) for error in found["error"].values.ravel() if error})
    parts += [f"<p>failed: {escape(error)}</p>" for error in errors]
    facts = ", ".join(f"{name} {value}" for name, value in found.attrs.items() if value)
    return whole_page(title, f"{facts}. Means over the seeds, with 95 % intervals by the bootstrap.", parts, figures)


def tuning_page(tuning: "Tuning", tuned: "Tuned", title: str) -> str:
    """HTML page of a search. It shows the score by trial and by each parameter, and works offline."""
    numbers = [str(n) for n in range(1, len(tuned.trials) + 1)]
    columns: dict[str, list[Any]] = {"trial": [int(n) for n in numbers]}
    columns |= {name: [trial.values[name] for trial in tuned.trials] for name in tuning.searched}
    figures, parts = Figures(), list[str]()
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
        layout = {"xaxis": axis(name, **kind), "yaxis": axis(tuning.metric), "height": 300}
        parts += [f"<h2>{escape(name)}</h2>", figures.card([trace], layout)]
    best = ", ".join(
        f"{name}={value:.4g}" if isinstance(value, float) else f"{name}={value}"
        for name, value in tuned.best.values.items()
    )
    return whole_page(title, f"Best: {best}, with {tuning.metric} {tuned.best.score:.4g}.", parts, figures)


def whole_page(title: str, sentence: str, parts: list[str], figures: Figures) -> str:
    """HTML page of some parts, with plotly.js inside."""
    return plain_page(title, [f'<p class="facts">{escape(sentence)}</p>', *parts], figures)


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


def label_of(study: "Study", found: "xarray.Dataset", metric: str) -> dict[str, Any]:
    """Layout of a figure of lines over the first swept parameter."""
    return {"xaxis": axis(next(iter(study.swept))), "yaxis": _label(found, metric), "height": 340}


def _heat(study: "Study", found: "xarray.Dataset", metric: str) -> tuple[Any, Any] | None:
    """Heat map of means for the values of the first two parameters; None if fewer than two are swept."""
    if len(study.swept) < 2:
        return None
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
    layout = {"xaxis": axis(first), "yaxis": axis(second), "height": 280}
    return [trace], layout


def _table(study: "Study", found: "xarray.Dataset") -> str:
    rows = [
        [*map(str, values.values()), *(str(mean_of(part[metric].values)) for metric in study.metrics)]
        for values, part in conditions(study, found)
    ]
    return table_html((*study.swept, *study.metrics), rows)


def _changes(study: "Study", found: "xarray.Dataset", metric: str) -> str:
    rows = [
        [name, str(value), str(mean)]
        for name, means in differences(study, found, metric).items()
        for value, mean in zip(study.swept[name][1:], means, strict=True)
    ]
    return table_html((metric, "against the first value", "difference"), rows)


def table_html(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table for a :func:`whole_page`; empty without rows."""
    lines = [
        [f"<th>{escape(text)}</th>" for text in heads],
        *([f"<td>{escape(cell)}</td>" for cell in r] for r in rows),
    ]
    body = "".join(f"<tr>{''.join(line)}</tr>" for line in lines)
    return f'<div class="card table"><table>{body}</table></div>' if rows else ""
