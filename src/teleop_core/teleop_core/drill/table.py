"""Table of a drill: a row for each fault."""

import math
from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from teleop_core.drill.exercise import Cure, Motion
from teleop_core.drill.outcome import Outcome

_COLUMNS = (
    ("fault", "left"), ("detected after, ms", "right"), ("state", "left"),
    ("travel of the tip, mm", "right"), ("step / limit", "right"), ("recording", "left"),
    ("recovered after, s", "left"), ("", "center"),
)  # fmt: skip


def rows(outcomes: Sequence[Outcome]) -> list[list[str]]:
    """Cells of each outcome, in the order of the columns."""
    return [_row(outcome) for outcome in outcomes]


def drill_table(outcomes: Sequence[Outcome]) -> Table:
    """The table for a terminal."""
    table = Table(title="drill", title_justify="left")
    for name, side in _COLUMNS:
        table.add_column(name, justify=side)  # type: ignore[arg-type]
    for row in rows(outcomes):
        table.add_row(*map(escape, row))
    return table


def markdown(outcomes: Sequence[Outcome]) -> str:
    """The table for a document."""
    head = [name for name, _ in _COLUMNS]
    lines = [head, ["---"] * len(head), *rows(outcomes)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """What the table does not say: times of stops, the load, and what is not as expected."""
    lines = []
    for outcome in outcomes:
        name, extra = outcome.exercise.name, outcome.extra
        if "stop_s_median" in extra and name.startswith("stop_") and extra["repeats"] > 1:
            stop = f"{1e3 * extra['stop_s_median']:.1f} ms, at most {1e3 * extra['stop_s']:.1f} ms"
            rest = f"{1e3 * extra.get('rest_s_median', math.nan):.0f} ms"
            text = f"{name}: zero speed after {stop} ({extra['repeats']:.0f} times), rest after"
            lines.append(f"{text} {rest}")
    failed = [outcome for outcome in outcomes if outcome.failures()]
    for outcome in failed:
        lines.append(f"✗ {outcome.exercise.name}: {'; '.join(outcome.failures())}")
    load = max((outcome.load for outcome in outcomes), default=0.0)
    passed = len(outcomes) - len(failed)
    lines.append(f"{passed} of {len(outcomes)} as expected; load of the machine up to {load:.1f}")
    return lines


def _row(outcome: Outcome) -> list[str]:
    return [
        outcome.exercise.text,
        _number(1e3 * outcome.detected, 0),
        outcome.state_text,
        _travel(outcome),
        f"{outcome.ratio:.3f}",
        outcome.recording,
        _recovered(outcome),
        "✗" if outcome.failures() else "✓",
    ]


def _travel(outcome: Outcome) -> str:
    if outcome.exercise.motion is Motion.GOES_ON:
        return f"goes on ({_number(1e3 * outcome.travel, 1)})"
    return f"{_number(1e3 * outcome.travel, 1)} of {_number(1e3 * outcome.bound, 1)}"


def _recovered(outcome: Outcome) -> str:
    if math.isnan(outcome.recovered):
        return "never"
    if outcome.cure is Cure.NOTHING and outcome.recovered < 0.1:
        return "at once"
    return f"{outcome.recovered:.1f}, {outcome.cure.value}"


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"
