"""Table: scores on the terminal, side by side, with the published values."""

from collections.abc import Sequence
from itertools import groupby

from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from teleop_core.base.texts import printable
from teleop_core.evaluation.published import ANGLE_FACTOR, POSITION_SHARE, SOURCE, published_for
from teleop_core.evaluation.rows import MISSING, TableRow, is_compared, side_by_side
from teleop_core.evaluation.score import Score, ScoredRecording

MET, NOT_MET = "✓", "✗"
COLUMN_WIDTH = 18
CAPTION = (
    f"{MET} agrees, {NOT_MET} does not, with (the published figure; {SOURCE}): position RMS "
    f"within {100.0 * POSITION_SHARE:.0f} %, angles within a factor of {ANGLE_FACTOR:g}"
)


def score_tables(scores: Sequence[Score], width: int) -> list[Table]:
    """Tables with as many scores side by side as fit on the terminal.

    Args:
        scores: One or more scores.
        width: Width of the terminal, in characters.
    """
    lines = side_by_side([score.rows for score in scores])
    label = max((len(f"  {line.label} {line.unit} ") for line in lines), default=0)
    fitting = max(1, (width - label) // COLUMN_WIDTH)
    return [score_table(scores[i : i + fitting]) for i in range(0, len(scores), fitting)]


def score_table(scores: Sequence[Score]) -> Table:
    """Table with one column per score; each value is beside its published value, with a check mark if both agree."""
    lines = side_by_side([score.rows for score in scores])
    caption = CAPTION if is_compared(lines) else None
    table = Table(box=SIMPLE, caption=caption, caption_justify="left", pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", no_wrap=True)
    for score in scores:
        table.add_column(escape(printable(heading(score.session))), justify="left", no_wrap=True)
    for group, members in groupby(lines, key=lambda line: line.group):
        table.add_section()
        table.add_row(f"[bold]{escape(group)}[/bold]")
        for line in members:
            unit = f" [dim]{escape(line.unit)}[/dim]" if line.unit else ""
            table.add_row(f"  {escape(line.label)}{unit}", *map(_cell, line.rows))
    return table


def heading(session: ScoredRecording) -> str:
    """Heading of a column in three or more lines: name and facts of the recording, mode and arm."""
    gain = "" if session.gain is None else f"gain {session.gain:g}, "
    mode = published_for(session.gain, session.robot, session.plant)
    seed = "" if session.seed is None else f", seed {session.seed}"
    lines = (
        session.title,
        f"{gain}{session.duration_s:.3g} s",
        f"{session.robot or 'unknown'}{seed}",
        session.plant and f"{session.plant} plant",
        session.controller,
        mode and f"mode {mode.mode}",
        session.arm and f"arm {session.arm}",
        session.is_part and f"{session.from_s:g}–{session.to_s:g} s",
    )
    return "\n".join(line for line in lines if line)


def _cell(row: TableRow) -> str:
    if row.is_met is None and (not row.published or row.value == MISSING):
        return escape(row.value)
    if row.is_met is None:
        return f"{escape(row.value):>6} [dim]({escape(row.published)})[/dim]"
    mark = f"[green]{MET}[/green]" if row.is_met else f"[red]{NOT_MET}[/red]"
    return f"{escape(row.value):>6}{mark} [dim]({escape(row.published)})[/dim]"
