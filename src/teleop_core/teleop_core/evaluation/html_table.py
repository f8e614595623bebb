"""HTML table: the rows of a score, for notebooks."""

from collections.abc import Sequence
from html import escape
from itertools import groupby

from teleop_core.evaluation.rows import TableRow, side_by_side

_MARKS = {True: " ✓", False: " ✗", None: ""}


def compact_table(title: str, facts: Sequence[str], verdict: str, rows: Sequence[TableRow]) -> str:
    """Table of the rows of one score, without a style sheet, below a title, facts and a verdict."""
    head = f"<b>{escape(title)}</b> · {escape(' · '.join(facts))}"
    lines = [f'<tr><th colspan="4" style="text-align:left">{head}<br>{escape(verdict)}</th></tr>']
    for group, members in groupby(side_by_side([rows]), key=lambda line: line.group):
        lines.append(f'<tr><th colspan="4" style="text-align:left">{escape(group)}</th></tr>')
        lines += (_compact_line(line.rows[0]) for line in members)
    return "<table>" + "\n".join(lines) + "</table>"


def _compact_line(row: TableRow) -> str:
    cells = (row.label, row.value + _MARKS[row.is_met], row.unit, row.published)
    return "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"
