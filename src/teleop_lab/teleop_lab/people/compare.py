"""Compare: scores of people as a data set like a study's, and a comparison with the simulated operator."""

from typing import TYPE_CHECKING, Any

import numpy as np

from teleop_console.report.pages import Part, Section, Text, page, plain_table
from teleop_lab.people.journal import DONE, Journal
from teleop_lab.people.plan import Plan
from teleop_lab.studies.dataset import swept_coordinates, units_of_scores
from teleop_lab.studies.means import condition_figure
from teleop_lab.studies.summary import Mean, apart, conditions, differences, median_of, table_text

if TYPE_CHECKING:
    import xarray

PARTICIPANT = "participant"
_HEADS = ("people", "simulated operator", "people − simulated")
_ABOUT = (
    "Medians over participants and over seeds, a participant's value being the mean of the trials that count. "
    "Intervals of 95 % by the bootstrap (Efron 1979). Changes are means within each participant, and within each seed, "
    "with intervals by Student."
)


def people_dataset(plan: Plan, journal: Journal) -> "xarray.Dataset":
    """Scores of people in the form of :meth:`Study.run`, with the dimension ``participant`` instead of the seed.

    A value is the mean over the valid trials without practice trials; NaN if there is no such trial. Each question is a
    variable with values from 0 to 100. The variable ``trials`` is the number of trials that were done.
    """
    import xarray

    study = plan.study
    sizes = [*(len(values) for values in study.swept.values()), len(plan.codes)]
    asked = [question.name for question in plan.questions]
    places = dict[tuple[int, str], list[dict[str, Any]]]()
    for code in plan.codes:
        for trial in plan.trials(code):
            event = journal.event(code, trial.number)
            if trial.repetition and event.get("state") == DONE:
                found = {**event.get("scores", {}), **journal.answers(code, trial.number)}
                places.setdefault((trial.condition, code), []).append(found)
    units = units_of_scores()
    names, variables = (*study.swept, PARTICIPANT), dict[str, Any]()
    every = [(index, code) for index in range(int(np.prod(sizes[:-1]))) for code in plan.codes]
    for name in (*study.metrics, *asked):
        values = [_mean([trial.get(name) for trial in places.get(place, [])]) for place in every]
        variables[name] = (names, np.array(values).reshape(sizes), {"units": units.get(name, "1")})
    variables["trials"] = (names, np.array([len(places.get(p, [])) for p in every]).reshape(sizes), {})
    coordinates = swept_coordinates(study.swept)
    coordinates[PARTICIPANT] = list(plan.codes)
    return xarray.Dataset(variables, coordinates, {"scenario": study.scenario or "", "study": plan.people.title})


def _mean(values: list[float | None]) -> float:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else float("nan")


def compared(
    plan: Plan, people: "xarray.Dataset", simulated: "xarray.Dataset", metric: str
) -> list[tuple[str, Mean, Mean, Mean]]:
    """Return for each condition: name, median of people, median of the simulated operator, and difference."""
    found = []
    pairs = zip(conditions(plan.study, people), conditions(plan.study, simulated), strict=True)
    for (values, theirs), (_, its) in pairs:
        name = ", ".join(f"{key}={value}" for key, value in values.items()) or "all"
        one, other = theirs[metric].values, its[metric].values
        found.append((name, median_of(one), median_of(other), apart(one, other)))
    return found


def comparison_table(plan: Plan, people: "xarray.Dataset", simulated: "xarray.Dataset") -> str:
    """Table that compares people with the simulated operator, as text."""
    rows = []
    for metric in plan.study.metrics:
        rows += [[metric, row[0], *map(str, row[1:])] for row in compared(plan, people, simulated, metric)]
    taken = int((people["trials"].sum([d for d in people["trials"].dims if d != PARTICIPANT]) > 0).sum())
    return f"{table_text(('score', 'condition', *_HEADS), rows)}\n{taken} of {len(plan.codes)} participants"


def comparison_page(plan: Plan, people: "xarray.Dataset", simulated: "xarray.Dataset") -> str:
    """HTML page of this comparison, with plots, paired differences and answers; it works offline."""
    both = {"people": people, "simulated operator": simulated}
    sections = []
    for metric in plan.study.metrics:
        rows = [[row[0], *map(str, row[1:])] for row in compared(plan, people, simulated, metric)]
        parts: list[Part] = [plain_table((metric, *_HEADS), rows)]
        if plan.study.swept:
            heads = (f"change of {metric}", "against the first", *_HEADS[:2])
            parts.append(condition_figure(plan.study, both, metric, median_of))
            parts.append(plain_table(heads, _changes(plan, both, metric)))
        sections.append(Section(metric, parts=parts))
    asked = [question.name for question in plan.questions]
    if asked:
        rows = [
            [
                ", ".join(f"{k}={v}" for k, v in values.items()) or "all",
                *(str(median_of(part[n].values)) for n in asked),
            ]
            for values, part in conditions(plan.study, people)
        ]
        sections.append(Section("Questions", parts=[plain_table(("medians of people, 0 to 100", *asked), rows)]))
    return page(plan.people.title, [Text(_ABOUT)], sections)


def _changes(plan: Plan, both: "dict[str, xarray.Dataset]", metric: str) -> list[list[str]]:
    found = [differences(plan.study, data, metric) for data in both.values()]
    return [
        [name, str(value), *(str(changes[name][i]) for changes in found)]
        for name, values in plan.study.swept.items()
        for i, value in enumerate(values[1:])
    ]
