"""Page: scores and plots of recordings as one self-contained HTML file."""

import base64
import json
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from plotly.offline import get_plotlyjs

from teleop_core.evaluation.figure import Figure
from teleop_core.evaluation.figures import figures
from teleop_core.evaluation.metrics import Study
from teleop_core.evaluation.page_template import PAGE, POLICY, SCRIPT, STYLE
from teleop_core.evaluation.published import SOURCE, published_for
from teleop_core.evaluation.score import Score, Session
from teleop_core.evaluation.summary import summary

_CLASSES = {True: "met", False: "missed", None: "plain"}


def report_page(studies: Sequence[Study]) -> str:
    """HTML page with the summary of all recordings and the plots of each.

    It works offline and asks for nothing: plotly.js is inside, once. Texts from recordings are
    escaped.
    """
    sections, drawn, arrays = [], [], _Arrays()
    for number, study in enumerate(studies):
        plots = figures(study)
        places = [f"plot-{number}-{i}" for i in range(len(plots))]
        sections.append(_section(f"recording-{number}", study, plots, places))
        for place, plot in zip(places, plots, strict=True):
            traces = [arrays.named(trace) for trace in plot.traces]
            layout = {**plot.layout, "height": plot.height}
            drawn.append({"id": place, "traces": traces, "layout": layout})
    data = json.dumps({"arrays": arrays.texts, "figures": drawn}, allow_nan=False)
    scores = [study.score for study in studies]
    return PAGE.format(
        policy=POLICY,
        title=escape("Teleoperation: " + ", ".join(score.session.title for score in scores)),
        style=STYLE,
        body="\n".join((_header(scores), _table(scores), *sections)),
        data=data.replace("<", "\\u003c"),  # nothing inside can end the script element
        plotly=get_plotlyjs().replace("</script", "<\\/script"),
        script=SCRIPT,
    )


class _Arrays:
    """Arrays of a page, each encoded once."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._places: dict[bytes, int] = {}

    def named(self, trace: dict[str, Any]) -> dict[str, Any]:
        """The trace with places in the list instead of arrays."""
        return {
            key: self._place(value) if isinstance(value, np.ndarray) else value
            for key, value in trace.items()
        }

    def _place(self, array: "np.ndarray[Any, Any]") -> int:
        data = array.astype("<f4").tobytes()
        if data not in self._places:
            self._places[data] = len(self.texts)
            self.texts.append(base64.b64encode(data).decode("ascii"))
        return self._places[data]


def facts(session: Session) -> str:
    """Scenario, robot, seed, duration and gain in one line."""
    found = [
        session.scenario and f"scenario {session.scenario}",
        session.robot and f"robot {session.robot}",
        None if session.seed is None else f"seed {session.seed}",
        f"{session.duration_s:.1f} s",
        None if session.gain is None else f"gain {session.gain:g}",
    ]
    return " · ".join(fact for fact in found if fact)


def _header(scores: Sequence[Score]) -> str:
    links = "".join(
        f'<a href="#recording-{i}">{escape(score.session.name)}</a>'
        for i, score in enumerate(scores)
    )
    return (
        "<h1>Teleoperation report</h1>\n"
        f'<p class="facts">Scores beside the published figures of the RCRT-1 ({escape(SOURCE)}), '
        "presumably taken against the filtered reference too.</p>\n"
        f"<nav>{links}</nav>"
    )


def _section(anchor: str, study: Study, plots: list[Figure], places: list[str]) -> str:
    session = study.score.session
    cards = [
        f'<figure class="card" style="margin-inline:0"><h3>{escape(plot.title)}</h3>'
        f"<figcaption>{escape(plot.sentence)}</figcaption>"
        f'<div id="{place}" style="height:{plot.height}px"></div></figure>'
        for place, plot in zip(places, plots, strict=True)
    ]
    longest = [delay.max for delay in study.score.latency_ms.values()]
    if longest.count(0.0) == len(longest):
        cards.append('<p class="facts">Latency: none, as in virtual time.</p>')
    head = f'<h2 id="{anchor}">{escape(session.name)}</h2><p class="facts">{escape(facts(session))}'
    return "\n".join((f"<section>{head}</p>", *cards, "</section>"))


def _table(scores: Sequence[Score]) -> str:
    heads, kinds = "", ""
    for score in scores:
        mode = published_for(score.session.gain, score.session.robot)
        text = escape(score.session.name)
        heads += f'<th colspan="2">{text}</th>'
        kinds += "<th><small>measured</small></th>"
        kinds += f"<th><small>published{f', {mode.mode}' if mode else ''}</small></th>"
    lines = [f"<thead><tr><th></th><th></th>{heads}</tr><tr><th></th><th></th>{kinds}</tr></thead>"]
    group = ""
    for rows in zip(*map(summary, scores), strict=True):
        if rows[0].group != group:
            group = rows[0].group
            lines.append(f'<tr class="group"><th colspan="{2 + 2 * len(scores)}">{group}</th></tr>')
        cells = "".join(
            f'<td class="value {_CLASSES[row.is_met]}">{row.value}</td>'
            f'<td class="published">{row.published and "≤ " + row.published}</td>'
            for row in rows
        )
        lines.append(
            f'<tr><td>{rows[0].label}</td><td class="unit">{rows[0].unit}</td>{cells}</tr>'
        )
    return '<div class="card"><table>' + "\n".join(lines) + "</table></div>"
