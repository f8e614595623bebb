"""``teleop study``: sessions over named values of parameters; an interrupted study can be continued."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from teleop_core.base.cluster import connect
from teleop_lab.commands.outputs import Outputs


def study(
    file: Annotated[Path, Parameter(name="FILE.yaml")],
    /,
    *,
    store: Path | None = None,
    scheduler: str | None = None,
    recordings: Path | None = None,
    explain: bool = False,
    outputs: Outputs = Outputs(),
) -> int:
    """Run sessions over named values of parameters and seeds, and compare their scores.

    A study is a YAML file:

        scenario: point
        seeds: 10                                       how many, from 1 on, or a list
        set: {operator.tremor_amplitude: 0.0}           the same in all sessions
        sweep:                                          a dimension each
          display.latency: [0.033, 0.133, 0.333]
          coarse_gain: [0.5, 1.0]
        metrics: [task.time_s, task.error_share]        keys of scores, as `teleop evaluate --json`
        duration: 20.0                                  of each session [s]
        parts: [mine.py]                                files of your own parts, beside this one

    Then:

        teleop study delay.yaml --explain      # how many sessions, how long, how many bytes
        teleop study delay.yaml --store delay  # killed and called again, it goes on
        teleop study delay.yaml --store delay --html delay.html --csv delay.csv

    Args:
        file: YAML file of the study: parameter values, seeds and scores.
        store: Directory that keeps results; sessions whose result is there are not run again.
        scheduler: Address of a Dask scheduler, to run on its workers.
        recordings: Directory for a recording of each session.
        explain: Print the sessions and their cost, and run nothing.
        outputs: Files with the scores.
    """
    from teleop_core.commands.progress import shown_progress
    from teleop_lab.studies import read_study
    from teleop_lab.studies.study_page import study_page
    from teleop_lab.studies.summary import study_table

    wanted = read_study(file)
    outputs.check()
    explained = wanted.explain(store, outputs.jobs)
    print(explained)
    if explain:
        return 0
    client = connect(scheduler) if scheduler else None
    with shown_progress(file.stem) as progress:
        found = wanted.run(store, jobs=outputs.jobs, client=client, recordings=recordings, progress=progress)
    print(study_table(wanted, found))
    failed = [str(error) for error in found["error"].values.ravel() if error]
    if failed:
        print(f"{len(failed)} of {explained.sessions} failed; first: {failed[0]}")
    outputs.write(found.to_dataframe().to_csv, lambda: study_page(wanted, found, file.stem))
    return 1 if failed else 0
