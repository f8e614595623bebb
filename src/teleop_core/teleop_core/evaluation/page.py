"""Page: scores and plots of recordings as one self-contained HTML file."""

import base64
import json
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from plotly.offline import get_plotlyjs

from teleop_core.evaluation.figure import Figure
from teleop_core.evaluation.html_table import html_table
from teleop_core.evaluation.page_template import PAGE, POLICY, SCRIPT, STYLE
from teleop_core.evaluation.published import SOURCE
from teleop_core.evaluation.score import Score, facts
from teleop_core.evaluation.scoring import Study


def report_page(studies: Sequence[Study]) -> str:
    """HTML page with the summary of all recordings and the plots of each.

    It works offline and asks for nothing: plotly.js is inside, once. Texts from recordings are
    escaped.
    """
    sections, drawn, arrays = [], [], _Arrays()
    for number, study in enumerate(studies):
        plots = study.figures()
        places = [f"plot-{number}-{i}" for i in range(len(plots))]
        sections.append(_section(f"recording-{number}", study, plots, places))
        for place, plot in zip(places, plots, strict=True):
            if not plot.traces:
                continue
            traces = [arrays.named(trace) for trace in plot.traces]
            layout = {**plot.layout, "height": plot.height}
            drawn.append({"id": place, "traces": traces, "layout": layout})
    data = json.dumps({"arrays": arrays.texts, "figures": drawn}, allow_nan=False)
    scores = [study.score for study in studies]
    return PAGE.format(
        policy=POLICY,
        title=escape("Teleoperation: " + ", ".join(score.session.title for score in scores)),
        style=STYLE,
        body="\n".join(
            (_header(scores), f'<div class="card">{html_table(scores)}</div>', *sections)
        ),
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


def _header(scores: Sequence[Score]) -> str:
    links = "".join(
        f'<a href="#recording-{i}">{escape(score.session.place)}</a>'
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
    cards = map(_card, plots, places)
    told = escape(" · ".join(facts(session)))
    head = f'<h2 id="{anchor}">{escape(session.place)}</h2><p class="facts">{told}'
    return "\n".join((f"<section>{head}</p>", *cards, "</section>"))


def _card(plot: Figure, place: str) -> str:
    """Place of a plot, or its text if there is nothing to draw."""
    title, sentence = escape(plot.title), escape(plot.sentence)
    if not plot.traces:
        return f'<p class="facts">{title}: {sentence}</p>'
    return (
        f'<figure class="card" style="margin-inline:0"><h3>{title}</h3>'
        f"<figcaption>{sentence}</figcaption>"
        f'<div id="{place}" style="height:{plot.height}px"></div></figure>'
    )
