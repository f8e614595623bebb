"""Experiments: the sources' experiments, repeated on our models; the results are shown beside the printed ones.

>>> from teleop_lab import experiments
>>> outcome = experiments.run("resolution")
>>> outcome.row("tip, all axes").predicted
>>> print(outcome)
"""

from collections.abc import Callable, Iterable

from teleop_lab.experiments.bench import SEEDS, Bench, ScoredSession, mean, pooled
from teleop_lab.experiments.comparison import EXACT, Comparison, Findings, Tolerance, absolute, factor, percent
from teleop_lab.experiments.experiment import EXPERIMENTS, Experiment, register_experiment
from teleop_lab.experiments.outcome import Outcome

__all__ = [
    "EXACT",
    "EXPERIMENTS",
    "SEEDS",
    "Bench",
    "Comparison",
    "Experiment",
    "Findings",
    "Outcome",
    "ScoredSession",
    "Tolerance",
    "absolute",
    "factor",
    "list_experiments",
    "mean",
    "percent",
    "pooled",
    "register_experiment",
    "run",
    "run_several",
]


def list_experiments() -> dict[str, str]:
    """Titles of all experiments, by name."""
    return {name: EXPERIMENTS.find(name).title for name in EXPERIMENTS}


def run(name: str, *, seed: int = 1, bench: Bench | None = None) -> Outcome:
    """Run one experiment.

    Args:
        name: One of :func:`list_experiments`.
        seed: First seed of all random numbers of the experiment.
        bench: Bench on which the sessions run; None: a new bench with that seed. Experiments on one bench run a session
            that they share only once.

    Returns:
        Rows of published and predicted numbers, and plots.

    Raises:
        UnknownNameError: No experiment has the name; the message lists all names.
        ParameterError: The seed is negative.
    """
    return EXPERIMENTS.find(name).run(bench or Bench(seed))


def run_several(
    names: Iterable[str] = (),
    *,
    bench: Bench | None = None,
    began: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> list[Outcome]:
    """Run experiments one after the other; a session that several experiments need runs only once.

    Args:
        names: Names of experiments; a repeated name runs once. Without names, all experiments run.
        bench: Bench on which the sessions of the experiments run.
        began: Called when an experiment begins, with its name, the number of finished experiments, and the number of
            all.

    Raises:
        UnknownNameError: A name is unknown; raised before the first experiment runs.
    """
    wanted = tuple(dict.fromkeys(names)) or EXPERIMENTS.names()
    found = [EXPERIMENTS.find(name) for name in wanted]
    shared = bench or Bench()
    outcomes = []
    for number, experiment in enumerate(found):
        began(experiment.name, number, len(found))
        outcomes.append(experiment.run(shared))
    return outcomes
