"""``teleop grade``: motion scores of every episode of a data set, the oddest episode first."""

import argparse
from pathlib import Path
from typing import Any

from teleop_core.commands.arguments import command
from teleop_lab.commands.outputs import add_files, write_outputs

_EPILOG = """\
  teleop grade hands.csv                              a table with a column of episodes
  teleop grade hands.csv --csv grades.csv --html grades.html
  teleop grade hands.csv --usual keep.txt --most 3.5  episodes that are no odder, one a line
  teleop grade dataset --position observation.state.6 observation.state.7 observation.state.8
a data set of LeRobot says which numbers are a place only by --position.
an episode is as odd as its oddest figure: by how many robust standard deviations it is off the
median of all episodes. That says which to look at first, not which are wrong.
"""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "figures of motion of every episode of a data set, the oddest first"
    parser = command(commands, "grade", _run, text, _EPILOG)
    parser.add_argument("data", type=Path, metavar="DATASET", help="directory or table with the episodes")
    parser.add_argument(
        "--position", nargs=3, metavar=("X", "Y", "Z"), help="columns of the position, if they are not x, y, z"
    )
    parser.add_argument("--unit", default="auto", help="unit of the position: m, cm, mm, in, or auto (default: auto)")
    parser.add_argument("--time", nargs="+", metavar="COL", help="column of the time, if its name does not say it")
    parser.add_argument("--rate", type=float, metavar="HZ", help="samples per second, for a table without times")
    parser.add_argument("--numbered-by", nargs="+", metavar="COL", help="columns that number the episodes")
    add_files(parser, "episode")
    parser.add_argument("--usual", type=Path, metavar="FILE", help="write a list of the episodes that are not outliers")
    parser.add_argument(
        "--most",
        type=float,
        default=3.5,
        help="largest deviation of these episodes, in standard deviations (default: 3.5)",
    )
    parser.add_argument(
        "--recordings", type=Path, metavar="DIR", help="directory that keeps a recording of each episode"
    )


def _run(arguments: argparse.Namespace) -> int:
    from teleop_core.base.errors import ParameterError
    from teleop_core.evaluation.command import check_places, write_whole
    from teleop_exchange import ImportOptions
    from teleop_lab.grading import REASON, grade, usual

    if not arguments.most >= 0.0:
        raise ParameterError("--most", arguments.most, "0 or more standard deviations")
    check_places(arguments.csv, arguments.html, arguments.usual)
    options = ImportOptions(
        position=tuple(arguments.position or ()),
        unit=arguments.unit,
        time=tuple(arguments.time or ()),
        rate=arguments.rate,
        numbered_by=tuple(arguments.numbered_by or ()),
        # The figures are those of the position; only recordings that are kept need an orientation.
        orientation="none" if arguments.recordings is None else "auto",
    )
    table = grade(arguments.data, options=options, recordings=arguments.recordings)
    shown = table.drop(columns=REASON).head(20)
    print(shown.to_string(float_format="{:.4g}".format, na_rep="–"))
    if len(table) > len(shown):
        print(f"and {len(table) - len(shown)} more")
    kept = usual(table, arguments.most)
    refused = table.index[table[REASON] != ""]
    print(f"{len(kept)} of {len(table)} episodes are no odder than {arguments.most:g}")
    for number in refused:
        print(f"episode {number}: {table.loc[number, REASON]}")
    if arguments.usual is not None:
        write_whole(arguments.usual, "".join(f"{number}\n" for number in kept))
        print(f"usual episodes: {arguments.usual}")
    write_outputs(arguments, table.to_csv, lambda: _page(table, arguments.data.name))
    return 0


def _page(table: Any, name: str) -> str:
    """Page with a table that can be sorted by oddness; odd cells are highlighted."""
    from html import escape

    from teleop_console.report.plain_page import plain_page
    from teleop_lab.grading import ODD, WORST

    head = "".join(f"<th>{escape(str(column))}</th>" for column in ("episode", *table.columns))
    rows = []
    for number, row in table.iterrows():
        cells = [f"<td>{number}</td>"]
        for column, value in row.items():
            is_odd = column == row[WORST] and row[ODD] > 3.5
            text = f"{value:.4g}" if isinstance(value, float) else str(value)
            cells.append(f"<td{' class=odd' if is_odd else ''}>{escape(text)}</td>")
        rows.append(f"<tr>{''.join(cells)}</tr>")
    text = "Oddest first: by how many robust standard deviations the oddest figure is off the median of all episodes."
    table_html = f'<div class="card table"><table><tr>{head}</tr>{"".join(rows)}</table></div>'
    return plain_page(name, [f'<p class="facts">{text}</p>', table_html])
