"""Summary: the rows of all metrics, of one score or of several side by side."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from teleop_core.evaluation.rows import MISSING, Row

if TYPE_CHECKING:
    from teleop_core.evaluation.score import Score

_NOTHING = {MISSING, "0/0/0", "0, 0", "0/0"}
"""Values that say nothing."""


class Line(NamedTuple):
    """One line of a table: group, label and unit, and one row per score."""

    group: str
    label: str
    unit: str
    rows: tuple[Row, ...]


def summary(score: "Score") -> list[Row]:
    """Rows of a score; those of one group stand together, where its first row stands."""
    groups: dict[str, list[Row]] = {}
    for result in score.results:
        for row in result.rows:
            groups.setdefault(row.group, []).append(row)
    return [row for rows in groups.values() for row in rows]


def side_by_side(scores: "Sequence[Score]") -> list[Line]:
    """Lines of a table of several scores; a row that a score lacks is a dash.

    Lines that say nothing of any of them are left out: dashes, and delays of nothing, as in virtual
    time.
    """
    found = [{_place(row): row for row in summary(score)} for score in scores]
    places = dict.fromkeys(place for rows in found for place in rows)
    lines = [
        Line(*place, tuple(rows.get(place) or Row(*place, MISSING) for rows in found))
        for place in places
    ]
    return [line for line in lines if any(row.value not in _NOTHING for row in line.rows)]


def is_compared(lines: Sequence[Line]) -> bool:
    """Whether a published figure stands beside any value."""
    return any(row.published for line in lines for row in line.rows)


def _place(row: Row) -> tuple[str, str, str]:
    return row.group, row.label, row.unit
