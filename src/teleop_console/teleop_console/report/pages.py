"""Pages: texts, tables and figures as one self-contained HTML file, in one look by day and by night.

A page is written as values: :class:`Section`, :class:`Table`, :class:`Text`, :class:`Printed`, :class:`Sessions`,
:class:`Listed` and :class:`teleop_core.evaluation.figure.Figure`. One template shows them all. It escapes every text.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from itertools import groupby
from typing import Any, ClassVar

import numpy as np

from teleop_console.report.packing import Arrays, deflated
from teleop_core.evaluation.bands import Band
from teleop_core.evaluation.figure import Figure, is_against_time
from teleop_core.evaluation.verdict import Verdict

# The browser refuses every request of the page. Evaluation of code is allowed, because plotly.js compiles its shaders.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:; worker-src blob:"
)
_SCRIPTS = ("theme", "unpack", "thin", "bands", "paths", "plot", "recording", "page")


@dataclass(frozen=True)
class Text:
    """Paragraph."""

    text: str
    kind: ClassVar[str] = "text"


@dataclass(frozen=True)
class Printed:
    """Text as a terminal shows it."""

    text: str
    kind: ClassVar[str] = "printed"


@dataclass(frozen=True)
class Cell:
    """Cell of a table.

    Attributes:
        text: Text of the cell.
        kind: Classes of the style sheet: ``unit``, ``value met``, ``value missed``, ``value plain``, ``published``,
            ``title``, ``within``, ``wide`` (left out on a phone), ``odd``.
        note: Small text below the text.
        link: Place on the page, such as ``#resolution``.
        span: Number of columns.
    """

    text: str = ""
    kind: str = ""
    note: str = ""
    link: str = ""
    span: int = 1


@dataclass(frozen=True)
class Table:
    """Table.

    Attributes:
        heads: Rows of the head.
        rows: Group and cells of each row; rows of one group are below its name, unless it is empty.
        summary: Line that a folded table shows; empty for an open one.
        note: Text above a folded table.
    """

    heads: Sequence[Sequence[Cell]]
    rows: Sequence[tuple[str, Sequence[Cell]]]
    summary: str = ""
    note: str = ""
    kind: ClassVar[str] = "table"

    @property
    def width(self) -> int:
        """Number of columns."""
        return sum(one.span for one in self.heads[0])

    @property
    def groups(self) -> list[tuple[str, list[Sequence[Cell]]]]:
        """Each group with the cells of its rows."""
        return [(name, [cells for _, cells in found]) for name, found in groupby(self.rows, key=lambda row: row[0])]


def plain_table(heads: Sequence[str], rows: Sequence[Sequence[str]], summary: str = "") -> Table:
    """Table of texts without groups; folded below its summary, if it has one."""
    return Table([[Cell(head) for head in heads]], [("", [Cell(text) for text in row]) for row in rows], summary)


@dataclass(frozen=True)
class Card:
    """Card of a session: title, link to its section, verdict, and scores with value, unit and meaning."""

    title: str
    link: str
    verdict: Verdict
    figures: Sequence[tuple[str, str, str]]


@dataclass(frozen=True)
class Sessions:
    """Cards of sessions, side by side."""

    cards: Sequence[Card]
    kind: ClassVar[str] = "sessions"


@dataclass(frozen=True)
class Listed:
    """Names, each with texts: boxes beside each other, or lines below each other.

    Attributes:
        rows: Name, a note below it, and its texts. A cell's note stands before its text; its kind is a class of the
            style sheet: ``told`` for an answer, ``untold`` for a question that stays open.
        are_boxes: Whether the texts are boxes beside each other.
    """

    rows: Sequence[tuple[str, str, Sequence[Cell]]]
    are_boxes: bool = False
    kind: ClassVar[str] = "listed"


Part = Text | Printed | Table | Sessions | Listed | Figure


@dataclass(frozen=True, eq=False)
class Section:
    """Part of a page below a heading; all its figures against time show the same interval.

    Attributes:
        title: Heading; may be empty.
        facts: Line below the heading.
        parts: Content.
        anchor: Name for links.
        bands: Coloured intervals behind the figures against time.
        duration_s: Length of the time axes [s].
        kept_s: Length of the intervals [s] of which the figures contain only the extreme values; 0 for all samples.
    """

    title: str = ""
    facts: str = ""
    parts: Sequence[Part] = ()
    anchor: str = ""
    bands: Sequence[Band] = field(default_factory=list)
    duration_s: float = 1.0
    kept_s: float = 0.0

    @property
    def has_times(self) -> bool:
        """Whether a figure has a time axis."""
        return any(isinstance(part, Figure) and is_against_time(part) for part in self.parts)


def page(title: str, parts: Sequence[Part], sections: Sequence[Section] = (), *, heading: str = "") -> str:
    """HTML of a page, which contains plotly.js if there is anything to draw.

    Args:
        title: Title of the window.
        parts: Content above the first section, without figures.
        sections: Sections.
        heading: Heading, if it differs from the title.
    """
    from markupsafe import Markup

    shown = {"title": title, "heading": heading or title, "parts": parts, "sections": sections}
    drawn, arrays = _drawn(sections)
    if drawn or any(isinstance(part, Table) and part.summary for part in parts):
        from plotly.offline import get_plotlyjs, get_plotlyjs_version

        recordings = [
            {"duration": one.duration_s, "bands": [_band(band) for band in one.bands], "kept": one.kept_s}
            for one in sections
        ]
        data = json.dumps({"recordings": recordings, "arrays": arrays, "figures": drawn}, allow_nan=False)
        shown |= {
            "data": Markup(data.replace("<", "\\u003c")),  # no text of the data can close the script element
            "plotly": deflated(get_plotlyjs().encode()),
            "library": f"plotly.js {get_plotlyjs_version()}",
            "script": Markup(_script()),
        }
    return _template().render(policy=Markup(_POLICY), style=Markup(text_of("style.css")), **shown)


def _drawn(sections: Sequence[Section]) -> tuple[list[dict[str, Any]], list[str]]:
    """Figures of all sections, and the arrays that they share."""
    arrays, drawn = Arrays(), []
    for number, section in enumerate(sections):
        for i, part in enumerate(section.parts):
            if isinstance(part, Figure) and part.traces:
                layout = arrays.named(part.layout) | {"height": part.height}
                traces = arrays.named(part.traces)
                drawn.append({"id": f"plot-{number}-{i}", "recording": number, "traces": traces, "layout": layout})
    return drawn, arrays.packed()


def _band(band: Band) -> dict[str, Any]:
    return {"cause": band.cause, "color": band.color, "stretches": np.round(band.stretches, 6).tolist()}


@cache
def _template() -> Any:
    from jinja2 import Environment, PackageLoader

    return Environment(loader=PackageLoader("teleop_console", "report"), autoescape=True).get_template("page.html")


@cache
def _script() -> str:
    """All scripts as one text; each script may use the scripts before it."""
    parts = "\n".join(text_of(f"{name}.js") for name in _SCRIPTS)
    return f'"use strict";\n(function () {{\n{parts}}})();\n'


@cache
def text_of(name: str) -> str:
    """Text of a file beside this module."""
    return (files("teleop_console.report") / name).read_text(encoding="utf-8")
