"""``teleop experiment``: the sources' experiments, repeated on our models and compared with the printed results."""

import sys
import time
from os import sched_getaffinity
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from teleop_core.base.errors import UnknownNameError

if TYPE_CHECKING:
    from teleop_lab.experiments import Outcome

ALL = "all"


def experiment(
    *names: Annotated[str, Parameter(name="NAME")], json: Path | None = None, html: Path | None = None, seed: int = 1
) -> None:
    """Repeat what the sources did, and print predicted beside published figures.

    Without a name the experiments are listed; `all` runs every one, in five to seven minutes:

        teleop experiment resolution                     # a table: published, predicted, difference
        teleop experiment master_slave gravity --seed 5  # other hands; sessions both need run once
        teleop experiment all --html experiments.html    # one page with the source's figures
        teleop experiment all --json experiments.json    # every number, exact

    A mark says whether prediction and publication agree, ✓, or not, ✗, not whether a number is small.

    Args:
        names: Names of experiments, or `all`; without a name, all are listed.
        json: Write all numbers as JSON.
        html: Write one page with figures.
        seed: Seed of the first simulated hand.
    """
    from teleop_core.evaluation.command import check_places
    from teleop_lab.experiments import EXPERIMENTS, list_experiments

    if not names and json is None and html is None:
        for name, title in list_experiments().items():
            print(f"{name:16} {title}")
        return
    for name in names:
        if name != ALL and name not in EXPERIMENTS.names():
            raise UnknownNameError("experiment", name, (*EXPERIMENTS.names(), ALL))
    check_places(json, html)
    is_all = not names or ALL in names
    outcomes = _outcomes(() if is_all else names, seed)
    # Files are written before the tables are printed, because a reader of the tables may close the pipe early.
    written = _write(outcomes, json, html)
    _show(outcomes)
    print("".join(f"{line}\n" for line in written), end="")


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
    import json

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
        from teleop_lab.experiments.results_page import experiments_page

        write_whole(html_file, experiments_page(outcomes))
        written.append(f"page: {html_file}")
    return written
