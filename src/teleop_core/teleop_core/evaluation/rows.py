"""Rows: table rows of metrics, for one score or several scores, beside the published values."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from teleop_core.evaluation.accumulators import Spread

MISSING = "–"
_LEAST = 1e-9  # smaller numbers are rounding errors


@dataclass(frozen=True)
class TableRow:
    """One row: label, unit, value, published value, and whether both agree.

    Rows of one group are shown together under the group's name. ``is_met`` is True if the value agrees with the
    published value, and None if nothing is compared.
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
    """Row of a number with its published value; with ``agrees``, it also shows whether both agree."""
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

    Agreement is judged only from the root mean square, because a maximum is a single moment of one session.
    """
    rms, largest = figures or (None, None)
    return [
        row(group, f"{label}, RMS", unit, spread.rms, rms, agrees),
        row(group, f"{label}, S.D.", unit, spread.sd),
        row(group, f"{label}, max", unit, spread.max, largest),
    ]


def error_rows(group: str, label: str, unit: str, spread: Spread) -> list[TableRow]:
    """Rows of root mean square and maximum of a spread without published values."""
    return [row(group, f"{label}, RMS", unit, spread.rms), row(group, f"{label}, max", unit, spread.max)]


def number(value: float | None, missing: str = MISSING) -> str:
    """Number as text with four significant digits, at most three of them decimals; ``missing`` for None.

    Values below 0.1 have two significant digits; values that are only rounding errors are shown as 0.
    """
    if value is None:
        return missing
    size = abs(value)
    if _LEAST < size < 0.0995:
        return f"{value:#.2g}"
    return fixed(value, 3 if size < 9.9995 else 2 if size < 99.995 else 1 if size < 999.95 else 0)


def fixed(value: float, decimals: int) -> str:
    """Text with a given number of decimals, without a minus sign if all digits are zero."""
    return f"{value:z.{decimals}f}"


_NOTHING = {MISSING, "0/0/0", "0, 0", "0/0"}
"""Texts of values without information."""


class TableLine(NamedTuple):
    """One line of a table: group, label and unit, and one row per score."""

    group: str
    label: str
    unit: str
    rows: tuple[TableRow, ...]


def side_by_side(tables: Sequence[Sequence[TableRow]]) -> list[TableLine]:
    """Lines of a table that shows the rows of several scores side by side; a dash means that a score lacks the row.

    A line is left out if it shows only dashes, or only delays of zero, as in virtual time.
    """
    found = [{(row.group, row.label, row.unit): row for row in rows} for rows in tables]
    places = dict.fromkeys(place for rows in found for place in rows)
    lines = [
        TableLine(*place, tuple(rows.get(place) or TableRow(*place, MISSING) for rows in found)) for place in places
    ]
    return [line for line in lines if any(row.value not in _NOTHING for row in line.rows)]


def is_compared(lines: Sequence[TableLine]) -> bool:
    """Whether any line shows a published value."""
    return any(row.published for line in lines for row in line.rows)
