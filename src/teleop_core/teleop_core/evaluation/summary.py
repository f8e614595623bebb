"""Summary: the rows of all metrics, of one score or of several side by side."""

from collections.abc import Sequence
from typing import NamedTuple

from teleop_core.evaluation.rows import MISSING, Row
from teleop_core.evaluation.score import Score


class Line(NamedTuple):
    """One line of a table: group, label and unit, and one row per score."""

    group: str
    label: str
    unit: str
    rows: tuple[Row, ...]


def summary(score: Score) -> list[Row]:
    """Rows of a score; those of one group stand together, where its first row stands."""
    groups: dict[str, list[Row]] = {}
    for result in score.results:
        for row in result.rows:
            groups.setdefault(row.group, []).append(row)
    return [row for rows in groups.values() for row in rows]


def side_by_side(scores: Sequence[Score]) -> list[Line]:
    """Lines of a table of several scores; a row that a score lacks is a dash."""
    found = [{_place(row): row for row in summary(score)} for score in scores]
    places = dict.fromkeys(place for rows in found for place in rows)
    return [
        Line(*place, tuple(rows.get(place) or Row(*place, MISSING) for rows in found))
        for place in places
    ]


def _place(row: Row) -> tuple[str, str, str]:
    return row.group, row.label, row.unit
