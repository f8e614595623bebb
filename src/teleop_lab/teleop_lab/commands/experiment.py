"""``teleop experiment``: the sources' experiments, repeated on our models and compared with the printed results."""

import argparse
import json
import sys
import time
from os import sched_getaffinity
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import UnknownNameError
from teleop_core.commands.arguments import command

if TYPE_CHECKING:
    from teleop_lab.experiments import Outcome

ALL = "all"
_EPILOG = """\
without a name the experiments are listed; `all` runs every one, in five to seven minutes:
  teleop experiment resolution                          a table: published, predicted, difference
  teleop experiment master_slave gravity --seed 5       other hands; sessions both need run once
  teleop experiment all --html experiments.html         one page with the source's figures
  teleop experiment all --json experiments.json         every number, exact
a mark says whether prediction and publication agree, ✓, or not, ✗, not whether a number is small.
"""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "repeat what the sources did, and print predicted beside published figures"
    parser = command(commands, "experiment", _run, text, _EPILOG)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="names of experiments, or `all`; without a name, all are listed"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers as JSON")
    parser.add_argument("--html", type=Path, metavar="FILE", help="write one page with figures")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first simulated hand (default: 1)")


def _run(arguments: argparse.Namespace) -> int:
    from teleop_core.evaluation.command import check_places
    from teleop_lab.experiments import EXPERIMENTS, list_experiments

    if not arguments.names and arguments.json is None and arguments.html is None:
        for name, title in list_experiments().items():
            print(f"{name:16} {title}")
        return 0
    for name in arguments.names:
        if name != ALL and name not in EXPERIMENTS.names():
            raise UnknownNameError("experiment", name, (*EXPERIMENTS.names(), ALL))
    check_places(arguments.json, arguments.html)
    is_all = not arguments.names or ALL in arguments.names
    outcomes = _outcomes(() if is_all else tuple(arguments.names), arguments.seed)
    # Files are written before the tables are printed, because a reader of the tables may close the pipe early.
    written = _write(outcomes, arguments.json, arguments.html)
    _show(outcomes)
    print("".join(f"{line}\n" for line in written), end="")
    return 0


def _outcomes(names: tuple[str, ...], seed: int) -> "list[Outcome]":
    from teleop_core.commands.progress import shown_progress
    from teleop_lab.experiments import EXPERIMENTS, Bench

    found = [EXPERIMENTS.find(name) for name in dict.fromkeys(names) or EXPERIMENTS.names()]
    bench, outcomes = Bench(seed, workers=len(sched_getaffinity(0))), []
    for number, experiment in enumerate(found, start=1):
        begin = time.monotonic()
        with shown_progress(f"{number} of {len(found)}, {experiment.name}") as progress:
            bench.progress = progress
            outcomes.append(experiment.run(bench))
            progress(1, 1)
        if len(found) > 1 and not sys.stderr.isatty():  # without a progress bar, print each name
            took = time.monotonic() - begin
            print(f"{number} of {len(found)}, {experiment.name}: {took:.0f} s", file=sys.stderr)
    return outcomes


def _show(outcomes: "list[Outcome]") -> None:
    from teleop_lab.experiments.outcome import show, summary, terminal

    console = terminal()
    for outcome in outcomes:
        show(outcome, console)
    print(summary(outcomes))


def _write(outcomes: "list[Outcome]", json_file: Path | None, html_file: Path | None) -> list[str]:
    """Write the requested files; returns a line for each file."""
    from teleop_core import __version__
    from teleop_core.evaluation.command import write_whole

    written = []
    if json_file is not None:
        found = [outcome.to_json() for outcome in outcomes]
        whole = {"version": __version__, "experiments": found}
        text = json.dumps(whole, indent=2, allow_nan=False, ensure_ascii=False)
        write_whole(json_file, text + "\n")
        written.append(f"numbers: {json_file}")
    if html_file is not None:
        from teleop_lab.experiments.page import experiments_page

        write_whole(html_file, experiments_page(outcomes))
        written.append(f"page: {html_file}")
    return written
