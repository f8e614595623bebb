"""HTML table: scores side by side as markup, for the page and for notebooks."""

from collections.abc import Sequence
from html import escape
from itertools import groupby

from teleop_core.evaluation.published import published_for
from teleop_core.evaluation.rows import Row
from teleop_core.evaluation.score import Score, facts
from teleop_core.evaluation.summary import Line, side_by_side

_CLASSES = {True: "met", False: "missed", None: "plain"}
_MARKS = {True: " ✓", False: " ✗", None: ""}


def html_table(scores: Sequence[Score]) -> str:
    """Table of the page: two columns per score, measured and published."""
    heads, kinds = "", ""
    for score in scores:
        mode = published_for(score.session.gain, score.session.robot, score.session.plant)
        heads += f'<th colspan="2">{escape(score.session.place)}</th>'
        kinds += "<th><small>measured</small></th>"
        kinds += f"<th><small>published{f', {mode.mode}' if mode else ''}</small></th>"
    lines = [f"<thead><tr><th></th><th></th>{heads}</tr><tr><th></th><th></th>{kinds}</tr></thead>"]
    for group, members in groupby(side_by_side(scores), key=lambda line: line.group):
        span = 2 + 2 * len(scores)
        lines.append(f'<tr class="group"><th colspan="{span}">{escape(group)}</th></tr>')
        lines += map(_line, members)
    return "<table>" + "\n".join(lines) + "</table>"


def _line(line: Line) -> str:
    cells = "".join(
        f'<td class="value {_CLASSES[row.is_met]}">{escape(row.value)}</td>'
        f'<td class="published">{escape(row.published)}</td>'
        for row in line.rows
    )
    return f'<tr><td>{escape(line.label)}</td><td class="unit">{escape(line.unit)}</td>{cells}</tr>'


def compact_table(score: Score) -> str:
    """Table for a notebook, which brings no style of its own."""
    session = score.session
    head = f"<b>{escape(session.place)}</b> · {escape(' · '.join(facts(session)))}"
    lines = [f'<tr><th colspan="4" style="text-align:left">{head}</th></tr>']
    for group, members in groupby(side_by_side([score]), key=lambda line: line.group):
        lines.append(f'<tr><th colspan="4" style="text-align:left">{escape(group)}</th></tr>')
        lines += (_compact_line(line.rows[0]) for line in members)
    return "<table>" + "\n".join(lines) + "</table>"


def _compact_line(row: Row) -> str:
    cells = (row.label, row.value + _MARKS[row.is_met], row.unit, row.published)
    return "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"
