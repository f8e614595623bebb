"""Plain page: one file with texts, tables and figures, in the look of the report, by day and by night."""

import json
from collections.abc import Iterable
from html import escape
from typing import Any

from teleop_console.report.page_template import style, text_of

_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<main>
<noscript><p class="notice">The plots need JavaScript, which is off here; the tables are all there.</p></noscript>
<h1>{title}</h1>
{body}
</main>
{scripts}</body>
</html>
"""
_DRAW = """\
for (const place of document.querySelectorAll(".plot[data-figure]")) {
  const { data, layout } = JSON.parse(document.getElementById(place.dataset.figure).textContent);
  const fixed = { ...themed(layout), width: undefined, autosize: true };
  if (innerWidth < 641) fixed.margin = { ...fixed.margin, l: 44, r: 8 };
  Plotly.newPlot(place, data.map(seen), fixed, { responsive: true, displaylogo: false });
}
"""


class Figures:
    """Makes the figures of a page; the page contains plotly.js if there is any figure."""

    def __init__(self) -> None:
        self.count = 0

    def card(self, traces: Any, layout: Any, caption: str = "") -> str:
        """Card with a figure.

        Args:
            traces: Traces of plotly.
            layout: Layout of plotly, with a height.
            caption: Text above the figure.
        """
        import plotly.graph_objects as plots

        self.count += 1
        name, made = f"figure-{self.count}", plots.Figure(traces, layout).to_plotly_json()
        made["layout"].setdefault("margin", {"t": 20, "b": 50, "l": 70, "r": 20})
        told = json.dumps(made, cls=_encoder()).replace("</", "<\\/")
        height = made["layout"].get("height", 340)
        head = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
        return (
            f'<figure class="card">{head}<div class="plot" data-figure="{name}" style="height:{height}px"></div>'
            f'<script id="{name}" type="application/json">{told}</script></figure>'
        )


def _encoder() -> type[json.JSONEncoder]:
    from plotly.utils import PlotlyJSONEncoder

    encoder: type[json.JSONEncoder] = PlotlyJSONEncoder
    return encoder


def plain_page(title: str, parts: Iterable[str], figures: Figures | None = None) -> str:
    """HTML of a page; it works offline.

    Args:
        title: Title, as text.
        parts: HTML below the title.
        figures: Maker of the figures in the parts; None for a page without figures.
    """
    scripts = ""
    if figures is not None and figures.count:
        from plotly.offline import get_plotlyjs

        own = f'"use strict";\n(function () {{\n{text_of("theme.js")}{_DRAW}}})();\n'
        scripts = f"<script>{get_plotlyjs()}</script>\n<script>\n{own}</script>\n"
    return _PAGE.format(title=escape(title), style=style(), body="\n".join(parts), scripts=scripts)
