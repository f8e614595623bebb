"""Page: results of experiments as one self-contained HTML file, in the style of the report page."""

import json
from collections.abc import Sequence
from html import escape
from itertools import groupby
from typing import Any

from plotly.offline import get_plotlyjs, get_plotlyjs_version

from teleop_console.report import packing, page_template
from teleop_core.evaluation.figure import Figure, is_against_time
from teleop_lab.experiments.comparison import BASES, Comparison
from teleop_lab.experiments.outcome import MARKS, Outcome, empty, numbers, spread, summary, within

_CLASSES = {True: "met", False: "missed", None: "plain"}
_STYLE = """
table.rows td:first-child { white-space: normal; min-width: 9em; max-width: 22em; }
table.rows td:first-child small { color: var(--soft); display: block; }
td.within { color: var(--soft); font-weight: normal; }
p.note { margin: 6px 0; color: var(--soft); font-size: 0.93rem; }
@media (max-width: 640px) { table.rows td.title { white-space: normal; }
  table.rows .wide { display: none; }
  table.rows td:first-child { min-width: 7em; } }
"""


def experiments_page(outcomes: Sequence[Outcome]) -> str:
    """HTML page with the table and the figures of every experiment.

    The page works offline, because it contains plotly.js.

    Args:
        outcomes: Results of the experiments, in the order of the page.
    """
    arrays, drawn, sections = packing.Arrays(), [], []
    for number, outcome in enumerate(outcomes):
        places = [f"plot-{number}-{i}" for i in range(len(outcome.figures))]
        sections.append(_section(number, outcome, places))
        for place, figure in zip(places, outcome.figures, strict=True):
            traces, layout = arrays.named(figure.traces), arrays.named(figure.layout)
            layout |= {"height": figure.height}
            drawn.append({"id": place, "recording": number, "traces": traces, "layout": layout})
    recordings = [{"duration": _duration(o), "bands": [], "kept": 0} for o in outcomes]
    found = {"recordings": recordings, "arrays": arrays.packed(), "figures": drawn}
    data = json.dumps(found, allow_nan=False)
    return page_template.PAGE.format(
        policy=page_template.POLICY,
        title="Experiments: published and predicted",
        style=page_template.style() + _STYLE,
        body="\n".join((_head(outcomes), *sections)),
        data=data.replace("<", "\\u003c"),  # no text of the data can close the script element
        plotly=packing.deflated(get_plotlyjs().encode()),
        library=f"plotly.js {get_plotlyjs_version()}",
        script=page_template.script(),
    )


def _duration(outcome: Outcome) -> float:
    """Longest time [s] of all figures with a time axis; 1 if there is no such figure."""
    ends = [
        float(trace["x"][-1])
        for figure in outcome.figures
        if is_against_time(figure)
        for trace in figure.traces
        if len(trace.get("x", ()))
    ]
    return max(ends, default=1.0)


def _head(outcomes: Sequence[Outcome]) -> str:
    rows = "".join(
        f'<tr><td><a href="#{escape(o.name)}">{escape(o.name)}</a></td>'
        f'<td class="value {_CLASSES[_verdict(o)]}">{_counts(o)}</td>'
        f'<td class="unit title">{escape(o.title)}</td></tr>'
        for o in outcomes
    )
    head = "<thead><tr><th>experiment</th><th>agree</th><th></th></tr></thead>"
    seeds = sorted({outcome.seed for outcome in outcomes})
    told = f"{summary(outcomes)}; seed {', '.join(map(str, seeds))}."
    return (
        "<h1>Experiments: published and predicted</h1>\n"
        f'<p class="facts">{escape(told)} A mark says whether prediction and publication agree '
        f"within what stands beside them ({MARKS[True]}) or not ({MARKS[False]}), not whether a "
        "number is small.</p>\n"
        f'<div class="card table"><table class="rows">{head}{rows}</table></div>'
    )


def _counts(outcome: Outcome) -> str:
    """Counts of printed values, laws and goals of the experiment; a kind without rows is left out."""
    found = {basis: outcome.count(basis) for basis in BASES}
    return "; ".join(
        f"{kept} of {of}" + f" {basis}s" * (basis != "printed") for basis, (kept, of) in found.items() if of
    )


def _verdict(outcome: Outcome) -> bool | None:
    marks = [row.agrees for row in outcome.rows if row.agrees is not None]
    return all(marks) if marks else None


def _section(number: int, outcome: Outcome, places: Sequence[str]) -> str:
    parts = [
        f'<section><h2 id="{escape(outcome.name)}">{escape(outcome.name)}</h2>',
        f'<p class="facts">{escape(outcome.title)} · {escape(outcome.source)}</p>',
        f'<div class="card table">{_table(outcome)}</div>',
        *(f'<p class="note">{escape(note)}</p>' for note in outcome.notes),
    ]
    if any(map(is_against_time, outcome.figures)):
        parts.append(page_template.TIMES.format(place=f"times-{number}", duration=f"{_duration(outcome):.1f}"))
    parts += [_card(*pair) for pair in zip(outcome.figures, places, strict=True)]
    return "\n".join((*parts, "</section>"))


def _card(figure: Figure, place: str) -> str:
    return (
        f'<figure class="card"><h3>{escape(figure.title)}</h3>'
        f"<figcaption>{escape(figure.sentence)}</figcaption>"
        f'<div id="{place}" class="plot"></div></figure>'
    )


def _table(outcome: Outcome) -> str:
    has_ours = any(row.ours is not None for row in outcome.rows)
    has_spread = any(spread(row) for row in outcome.rows)
    heads = ["published", "predicted", *["seeds"] * has_spread, *["ours"] * has_ours]
    cells = "".join(f"<th{_wide(head == 'seeds')}>{head}</th>" for head in heads)
    lines = [f'<thead><tr><th></th><th></th>{cells}<th>difference</th><th class="wide">within</th></tr></thead>']
    columns = len(heads) + 4
    for group, rows in groupby(outcome.rows, key=lambda row: row.group):
        if group:
            lines.append(f'<tr class="group"><th colspan="{columns}">{escape(group)}</th></tr>')
        lines += [_line(row, has_ours, has_spread) for row in rows]
    return f'<table class="rows">{"".join(lines)}</table>'


def _wide(is_wide: bool) -> str:
    return ' class="wide"' if is_wide else ""


def _line(row: Comparison, has_ours: bool, has_spread: bool) -> str:
    published, predicted, ours, difference = numbers(row)
    note = f"<small>{escape(row.note)}</small>" if row.note else ""
    cells: list[Any] = [
        f"<td>{escape(row.quantity)}{note}</td>",
        f'<td class="unit">{escape(row.unit)}</td>',
        f'<td class="published">{escape(empty(published))}</td>',
        f'<td class="value {_CLASSES[row.agrees]}">{escape(empty(predicted))}</td>',
    ]
    if has_spread:
        cells.append(f'<td class="wide">{escape(spread(row))}</td>')
    if has_ours:
        cells.append(f"<td>{escape(ours)}</td>")
    cells.append(f"<td>{escape(difference)}</td>")
    cells.append(f'<td class="within wide">{escape(within(row))}</td>')
    return f"<tr>{''.join(cells)}</tr>"
