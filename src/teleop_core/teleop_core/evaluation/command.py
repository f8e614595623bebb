"""Command: implementation of ``teleop evaluate``."""

import json
from collections.abc import Callable, Sequence
from importlib.metadata import entry_points
from pathlib import Path

from rich.console import Console

from teleop_core.bags.reader import Bag
from teleop_core.base import EvaluationError, ParameterError, printable
from teleop_core.evaluation.differences import difference_table
from teleop_core.evaluation.score import Score
from teleop_core.evaluation.score_table import score_tables
from teleop_core.evaluation.scoring import studies
from teleop_core.evaluation.windows import Seconds

PAGES = "teleop_core.pages"
"""Entry-point group of functions that make pages."""


def evaluate_bags(
    paths: Sequence[Path],
    json_file: Path | None,
    html_file: Path | None,
    console: Console,
    span: Seconds | None = None,
    *,
    differences: bool = False,
) -> list[Score]:
    """Score recordings, show the table, and write JSON and page if wanted.

    Nothing is written unless every recording could be scored. Files that exist are replaced.

    Args:
        paths: Recordings.
        json_file: File for the scores: a list with one entry per recording and arm.
        html_file: File for the page.
        console: Console that shows the table and the paths of the files.
        span: Begin and end [s] of the scored part of each recording; None for the whole recording.
        differences: Whether the table shows only the rows that differ.

    Returns:
        One score per recording and arm.

    Raises:
        ParameterError: Differences are wanted of a single score.
        EvaluationError: A recording cannot be scored, or a file cannot be written.
        RecordingError: A recording is missing, damaged, or lacks a topic.
    """
    check_places(json_file, html_file)
    report_page = page_maker("report") if html_file is not None else None
    found = [study for path in paths for study in studies(Bag(path), span=span)]
    scores = [study.score for study in found]
    for score in scores:
        line = f"{score.session.place}: {score.verdict}"
        console.print(printable(line), markup=False, highlight=False, soft_wrap=True)
        if advice := score.verdict.advice:
            console.print(f"  {advice}", markup=False, highlight=False, soft_wrap=True)
    if differences and len(scores) < 2:
        raise ParameterError("--differences", str(paths[0]), "given with two recordings or more")
    for table in [difference_table(scores)] if differences else score_tables(scores, console.width):
        console.print(table)
    if json_file is not None:
        text = json.dumps([score.to_json() for score in scores], indent=2, allow_nan=False)
        write_whole(json_file, text + "\n")
        console.print(f"scores: {json_file}", markup=False, highlight=False, soft_wrap=True)
    if html_file is not None and report_page is not None:
        write_whole(html_file, report_page(found))
        console.print(f"page: {html_file}", markup=False, highlight=False, soft_wrap=True)
    return scores


def page_maker(name: str) -> Callable[..., str]:
    """Function of an installed package that makes a page: ``report`` or ``workspace``.

    Raises:
        EvaluationError: No such package is installed.
    """
    for entry in entry_points(group=PAGES, name=name):
        maker: Callable[..., str] = entry.load()
        return maker
    raise EvaluationError("--html needs the distribution teleop_console: install it")


def check_places(*files: Path | None) -> None:
    """Check, before the scores are computed, that a file can be written at each path.

    Args:
        files: Paths of the files; None for a file that is not requested.

    Raises:
        EvaluationError: A directory is missing, a path is a directory, or no file can be created there.
    """
    for file in filter(None, files):
        if not file.parent.is_dir():
            text = f"the directory {file.parent} does not exist; make it first"
            raise EvaluationError(f"{file}: {text}")
        if file.is_dir():
            raise EvaluationError(f"{file}: is a directory, must be a file")
        part = file.with_name(file.name + ".part")
        try:
            part.touch()
            part.unlink()
        except OSError as error:
            raise EvaluationError(f"{file}: cannot be written: {error.strerror}") from error


def write_whole(file: Path, text: str) -> None:
    """Write a file completely or not at all.

    Raises:
        EvaluationError: The file cannot be written.
    """
    part = file.with_name(file.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(file)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise EvaluationError(f"{file}: cannot be written: {error.strerror}") from error
