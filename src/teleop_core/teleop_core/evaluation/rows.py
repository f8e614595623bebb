"""Rows: what tables show of metrics, of one score or of several, beside the published figures."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from teleop_core.evaluation.accumulators import Spread

if TYPE_CHECKING:
    from teleop_core.evaluation.score import Score

MISSING = "–"
_LEAST = 1e-9  # a number below it is rounding


@dataclass(frozen=True)
class TableRow:
    """One row: what it is, its unit, the value, the published value, and whether both agree.

    Rows of one group stand together under its name. ``is_met`` says whether the value agrees with
    what was published; None where nothing is compared.
    """

    group: str
    label: str
    unit: str
    value: str
    published: str = ""
    is_met: bool | None = None


def row(
    group: str, label: str, unit: str, value: float | None, published: float | None = None, agrees: bool | None = None
) -> TableRow:
    """Row of a number, beside what was published, and whether both agree if that is asked."""
    return TableRow(group, label, unit, number(value), number(published, ""), agrees)


def spread_rows(
    group: str,
    label: str,
    unit: str,
    spread: Spread,
    figures: tuple[float, float] | None = None,
    agrees: bool | None = None,
) -> list[TableRow]:
    """Three rows of a spread; ``figures`` are the published root mean square and maximum.

    Agreement is judged of the root mean square alone: a maximum is one moment of one session.
    """
    rms, largest = figures or (None, None)
    return [
        row(group, f"{label}, RMS", unit, spread.rms, rms, agrees),
        row(group, f"{label}, S.D.", unit, spread.sd),
        row(group, f"{label}, max", unit, spread.max, largest),
    ]


def error_rows(group: str, label: str, unit: str, spread: Spread) -> list[TableRow]:
    """Root mean square and maximum of a spread of which nothing was published."""
    return [row(group, f"{label}, RMS", unit, spread.rms), row(group, f"{label}, max", unit, spread.max)]


def number(value: float | None, missing: str = MISSING) -> str:
    """Text with four significant digits, at most three of them decimals; ``missing`` for None.

    Values below 0.1 have two significant digits, and what rounds to nothing is 0.
    """
    if value is None:
        return missing
    size = abs(value)
    if _LEAST < size < 0.0995:
        return f"{value:#.2g}"
    return fixed(value, 3 if size < 9.9995 else 2 if size < 99.995 else 1 if size < 999.95 else 0)


def fixed(value: float, decimals: int) -> str:
    """Text with so many decimals, and without a minus sign where they are all zero."""
    return f"{value:z.{decimals}f}"


_NOTHING = {MISSING, "0/0/0", "0, 0", "0/0"}
"""Values that say nothing."""


class Line(NamedTuple):
    """One line of a table: group, label and unit, and one row per score."""

    group: str
    label: str
    unit: str
    rows: tuple[TableRow, ...]


def summary(score: "Score") -> list[TableRow]:
    """Rows of a score; those of one group stand together, where its first row stands."""
    groups: dict[str, list[TableRow]] = {}
    for result in score.results:
        for row in result.rows:
            groups.setdefault(row.group, []).append(row)
    return [row for rows in groups.values() for row in rows]


def side_by_side(scores: "Sequence[Score]") -> list[Line]:
    """Lines of a table of several scores; a row that a score lacks is a dash.

    Lines that say nothing of any of them are left out: dashes, and delays of nothing, as in virtual time.
    """
    found = [{_place(row): row for row in summary(score)} for score in scores]
    places = dict.fromkeys(place for rows in found for place in rows)
    lines = [Line(*place, tuple(rows.get(place) or TableRow(*place, MISSING) for rows in found)) for place in places]
    return [line for line in lines if any(row.value not in _NOTHING for row in line.rows)]


def is_compared(lines: Sequence[Line]) -> bool:
    """Whether a published figure stands beside any value."""
    return any(row.published for line in lines for row in line.rows)


def _place(row: TableRow) -> tuple[str, str, str]:
    return row.group, row.label, row.unit
