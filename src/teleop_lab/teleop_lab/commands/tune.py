"""``teleop tune``: the values of some parameters with which a score is best."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from teleop_lab.commands.outputs import Outputs

if TYPE_CHECKING:
    from teleop_lab.studies.tuning import Tuned, Tuning

_SHOWN = 5


def tune(
    file: Annotated[Path, Parameter(name="FILE.yaml")],
    /,
    *,
    store: Path | None = None,
    trials: int = 30,
    outputs: Outputs = Outputs(),
) -> None:
    """Search the values of parameters with which a score is best.

    A search is a YAML file:

        scenario: point
        seeds: 3                                        the score is the mean over them; 2 or more tell values apart
        set: {display.latency: 0.3}                     the same in all sessions
        tune:                                           a range, or a list of choices
          coarse_gain: {low: 0.1, high: 1.0, log: true}
          tremor.kind: [none, low_pass]
        minimize: task.time_s                           or maximize: a key of a score

    Then:

        teleop tune config/studies/scale.yaml --store best  # killed and called again, it goes on
        teleop tune config/studies/scale.yaml --store best --trials 60 --html best.html

    Args:
        file: YAML file of the search: parameters, their ranges, and the score.
        store: Directory that keeps results; sessions whose result is there are not run again.
        trials: Number of sets of values to try.
        outputs: Files with the trials.
    """
    from teleop_core.commands.progress import shown_progress
    from teleop_lab.studies.tuning import read_tuning
    from teleop_lab.studies.tuning_page import tuning_page

    tuning = read_tuning(file)
    outputs.check()
    with shown_progress(file.stem) as progress:
        tuned = tuning.run(store, trials=trials, jobs=outputs.jobs, progress=progress)
    print(_table(tuning, tuned))
    failed = [trial.error for trial in tuned.trials if trial.error]
    if failed:
        print(f"{len(failed)} of {len(tuned.trials)} trials failed; first: {failed[0]}")
    print("best: --set " + " ".join(f"{n}={_text(v)}" for n, v in tuned.best.values.items()))
    print(tuned.told(tuning.metric))
    outputs.write(lambda: _csv(tuning, tuned), lambda: tuning_page(tuning, tuned, file.stem))


def _text(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _table(tuning: "Tuning", tuned: "Tuned") -> str:
    import numpy as np

    from teleop_lab.studies.summary import mean_of, table_text

    scored = [(n, trial) for n, trial in enumerate(tuned.trials, 1) if trial.score is not None]
    sign = -1.0 if tuning.is_largest else 1.0
    scored.sort(key=lambda pair: sign * (pair[1].score or 0.0))
    rows = [
        [str(n), *(_text(value) for value in trial.values.values()), str(mean_of(np.array(trial.scores)))]
        for n, trial in scored[:_SHOWN]
    ]
    return table_text(["trial", *tuning.searched, tuning.metric], rows)


def _csv(tuning: "Tuning", tuned: "Tuned") -> str:
    import csv
    from io import StringIO

    text = StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(["trial", *tuning.searched, tuning.metric, "error"])
    for n, trial in enumerate(tuned.trials, 1):
        lines.writerow([n, *trial.values.values(), trial.score, trial.error])
    return text.getvalue()
