"""Page: a study as one HTML file: its design, an answer to each question, means with intervals, and tables."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from teleop_console.report.pages import Cell, Listed, Part, Section, Text, page, plain_table
from teleop_core.evaluation.figure import Figure, axis
from teleop_lab.studies.answers import NO_SCORE, UNTOLD, effect_told, parameters_of, score_of
from teleop_lab.studies.means import condition_figure
from teleop_lab.studies.study import SEED, is_number
from teleop_lab.studies.summary import Mean, conditions, differences, interplay, mean_of

if TYPE_CHECKING:
    import xarray

    from teleop_lab.studies.study import Study

_MOST_ROWS = 600
_ABOUT = (
    "A difference is counted from the first value of its parameter, within each seed and over all values of the other "
    "parameters; the 95 % interval is over the seeds (Student). A difference whose interval includes zero cannot be "
    "told apart from none. Of twenty intervals, one misses the truth by chance."
)


def study_page(study: "Study", found: "xarray.Dataset", title: str) -> str:
    """HTML page of a study; it works offline, with plotly.js inside."""
    errors = sorted({str(error) for error in found["error"].values.ravel() if error})
    facts = ", ".join(f"{name} {value}" for name, value in found.attrs.items() if value)
    parts: list[Part] = [_design(study), *(Text(f"failed: {error}") for error in errors)]
    sections = []
    if study.swept:
        sections.append(Section("Answers", _ABOUT, [Listed(list(_answers(study, found)))]))
        figures: list[Part] = []
        for metric in study.metrics:
            figures.append(condition_figure(study, {"": found}, metric))
            figures += [_heat(study, found, metric, pair) for pair in _joint(study, found, metric)]
        told = "Points are means over the seeds with 95 % intervals. A click on single sessions in a legend shows them."
        sections.append(Section("Means", told, figures))
    sections.append(Section("Numbers", facts, list(_tables(study, found))))
    return page(title, parts, sections)


def _design(study: "Study") -> Listed:
    """The design in one picture: a row of boxes for each parameter, and one for the seeds."""
    rows = [
        (one.head, f"{name}: {one.meaning}", [Cell(one.text(value)) for value in study.swept[name]])
        for name, one in parameters_of(study).items()
    ]
    rows.append((SEED, "repeats every combination, so comparisons are within a seed", seed_boxes(study.seeds)))
    counts = [*map(len, study.swept.values()), len(study.seeds)]
    told = f"{' × '.join(map(str, counts))} = {prod(counts)} sessions of {study.scenario or 'the defaults'}"
    rows.append(("sessions", "independent of each other, so their order has no effect", [Cell(told)]))
    return Listed(rows, are_boxes=True)


def seed_boxes(seeds: Sequence[int]) -> list[Cell]:
    """Boxes of seeds; of many seeds only some have one."""
    shown = list(map(str, seeds))
    return list(map(Cell, shown if len(shown) <= 12 else [*shown[:10], "…", shown[-1]]))


def _far(values: Any, means: list[Mean]) -> int:
    """Index of the difference that answers a question: that of the last number, or the largest one of other values."""
    if all(map(is_number, values)):
        return len(means) - 1
    return int(np.argmax([abs(np.nan_to_num(mean.value)) for mean in means]))


def _answers(study: "Study", found: "xarray.Dataset") -> Iterator[tuple[str, str, list[Cell]]]:
    """Answers for each parameter, each pair of parameters, and people; an answer for each score."""
    named, changes = parameters_of(study), {metric: differences(study, found, metric) for metric in study.metrics}
    for name, values in study.swept.items():
        if len(values) > 1:
            cells = [_answer(found, name, values, metric, changes[metric][name]) for metric in study.metrics]
            yield f"{named[name].title} {named[name].range(values)}", named[name].meaning, cells
    for pair in _pairs(study):
        joint = [metric for metric in study.metrics if pair in _joint(study, found, metric)]
        cells = [_cell(metric, _joint_told(study, found, metric, pair), is_told=True) for metric in joint]
        asked = " × ".join(named[name].title for name in pair)
        told = f"{UNTOLD} from effects that add up, in all scores"
        yield asked, "how much the effect of the first depends on the second", cells or [Cell(told, "untold")]
    if study.printed:
        cells = [_cell(metric, _people_told(study, found, metric), is_told=True) for metric in study.printed.values]
        yield study.printed.source, "where the mean of the sessions is within the 95 % interval of people", cells


def _answer(found: "xarray.Dataset", name: str, values: Sequence[object], metric: str, means: list[Mean]) -> Cell:
    """Answer for one parameter and score."""
    at = _far(values, means)
    told = effect_told(metric, means[at], float(found[metric].isel({name: 0}).mean()))
    if not all(map(is_number, values)) and len(means) > 1 and means[at].samples:
        known = sum(mean.is_told for mean in means)
        told = f"{known} of {len(means)} can be told apart; at {values[at + 1]}, the largest: {told}"
    return _cell(metric, told, is_told=means[at].is_told)


def _joint_told(study: "Study", found: "xarray.Dataset", metric: str, pair: tuple[str, str]) -> str:
    """Where two parameters interact most, and by how much."""
    one, other = (parameters_of(study)[name] for name in pair)
    (far, at), change = interplay(study, found, metric, pair)
    before, values = study.swept[other.name][0], (study.swept[one.name][0], far)
    told = f"the effect of {one.title} {one.range(values)} differs by"
    return f"at {other.title} {other.text(at)} against {other.text(before)} {told} {effect_told(metric, change, 0.0)}"


def _people_told(study: "Study", found: "xarray.Dataset", metric: str) -> str:
    assert study.printed is not None
    means = np.array([mean_of(part[metric].values).value for _, part in conditions(study, found)])
    _, low, high = study.printed.values[metric].T
    known, inside = int(np.isfinite(means).sum()), int(((low <= means) & (means <= high)).sum())
    return f"{inside} of {known} conditions" if known else NO_SCORE


def _cell(metric: str, told: str, *, is_told: bool) -> Cell:
    return Cell(told, "told" if is_told else "untold", score_of(metric, ()).title)


def _pairs(study: "Study") -> list[tuple[str, str]]:
    return list(combinations([name for name, values in study.swept.items() if len(values) > 1], 2))


def _joint(study: "Study", found: "xarray.Dataset", metric: str) -> list[tuple[str, str]]:
    """Pairs of parameters of which one changes the effect of the other on a score."""
    return [pair for pair in _pairs(study) if interplay(study, found, metric, pair).change.is_told]


def _heat(study: "Study", found: "xarray.Dataset", metric: str, pair: tuple[str, str]) -> Figure:
    """Means for each value of two parameters that interact."""
    named, (one, other) = parameters_of(study), pair
    means = found[metric].mean([name for name in (*study.swept, SEED) if name not in pair]).transpose(other, one)
    score = score_of(metric, means.values.ravel().tolist())
    x, y = ([named[name].text(value) for value in study.swept[name]] for name in (one, other))
    trace = {"type": "heatmap", "z": score.factor * means.values, "x": x, "y": y, "colorscale": "Viridis",
             "texttemplate": "%{z:.4g}", "showscale": False}  # fmt: skip
    axes = {"xaxis": axis(named[one].head, type="category"), "yaxis": axis(named[other].head, type="category")}
    title = f"{score.head}: {named[one].title} × {named[other].title}"
    return Figure(title, "Means where one changes the effect of the other.", [trace], axes, 320)


def _tables(study: "Study", found: "xarray.Dataset") -> Iterator[Part]:
    """Folded tables: means of each condition, every difference, and every session."""
    named = parameters_of(study)
    scores = [score_of(metric, found[metric].values.ravel().tolist()) for metric in study.metrics]
    first, last = ([one.head for one in some] for some in (named.values(), scores))
    means, sessions = [], []
    for values, part in conditions(study, found):
        cells = [named[name].text(value) for name, value in values.items()]
        means.append([*cells, *(score.shown(mean_of(part[score.name].values)) for score in scores)])
        for at, seed in enumerate(study.seeds):
            sessions.append([*cells, str(seed), *(score.text(float(part[score.name][at])) for score in scores)])
    yield plain_table([*first, *last], means, "Means with 95 % intervals")
    if rows := list(_differences(study, found)):
        yield plain_table(("score", "parameter", "value", "difference from the first value"), rows, "Every difference")
    if len(sessions) <= _MOST_ROWS:
        yield plain_table([*first, SEED, *last], sessions, "Every session")


def _differences(study: "Study", found: "xarray.Dataset") -> Iterator[list[str]]:
    """Rows of a table: each value of each parameter against its first value, and the largest interactions."""
    named = parameters_of(study)
    for metric in study.metrics:
        title = score_of(metric, ()).title
        for name, changes in differences(study, found, metric).items():
            before = float(found[metric].isel({name: 0}).mean())
            for value, change in zip(study.swept[name][1:], changes, strict=True):
                yield [title, named[name].head, named[name].text(value), effect_told(metric, change, before)]
        for pair in _pairs(study):
            values, change = interplay(study, found, metric, pair)
            heads = " × ".join(named[name].head for name in pair)
            texts = " × ".join(named[name].text(value) for name, value in zip(pair, values, strict=True))
            yield [title, heads, texts, effect_told(metric, change, 0.0)]
