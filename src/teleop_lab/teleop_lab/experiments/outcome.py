"""Outcome: results of an experiment, and a table of published and predicted numbers for the terminal."""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from teleop_core.base.errors import UnknownNameError
from teleop_core.evaluation.figure import Figure
from teleop_core.evaluation.rows import MISSING
from teleop_lab.experiments.comparison import Comparison, Plain

MARKS = {True: "✓", False: "✗", None: ""}
_COLORS = {True: "green", False: "red", None: "default"}
_KEPT = {"printed": "published figures agree", "law": "laws hold", "goal": "goals are kept"}
_WIDTH = 110
_DIGITS = 6  # largest number of decimals that a source prints


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of an experiment.

    Attributes:
        name: Name of the experiment.
        title: One line that describes the experiment.
        source: Source of the published numbers.
        seed: Seed of all random numbers of the experiment.
        rows: Published and predicted numbers.
        figures: Plots for the page.
        notes: Explanations without which the numbers would mislead a reader.
    """

    name: str
    title: str
    source: str
    seed: int
    rows: tuple[Comparison, ...]
    figures: tuple[Figure, ...] = ()
    notes: tuple[str, ...] = ()

    def count(self, basis: str = "printed") -> tuple[int, int]:
        """Number of agreeing rows with the given basis, and number of judged rows with this basis."""
        marks = [row.agrees for row in self.rows if row.basis == basis]
        return marks.count(True), len(marks) - marks.count(None)

    @property
    def judged(self) -> int:
        """Number of judged rows whose value the source printed."""
        return self.count()[1]

    @property
    def agreeing(self) -> int:
        """Number of rows that agree with the value that the source printed."""
        return self.count()[0]

    def row(self, quantity: str, group: str = "") -> Comparison:
        """Return the row of a quantity.

        Raises:
            UnknownNameError: No row has this quantity; the message lists all quantities.
        """
        for row in self.rows:
            if row.quantity == quantity and (not group or row.group == group):
                return row
        kind = f"quantity of {self.name}" + f" in {group!r}" * bool(group)
        raise UnknownNameError(kind, quantity, dict.fromkeys(row.quantity for row in self.rows))

    def to_json(self) -> dict[str, Plain]:
        """The outcome as plain values without the plots; numbers are not rounded."""
        return {
            "name": self.name,
            "title": self.title,
            "source": self.source,
            "seed": self.seed,
            "judged": self.judged,
            "agreeing": self.agreeing,
            "rows": [row.to_json() for row in self.rows],
            "notes": list(self.notes),
        }

    def __str__(self) -> str:
        console = Console(file=io.StringIO(), width=_WIDTH, color_system=None, legacy_windows=False)
        show(self, console)
        out = console.file
        assert isinstance(out, io.StringIO)
        return "\n".join(line.rstrip() for line in out.getvalue().splitlines()).strip("\n")


def numbers(row: Comparison) -> tuple[str, str, str, str]:
    """Texts of the published value, the predicted value, our value and the difference.

    A predicted number is shown with one decimal more than the printed number, so that rounding is visible.
    """
    if row.published is None:
        return "", _four_digits(row.predicted), _four_digits(row.ours), ""
    texts = [_beside(value, row.published) for value in (row.predicted, row.ours)]
    difference = "" if row.difference is None else _signed(row.difference, row.published)
    return _printed(row.published), texts[0], texts[1], difference


def _printed(published: float) -> str:
    """Text of a published number: as printed, or with four digits if it was computed from printed numbers."""
    text = f"{published:.9g}"
    return text if len(text.partition(".")[2]) <= _DIGITS else f"{published:.4g}"


def _beside(value: float | None, published: float) -> str:
    """Text of a number with one decimal more than the published number, but with at least three digits."""
    if value is None:
        return ""
    if 0.0 < abs(published) < 1e-4:
        return f"{value:.4g}"
    printed = len(_printed(published).partition(".")[2])
    size = 0 if abs(value) < 1e-9 else math.floor(math.log10(abs(value)))
    return f"{value + 0.0:.{max(printed + 1, min(2 - size, printed + 2))}f}"


def _four_digits(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _signed(difference: float, published: float) -> str:
    """Text of a difference; zero if the difference is only a rounding error."""
    if abs(difference) <= 1e-12 * max(1.0, abs(published)):
        return "0"
    digits = 2 if abs(difference) < 10.0 else int(math.log10(abs(difference))) + 1
    return f"{difference:+.{digits}g}"


def spread(row: Comparison) -> str:
    """Text with the smallest and largest value of several seeds."""
    if row.lowest is None or row.highest is None:
        return ""
    return f"{row.lowest:.3g} … {row.highest:.3g}"


def within(row: Comparison) -> str:
    """Text of the tolerance."""
    if row.within is None:
        return ""
    return row.within.text(row.unit) + f", {row.basis}" * (row.basis != "printed")


def summary(outcomes: Sequence[Outcome]) -> str:
    """One line with the number of printed values that agree, and the numbers of laws and goals that are met."""
    found = {basis: np.sum([o.count(basis) for o in outcomes], axis=0) for basis in _KEPT}
    told = [f"{kept} of {of} {_KEPT[b]}" for b, (kept, of) in found.items() if of or b == "printed"]
    rest = sum(len(o.rows) for o in outcomes) - sum(of for _, of in found.values())
    return "; ".join((*told, f"{rest} rows are not judged"))


def outcome_table(outcome: Outcome) -> Table:
    """Table of one outcome."""
    has_ours = any(row.ours is not None for row in outcome.rows)
    has_spread = any(spread(row) for row in outcome.rows)
    table = Table(
        box=SIMPLE,
        title=f"[bold]{escape(outcome.name)}[/bold]: {escape(outcome.title)}",
        title_justify="left",
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    table.add_column("", min_width=20)
    table.add_column("unit", style="dim", no_wrap=True)
    heads = ["published", "predicted", *["seeds"] * has_spread, *["ours"] * has_ours, "difference"]
    for head in heads:
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("within", style="dim", no_wrap=True)
    table.add_column("", no_wrap=True)
    for group, rows in groupby(outcome.rows, key=lambda row: row.group):
        if group:
            table.add_section()
            table.add_row(f"[bold]{escape(group)}[/bold]")
        for row in rows:
            published, predicted, ours, difference = numbers(row)
            mark = f"[{_COLORS[row.agrees]}]{MARKS[row.agrees]}[/]"
            cells = [published, predicted, *[spread(row)] * has_spread, *[ours] * has_ours]
            note = f" [dim]({escape(row.note)})[/dim]" if row.note else ""
            table.add_row(
                f"{escape(row.quantity)}{note}",
                escape(row.unit),
                *map(escape, cells),
                escape(difference),
                escape(within(row)),
                mark,
            )
    return table


def show(outcome: Outcome, console: Console) -> None:
    """Print the table of an outcome, and its notes."""
    console.print(outcome_table(outcome))
    told = f"{MARKS[True]} agrees, {MARKS[False]} does not; {outcome.source}"
    for line in (told, *outcome.notes):
        console.print(line, markup=False, highlight=False, style="dim")
    console.print()


def terminal() -> Console:
    """Console on standard output. If standard output is not a terminal, the console is as wide as the tables."""
    console = Console(legacy_windows=False)
    return console if console.is_terminal else Console(width=_WIDTH, legacy_windows=False)


def empty(value: str) -> str:
    """A dash for a missing number."""
    return value or MISSING
