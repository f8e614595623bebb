"""Page: scores and plots of recordings as one self-contained HTML file."""

import json
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from plotly.offline import get_plotlyjs, get_plotlyjs_version

from teleop_console.report.overview import overview
from teleop_console.report.packing import Arrays, deflated
from teleop_console.report.page_template import PAGE, POLICY, TIMES, script, style
from teleop_console.report.scores_table import html_table
from teleop_core.evaluation.bands import Band
from teleop_core.evaluation.figure import Figure, is_against_time
from teleop_core.evaluation.published import ANGLE_FACTOR, POSITION_SHARE, SOURCE
from teleop_core.evaluation.rows import is_compared, side_by_side
from teleop_core.evaluation.score import Score
from teleop_core.evaluation.scoring import Study
from teleop_core.evaluation.traces import spacing_s

_HEADER = "<h1>Teleoperation report</h1>"


def report_page(studies: Sequence[Study]) -> str:
    """HTML page with the summary of all recordings and the plots of each.

    The page works offline, because it contains plotly.js. All plots of a recording against time show the same interval,
    down to single samples. Texts from recordings are escaped.
    """
    sections, drawn, arrays = [], [], Arrays()
    for number, study in enumerate(studies):
        plots = study.figures()
        places = [f"plot-{number}-{i}" for i in range(len(plots))]
        sections.append(_section(number, study, plots, places))
        for place, plot in zip(places, plots, strict=True):
            if not plot.traces:
                continue
            traces, layout = arrays.named(plot.traces), arrays.named(plot.layout)
            layout |= {"height": plot.height}
            drawn.append({"id": place, "recording": number, "traces": traces, "layout": layout})
    recordings = [_recording(study) for study in studies]
    found = {"recordings": recordings, "arrays": arrays.packed(), "figures": drawn}
    data = json.dumps(found, allow_nan=False)
    scores = [study.score for study in studies]
    table = (  # page.js folds the table; without scripts it stays open
        f'<details class="card table" open><summary>All figures</summary>{_note(scores)}{html_table(scores)}</details>'
    )
    return PAGE.format(
        policy=POLICY,
        title=escape("Teleoperation: " + ", ".join(score.session.title for score in scores)),
        style=style(),
        body="\n".join((_HEADER, overview(scores), table, *sections)),
        data=data.replace("<", "\\u003c"),  # no text of the data can close the script element
        plotly=deflated(get_plotlyjs().encode()),
        library=f"plotly.js {get_plotlyjs_version()}",
        script=script(),
    )


def _recording(study: Study) -> dict[str, Any]:
    bands = [
        {"cause": band.cause, "color": band.color, "stretches": np.round(band.stretches, 6).tolist()}
        for band in study.bands
    ]
    duration_s = study.score.session.duration_s
    return {"duration": duration_s, "bands": bands, "kept": _kept_s(study.score)}


def _kept_s(score: Score) -> float:
    """Length of the intervals [s] of which the page contains only the extreme values; 0 if it contains all samples."""
    samples = max((topic.count for topic in score.topics.values()), default=0)
    return spacing_s(samples, score.session.duration_s)


def _note(scores: Sequence[Score]) -> str:
    """Explanation of the marks, if published numbers are shown beside ours."""
    if not is_compared(side_by_side([score.rows for score in scores])):
        return ""
    return (
        f'<p class="facts">Beside the published figures of the RCRT-1 ({escape(SOURCE)}), '
        "presumably taken against the filtered reference too. ✓ agrees, ✗ does not: position RMS "
        f"within {100.0 * POSITION_SHARE:.0f} %, angles within a factor of {ANGLE_FACTOR:g}.</p>"
    )


def _section(number: int, study: Study, plots: list[Figure], places: list[str]) -> str:
    session = study.score.session
    cards = [_card(plot, place) for plot, place in zip(plots, places, strict=True)]
    told = list(session.facts)
    if kept_s := _kept_s(study.score):
        told.append(f"plots hold the smallest and largest value of each {kept_s * 1e3:.3g} ms")
    head = f'<h2 id="recording-{number}">{escape(session.place)}</h2>'
    head += f'<p class="facts">{escape(" · ".join(told))}</p>{_legend(study.bands)}'
    if any(map(is_against_time, plots)):
        head += TIMES.format(place=f"times-{number}", duration=f"{session.duration_s:.1f}")
    return "\n".join((f"<section>{head}", *cards, "</section>"))


def _legend(bands: Sequence[Band]) -> str:
    """Legend of the coloured bands; the table contains the share of time of each band."""
    entries = "".join(
        f'<span><i style="background:{escape(band.color)}"></i>{escape(band.cause)}</span>' for band in bands
    )
    return f'<p class="bands">In the state: {entries}</p>' if entries else ""


def _card(plot: Figure, place: str) -> str:
    """HTML element for a plot, or the plot's text if there is nothing to draw."""
    title, sentence = escape(plot.title), escape(plot.sentence)
    if not plot.traces:
        return f'<p class="facts">{title}: {sentence}</p>'
    return (
        f'<figure class="card"><h3>{title}</h3><figcaption>{sentence}</figcaption>'
        f'<div id="{place}" class="plot"></div></figure>'
    )
