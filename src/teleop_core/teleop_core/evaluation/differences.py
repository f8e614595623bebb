"""Differences: the rows in which scores differ, the largest difference first."""

import math
from collections.abc import Sequence

from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from teleop_core.base.texts import printable
from teleop_core.evaluation.rows import MISSING, TableLine, side_by_side
from teleop_core.evaluation.score import Score
from teleop_core.evaluation.score_table import heading


def difference_table(scores: Sequence[Score]) -> Table:
    """Table of the rows that differ; each further score has its change from the first one.

    Args:
        scores: At least two scores.
    """
    lines = side_by_side([score.rows for score in scores])
    found = sorted((line for line in lines if len({row.value for row in line.rows}) > 1), key=_size, reverse=True)
    told = f"{len(lines) - len(found)} of {len(lines)} rows are equal and left out"
    table = Table(box=SIMPLE, caption=told, caption_justify="left", pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("largest difference first")
    for score in scores:
        table.add_column(escape(printable(heading(score.session))), no_wrap=True)
    for line in found:
        first, *others = (row.value for row in line.rows)
        label = f"{line.group}: {line.label} {line.unit}"
        table.add_row(escape(label), escape(first), *(escape(_told(first, other)) for other in others))
    return table


def _told(first: str, other: str) -> str:
    change = _change(first, other)
    return other if change is None or not math.isfinite(change) else f"{other} ({change:+.0%})"


def _size(line: TableLine) -> float:
    """Largest change of a line; words that differ come first, then values that only some scores have."""
    first, *others = (row.value for row in line.rows)
    changes = [_change(first, other) for other in others if other != first]
    if None in changes:
        return math.inf if MISSING not in (first, *others) else 1e300
    return max(abs(change) for change in changes if change is not None)


def _change(first: str, other: str) -> float | None:
    """Change of a number relative to the first one; infinite from zero, None if one of them is no number."""
    try:
        a, b = float(first), float(other)
    except ValueError:
        return None
    return (b - a) / abs(a) if a else math.inf * (b - a) if b else 0.0
