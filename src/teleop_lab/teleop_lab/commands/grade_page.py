"""Page: graded episodes as one HTML file: which are odd and why, their oddness, and their figures."""

from typing import TYPE_CHECKING

import numpy as np

from teleop_console.report.pages import Cell, Listed, Section, Table, page
from teleop_core.evaluation.figure import FIRST, Figure, axis, level, points
from teleop_lab.grading import ODD, REASON, WORST
from teleop_lab.studies.answers import Quantity, score_of

if TYPE_CHECKING:
    import pandas

_ABOUT = (
    "An episode is as odd as its oddest figure: by how many robust standard deviations that is off the median of all "
    "episodes. A large oddness says which episodes to look at, not which are wrong."
)
_MOST_TOLD = 10


def grades_page(table: "pandas.DataFrame", name: str, most: float) -> str:
    """HTML page of graded episodes; it works offline, with plotly.js inside.

    Args:
        table: Result of :func:`teleop_lab.grade`.
        name: Heading.
        most: Largest oddness of a usual episode.
    """
    figures = {one: score_of(f"motion.hand.{one}", ()) for one in table.columns if one not in {ODD, WORST, REASON}}
    graded = table[table[REASON] == ""]
    shape, note = level(most, f"odd above {most:g}")
    layout = {
        "xaxis": axis("episode"),
        "yaxis": axis("oddness", "robust S.D."),
        "shapes": [shape],
        "annotations": [note],
    }
    dots = points(graded.index.to_numpy(), graded[ODD].to_numpy(), "episode", FIRST, "S.D.")
    sections = [
        Section("Answers", _ABOUT, [Listed(_answers(table, figures, most))]),
        Section("Oddness", parts=[Figure("oddness of each episode", "", [dots], layout, 320)]),
        Section("Numbers", parts=[_table(table, figures, most)]),
    ]
    return page(name, [], sections)


def _answers(table: "pandas.DataFrame", figures: dict[str, Quantity], most: float) -> list[tuple[str, str, list[Cell]]]:
    """How many episodes are odd, and in what the oddest ones differ."""
    graded = table[table[REASON] == ""]
    odd = graded[graded[ODD] > most]
    cells = [Cell(f"{len(odd)} of {len(graded)}", "told")]
    for number, row in odd.head(_MOST_TOLD).iterrows():
        one = figures[row[WORST]]
        value, usual = (_text(one, x) for x in (row[row[WORST]], graded[row[WORST]].median()))
        told = f"{one.title.removeprefix('motion hand ')} {value} instead of {usual} {one.unit}".strip()
        cells.append(Cell(f"{told}: {row[ODD]:.3g} robust standard deviations", note=f"episode {number}"))
    rows = [("odd episodes", f"oddest first, at most {_MOST_TOLD}", cells)]
    if len(refused := table[table[REASON] != ""]):
        rows.append(("not read", "", [Cell(why, note=f"episode {number}") for number, why in refused[REASON].items()]))
    return rows


def _table(table: "pandas.DataFrame", figures: dict[str, Quantity], most: float) -> Table:
    """Folded table of all figures with units; odd cells are highlighted."""
    rows = []
    for number, row in table.iterrows():
        cells = [Cell(str(number)), Cell(f"{row[ODD]:.3g}")]
        for column, one in figures.items():
            cells.append(Cell(_text(one, row[column]), "odd" * bool(column == row[WORST] and row[ODD] > most)))
        rows.append(("", cells))
    heads = ["episode", ODD, *(one.head.removeprefix("motion hand ") for one in figures.values())]
    return Table([[Cell(head) for head in heads]], rows, "Every episode")


def _text(one: Quantity, value: float) -> str:
    return f"{one.factor * value:.4g}" if np.isfinite(value) else "–"
