"""Page: a search as one HTML file: its design, the best values, and what cannot be told apart from them."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from teleop_console.report.pages import Cell, Listed, Section, page, plain_table
from teleop_core.evaluation.figure import FIRST, SURROUNDING, Figure, axis, intervals
from teleop_lab.studies.answers import UNTOLD, Quantity, parameters_of, score_of
from teleop_lab.studies.study import SEED, is_number
from teleop_lab.studies.study_page import seed_boxes
from teleop_lab.studies.summary import mean_of
from teleop_lab.studies.tuning import SearchRange

if TYPE_CHECKING:
    from teleop_lab.studies.tuning import Trial, Tuned, Tuning

_ABOUT = (
    "Seeds are paired. With 95 % certainty the truly best of the tried values is among those that cannot be told apart "
    "(comparisons with the best, Hsu 1981). The score of the best trial is flattered, because it is the best of many."
)


def tuning_page(tuning: "Tuning", tuned: "Tuned", title: str) -> str:
    """HTML page of a search; it works offline, with plotly.js inside."""
    named = parameters_of(tuning.study())
    scores = [score for trial in tuned.trials for score in trial.scores]
    score = score_of(tuning.metric, scores)
    count = f"{len(tuned.trials)} trials × {len(tuning.seeds)} = {len(tuned.trials) * len(tuning.seeds)} sessions"
    rows = [(one.head, f"{name}: {one.meaning}", _boxes(tuning, name, one)) for name, one in named.items()]
    rows.append((SEED, "the score of a trial is the mean over them", seed_boxes(tuning.seeds)))
    rows.append(("trials", "each chosen by the scores of earlier ones", [Cell(count)]))
    sections = [
        Section("Answers", _ABOUT, [Listed([_best_told(tuning, tuned)])]),
        Section("Trials", "Grey: can be told apart from the best trial.", list(_figures(tuning, tuned, score))),
        Section("Numbers", parts=[plain_table(*_table(tuned, named, score), "Every trial")]),
    ]
    return page(title, [Listed(rows, are_boxes=True)], sections)


def _best_told(tuning: "Tuning", tuned: "Tuned") -> tuple[str, str, list[Cell]]:
    """The best values in words, and those that cannot be told apart from them."""
    named = parameters_of(tuning.study())
    score = score_of(tuning.metric, tuned.best.scores)
    best = ", ".join(one.told(_short(tuned.best.values[name])) for name, one in named.items())
    kind = "largest" if tuning.is_largest else "smallest"
    shown = f"{score.shown(mean_of(np.array(tuned.best.scores)))} {score.unit}".strip()
    return (
        f"{kind} {score.title}",
        score.meaning,
        [Cell(f"{best}: {shown}", "told"), Cell(tuned.told(score.title), "untold")],
    )


def _short(value: Any) -> Any:
    """A number with four digits; other values as they are."""
    return float(f"{value:.4g}") if is_number(value) else value


def _boxes(tuning: "Tuning", name: str, one: Quantity) -> list[Cell]:
    where = tuning.searched[name]
    if isinstance(where, SearchRange):
        return [Cell(f"{one.text(where.low)} to {one.text(where.high)}{', equal ratios' * where.is_log}")]
    return [Cell(one.text(value)) for value in where]


def _figures(tuning: "Tuning", tuned: "Tuned", score: Quantity) -> Iterator[Figure]:
    """Scores with intervals over each parameter."""
    equal = {id(trial) for trial in tuned.alike}
    groups: list[tuple[str, str, list[Trial]]] = [
        ("can be told apart", SURROUNDING, [one for one in tuned.trials if one.scores and id(one) not in equal]),
        (UNTOLD, FIRST, [one for one in tuned.trials if id(one) in equal]),
    ]
    for name, one in parameters_of(tuning.study()).items():
        traces = []
        for told, color, trials in groups:
            values: list[Any] = [trial.values[name] for trial in trials]
            x = [v * one.factor if is_number(v) else str(v) for v in values]
            means = score.factor * np.array([mean_of(np.array(trial.scores))[:3] for trial in trials])
            trace = intervals(np.empty(0), means, told, color, score.unit)
            traces.append(trace | {"mode": "markers", "x": x, "showlegend": True})
        where = tuning.searched[name]
        is_log = isinstance(where, SearchRange) and where.is_log
        kind = {"type": "log", "tickvals": [n * 10.0**e for e in range(-9, 10) for n in (1, 2, 5)]} if is_log else {}
        layout = {"xaxis": axis(one.title, one.unit, **kind), "yaxis": axis(score.title, score.unit)}
        yield Figure(f"{score.title} over {one.title}", one.meaning, traces, layout, 320)


def _table(tuned: "Tuned", named: dict[str, Quantity], score: Quantity) -> tuple[list[str], list[list[str]]]:
    rows = []
    for number, trial in enumerate(tuned.trials, 1):
        values = [one.text(_short(trial.values[name])) for name, one in named.items()]
        rows.append([str(number), *values, score.shown(mean_of(np.array(trial.scores))), trial.error])
    return ["trial", *(one.head for one in named.values()), score.head, "error"], rows
