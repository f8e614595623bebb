"""``teleop study``: sessions over named values of parameters; an interrupted study can be continued."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import SessionError
from teleop_core.commands.arguments import command
from teleop_lab.commands.outputs import add_study, check_outputs, write_outputs

if TYPE_CHECKING:
    from distributed import Client

_EPILOG = """\
a study is a YAML file:
  scenario: point
  seeds: 10                                       how many, from 1 on, or a list
  set: {operator.tremor_amplitude: 0.0}           the same in all sessions
  sweep:                                          a dimension each
    display.latency: [0.033, 0.133, 0.333]
    coarse_gain: [0.5, 1.0]
  metrics: [task.time_s, task.error_share]        keys of scores, as `teleop evaluate --json`
  duration: 20.0                                  of each session [s]
  parts: [mine.py]                                files of your own parts, beside this one
then:
  teleop study delay.yaml --explain               how many sessions, how long, how many bytes
  teleop study delay.yaml --store delay           killed and called again, it goes on
  teleop study delay.yaml --store delay --html delay.html --csv delay.csv
"""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "run sessions over named values of parameters and seeds, and compare their scores"
    parser = command(commands, "study", _run, text, _EPILOG)
    add_study(parser, "YAML file of the study: parameter values, seeds and scores", "session")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="run on the workers of this Dask scheduler")
    parser.add_argument("--recordings", type=Path, metavar="DIR", help="directory for a recording of each session")
    parser.add_argument("--explain", action="store_true", help="print the sessions and their cost, and run nothing")


def _run(arguments: argparse.Namespace) -> int:
    from teleop_core.commands.progress import shown_progress
    from teleop_lab.studies import read_study
    from teleop_lab.studies.page import study_page
    from teleop_lab.studies.summary import study_table

    study = read_study(arguments.file)
    check_outputs(arguments)
    explained = study.explain(arguments.store, arguments.jobs)
    print(explained)
    if arguments.explain:
        return 0
    client = _client(arguments.scheduler) if arguments.scheduler else None
    with shown_progress(arguments.file.stem) as progress:
        found = study.run(
            arguments.store, jobs=arguments.jobs, client=client, recordings=arguments.recordings, progress=progress
        )
    print(study_table(study, found))
    failed = [str(error) for error in found["error"].values.ravel() if error]
    if failed:
        print(f"{len(failed)} of {explained.sessions} failed; first: {failed[0]}")
    write_outputs(arguments, found.to_dataframe().to_csv, lambda: study_page(study, found, arguments.file.stem))
    return 1 if failed else 0


def _client(address: str) -> "Client":
    """Connect to a Dask scheduler.

    Raises:
        SessionError: The address has no scheduler, or Dask is not installed.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise SessionError("--scheduler needs Dask: pip install teleop_lab[dask]") from error
    try:
        return Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise SessionError(f"no Dask scheduler answers at {address}") from error
