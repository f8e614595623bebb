"""Page: results of experiments as one self-contained HTML file."""

from collections.abc import Sequence

from teleop_console.report.pages import Cell, Part, Section, Table, Text, page
from teleop_core.evaluation.figure import is_against_time
from teleop_lab.experiments.comparison import BASES, Comparison
from teleop_lab.experiments.outcome import MARKS, Outcome, empty, numbers, spread, summary, within

_KINDS = {True: "value met", False: "value missed", None: "value plain"}


def experiments_page(outcomes: Sequence[Outcome]) -> str:
    """HTML page with the table and the figures of every experiment.

    The page works offline, because it contains plotly.js.

    Args:
        outcomes: Results of the experiments, in the order of the page.
    """
    seeds = sorted({outcome.seed for outcome in outcomes})
    told = (
        f"{summary(outcomes)}; seed {', '.join(map(str, seeds))}. A mark says whether prediction and publication agree "
        f"within what stands beside them ({MARKS[True]}) or not ({MARKS[False]}), not whether a number is small."
    )
    heads = [Cell("experiment"), Cell("agree"), Cell()]
    rows = [
        ("", [Cell(o.name, link=f"#{o.name}"), Cell(_counts(o), _KINDS[_verdict(o)]), Cell(o.title, "unit title")])
        for o in outcomes
    ]
    title = "Experiments: published and predicted"
    return page(title, [Text(told), Table([heads], rows)], [_section(outcome) for outcome in outcomes])


def _duration(outcome: Outcome) -> float:
    """Longest time [s] of all figures with a time axis; 1 if there is no such figure."""
    ends = [
        float(trace["x"][-1])
        for figure in outcome.figures
        if is_against_time(figure)
        for trace in figure.traces
        if len(trace.get("x", ()))
    ]
    return max(ends, default=1.0)


def _counts(outcome: Outcome) -> str:
    """Counts of printed values, laws and goals of the experiment; a kind without rows is left out."""
    found = {basis: outcome.count(basis) for basis in BASES}
    return "; ".join(
        f"{kept} of {of}" + f" {basis}s" * (basis != "printed") for basis, (kept, of) in found.items() if of
    )


def _verdict(outcome: Outcome) -> bool | None:
    marks = [row.agrees for row in outcome.rows if row.agrees is not None]
    return all(marks) if marks else None


def _section(outcome: Outcome) -> Section:
    parts: list[Part] = [_table(outcome), *map(Text, outcome.notes), *outcome.figures]
    told = f"{outcome.title} · {outcome.source}"
    return Section(outcome.name, told, parts, outcome.name, duration_s=_duration(outcome))


def _table(outcome: Outcome) -> Table:
    has_ours = any(row.ours is not None for row in outcome.rows)
    has_spread = any(spread(row) for row in outcome.rows)
    heads = [Cell(), Cell(), Cell("published"), Cell("predicted"), *[Cell("seeds", "wide")] * has_spread]
    heads += [*[Cell("ours")] * has_ours, Cell("difference"), Cell("within", "wide")]
    return Table([heads], [(row.group, _line(row, has_ours, has_spread)) for row in outcome.rows])


def _line(row: Comparison, has_ours: bool, has_spread: bool) -> list[Cell]:
    published, predicted, ours, difference = numbers(row)
    return [
        Cell(row.quantity, note=row.note),
        Cell(row.unit, "unit"),
        Cell(empty(published), "published"),
        Cell(empty(predicted), _KINDS[row.agrees]),
        *[Cell(spread(row), "wide")] * has_spread,
        *[Cell(ours)] * has_ours,
        Cell(difference),
        Cell(within(row), "within wide"),
    ]
