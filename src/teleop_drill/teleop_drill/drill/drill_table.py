"""Table of a drill: a row for each fault."""

import math
from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from teleop_drill.drill.exercise import AllowedMotion, Cure
from teleop_drill.drill.outcome import FaultOutcome

_COLUMNS = (
    ("fault", "left"),
    ("detected after, ms", "right"),
    ("state", "left"),
    ("travel of the tip, mm", "right"),
    ("step / limit", "right"),
    ("recording", "left"),
    ("recovered after, s", "left"),
    ("", "center"),
)


def rows(outcomes: Sequence[FaultOutcome]) -> list[list[str]]:
    """Cells of each outcome, in the order of the columns."""
    return [_row(outcome) for outcome in outcomes]


def drill_table(outcomes: Sequence[FaultOutcome]) -> Table:
    """The table for a terminal."""
    table = Table(title="drill", title_justify="left")
    for name, side in _COLUMNS:
        table.add_column(name, justify=side)  # type: ignore[arg-type]
    for row in rows(outcomes):
        table.add_row(*map(escape, row))
    return table


def markdown(outcomes: Sequence[FaultOutcome]) -> str:
    """The table for a document."""
    head = [name for name, _ in _COLUMNS]
    lines = [head, ["---"] * len(head), *rows(outcomes)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def summary(outcomes: Sequence[FaultOutcome]) -> list[str]:
    """Text below the table: the stopping times, the load of the machine, and all unexpected results."""
    lines = []
    for outcome in outcomes:
        name, extra = outcome.exercise.name, outcome.extra
        if name.startswith("stop_") and extra.get("repeats", 1) > 1:
            still = f"{1e3 * extra['still_s_median']:.1f} ms, median of {extra['repeats']:.0f}"
            rest = f"the tip at rest after {1e3 * extra['rest_s_median']:.0f} ms"
            lines.append(f"{name}: zero speed after {still}; {rest}")
    failed = [outcome for outcome in outcomes if outcome.failures()]
    for outcome in failed:
        lines.append(f"✗ {outcome.exercise.name}: {'; '.join(outcome.failures())}")
    load = max((outcome.load for outcome in outcomes), default=0.0)
    passed = len(outcomes) - len(failed)
    lines.append(f"{passed} of {len(outcomes)} as expected; load of the machine up to {load:.1f}")
    return lines


def _row(outcome: FaultOutcome) -> list[str]:
    return [
        outcome.exercise.text,
        _number(1e3 * outcome.detected, 0),
        outcome.state_text,
        _travel(outcome),
        _number(outcome.measured("step_ratio").value, 3),
        outcome.recording,
        _recovered(outcome),
        "✗" if outcome.failures() else "✓",
    ]


def _travel(outcome: FaultOutcome) -> str:
    found = outcome.measured("travel_m")
    if outcome.exercise.motion is AllowedMotion.LED:
        return "is led"
    goes = "goes on, " if outcome.exercise.motion is AllowedMotion.GOES_ON else ""
    return f"{goes}{_number(1e3 * found.value, 1)} of {_number(1e3 * found.most, 1)}"


def _recovered(outcome: FaultOutcome) -> str:
    if math.isnan(outcome.recovered):
        return "never"
    if outcome.cure is Cure.NOTHING and outcome.recovered < 0.1:
        return "at once"
    return f"{outcome.recovered:.1f}, {outcome.cure.value}"


def _number(value: float, digits: int) -> str:
    return "–" if not math.isfinite(value) else f"{value:.{digits}f}"
