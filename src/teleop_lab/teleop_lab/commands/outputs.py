"""Outputs: arguments of commands that run many sessions, and the files that they write."""

import argparse
from collections.abc import Callable
from pathlib import Path

from teleop_core.base.errors import ParameterError


def add_outputs(parser: argparse.ArgumentParser, line: str, only: str = "") -> None:
    """Add ``--jobs``, ``--html`` and ``--csv``, which has a line for each ``line``; ``only`` is when they count."""
    parser.add_argument("--jobs", type=int, metavar="N", help=f"processes{only} (default: processors)")
    parser.add_argument("--html", type=Path, metavar="FILE", help=f"write a page with plots{only}")
    parser.add_argument("--csv", type=Path, metavar="FILE", help=f"write a line for each {line}{only}")


def check_outputs(arguments: argparse.Namespace) -> None:
    """Make sure that there are processes, and places for the files.

    Raises:
        TeleopError: There are none.
    """
    from teleop_core.evaluation.command import check_places

    if arguments.jobs is not None and arguments.jobs < 1:
        raise ParameterError("--jobs", arguments.jobs, "1 or more processes")
    check_places(arguments.html, arguments.csv)


def write_outputs(arguments: argparse.Namespace, csv: Callable[[], str], html: Callable[[], str]) -> None:
    """Write the files that were asked for, whole or not at all, and say where they are."""
    from teleop_core.evaluation.command import write_whole

    for name, place, text in (("numbers", arguments.csv, csv), ("page", arguments.html, html)):
        if place is not None:
            write_whole(place, text())
            print(f"{name}: {place}")
