"""Outputs: arguments and output files of commands that run or score many sessions."""

import argparse
from collections.abc import Callable
from pathlib import Path

from teleop_core.base.errors import ParameterError

_MOST_JOBS = 1000


def add_study(
    parser: argparse.ArgumentParser, what: str, line: str, only: str = "", *, must_keep: bool = False
) -> None:
    """Add the file of a study, its store, ``--jobs``, and the arguments of :func:`add_files`.

    Args:
        parser: Parser of the command.
        what: Description of the file.
        line: Content of each line of the table.
        only: Suffix of the help of outputs that need an option, such as ``, of --compare``.
        must_keep: Whether a store is required.
    """
    keeps = (
        "directory that keeps recordings and answers"
        if must_keep
        else "directory that keeps results; sessions whose result is there are not run again"
    )
    parser.add_argument("file", type=Path, metavar="FILE.yaml", help=what)
    parser.add_argument("--store", type=Path, metavar="DIR", required=must_keep, help=keeps)
    parser.add_argument("--jobs", type=int, metavar="N", help=f"number of processes{only} (default: one per processor)")
    add_files(parser, line, only)


def add_files(parser: argparse.ArgumentParser, line: str, only: str = "") -> None:
    """Add ``--html`` and ``--csv``. ``line`` describes a line of the table; ``only`` names a needed option."""
    parser.add_argument("--html", type=Path, metavar="FILE", help=f"write a page with the results{only}")
    parser.add_argument("--csv", type=Path, metavar="FILE", help=f"write a table with a line for each {line}{only}")


def check_outputs(arguments: argparse.Namespace) -> None:
    """Check that the number of processes is valid, and that the files can be written.

    Raises:
        TeleopError: The number of processes is invalid, or a file cannot be written.
    """
    from teleop_core.evaluation.command import check_places

    if arguments.jobs is not None and not 1 <= arguments.jobs <= _MOST_JOBS:
        raise ParameterError("--jobs", arguments.jobs, f"1 to {_MOST_JOBS} processes")
    check_places(arguments.html, arguments.csv)


def write_outputs(arguments: argparse.Namespace, csv: Callable[[], str], html: Callable[[], str]) -> None:
    """Write the requested files, completely or not at all, and print their paths."""
    from teleop_core.evaluation.command import write_whole

    for name, place, text in (("numbers", arguments.csv, csv), ("page", arguments.html, html)):
        if place is not None:
            write_whole(place, text())
            print(f"{name}: {place}")
