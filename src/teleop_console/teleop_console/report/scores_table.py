"""Table of the report: scores side by side, with published numbers."""

from collections.abc import Sequence
from html import escape
from itertools import groupby

from teleop_core.evaluation.published import published_for
from teleop_core.evaluation.rows import Line, side_by_side
from teleop_core.evaluation.score import Score

_CLASSES = {True: "met", False: "missed", None: "plain"}


def html_table(scores: Sequence[Score]) -> str:
    """HTML table with a column for each score, and a second column for its published numbers if there are any."""
    found = side_by_side([score.rows for score in scores])
    columns = list(zip(*(line.rows for line in found), strict=True))
    are_compared = [any(row.published for row in rows) for rows in columns]
    heads, kinds = "", ""
    for score, is_beside in zip(scores, are_compared, strict=False):
        mode = published_for(score.session.gain, score.session.robot, score.session.plant)
        heads += f'<th colspan="{1 + is_beside}">{escape(score.session.place)}</th>'
        kinds += "<th><small>measured</small></th>"
        kinds += f"<th><small>published{f', {mode.mode}' if mode else ''}</small></th>" * is_beside
    lines = [f"<thead><tr><th></th><th></th>{heads}</tr><tr><th></th><th></th>{kinds}</tr></thead>"]
    for group, members in groupby(found, key=lambda line: line.group):
        span = 2 + len(scores) + sum(are_compared)
        lines.append(f'<tr class="group"><th colspan="{span}">{escape(group)}</th></tr>')
        lines += (_line(line, are_compared) for line in members)
    return "<table>" + "\n".join(lines) + "</table>"


def _line(line: Line, are_compared: Sequence[bool]) -> str:
    cells = "".join(
        f'<td class="value {_CLASSES[row.is_met]}">{escape(row.value)}</td>'
        + f'<td class="published">{escape(row.published)}</td>' * is_beside
        for row, is_beside in zip(line.rows, are_compared, strict=True)
    )
    return f'<tr><td>{escape(line.label)}</td><td class="unit">{escape(line.unit)}</td>{cells}</tr>'
