"""``teleop grade``: motion scores of every episode of a data set, the oddest episode first."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from teleop_core.commands.options import Words
from teleop_lab.commands.outputs import Pages


def grade(
    dataset: Path,
    /,
    *,
    position: Annotated[tuple[str, str, str] | None, Parameter(metavar="X Y Z")] = None,
    unit: str = "auto",
    time: Words = (),
    rate: float | None = None,
    numbered_by: Words = (),
    usual: Path | None = None,
    most: float = 3.5,
    recordings: Path | None = None,
    outputs: Pages = Pages(),
) -> None:
    """Figures of motion of every episode of a data set, the oddest first.

    For example:

        teleop grade hands.csv                              # a table with a column of episodes
        teleop grade hands.csv --csv grades.csv --html grades.html
        teleop grade hands.csv --usual keep.txt --most 3.5  # episodes that are no odder, one a line
        teleop grade dataset --position observation.state.6 observation.state.7 observation.state.8

    A data set of LeRobot says which numbers are a place only by --position. An episode is as odd as its oddest figure:
    by how many robust standard deviations it is off the median of all episodes. That says which to look at first, not
    which are wrong.

    Args:
        dataset: Directory or table with the episodes.
        position: Columns of the position, if they are not x, y, z.
        unit: Unit of the position: m, cm, mm, in, or auto.
        time: Column of the time, if its name does not say it.
        rate: Samples per second [Hz], for tables without a time.
        numbered_by: Columns that number the episodes.
        usual: Write a list of the episodes that are not outliers.
        most: Largest deviation of these episodes, in standard deviations.
        recordings: Directory that keeps a recording of each episode.
        outputs: Files with the episodes.
    """
    from teleop_core.base.errors import ParameterError
    from teleop_core.evaluation.command import check_places, write_whole
    from teleop_exchange import ImportOptions
    from teleop_lab.commands.grade_page import grades_page
    from teleop_lab.grading import REASON
    from teleop_lab.grading import grade as graded
    from teleop_lab.grading import usual as usual_of

    if not most >= 0.0:
        raise ParameterError("--most", most, "0 or more standard deviations")
    outputs.check()
    check_places(usual)
    options = ImportOptions(
        position=position or (),
        unit=unit,
        time=time,
        rate=rate,
        numbered_by=numbered_by,
        # The figures are those of the position; only recordings that are kept need an orientation.
        orientation="none" if recordings is None else "auto",
    )
    table = graded(dataset, options=options, recordings=recordings)
    shown = table.drop(columns=REASON).head(20)
    print(shown.to_string(float_format="{:.4g}".format, na_rep="–"))
    if len(table) > len(shown):
        print(f"and {len(table) - len(shown)} more")
    kept = usual_of(table, most)
    refused = table.index[table[REASON] != ""]
    print(f"{len(kept)} of {len(table)} episodes are no odder than {most:g}")
    for number in refused:
        print(f"episode {number}: {table.loc[number, REASON]}")
    if usual is not None:
        write_whole(usual, "".join(f"{number}\n" for number in kept))
        print(f"usual episodes: {usual}")
    outputs.write(table.to_csv, lambda: grades_page(table, dataset.name, most))
