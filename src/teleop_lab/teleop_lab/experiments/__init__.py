"""Experiments: what the sources did, run on our models, beside the figures they printed.

>>> from teleop_lab import experiments
>>> outcome = experiments.run("resolution")
>>> outcome.row("tip, all axes").predicted
>>> print(outcome)
"""

from collections.abc import Callable, Iterable

from teleop_lab.experiments.bench import SEEDS, Bench, Session, mean, pooled
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
    "Session",
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
    """Names of all experiments, each with its title."""
    return {name: EXPERIMENTS.find(name).title for name in EXPERIMENTS}


def run(name: str, *, seed: int = 1, bench: Bench | None = None) -> Outcome:
    """Run one experiment.

    Args:
        name: One of :func:`list_experiments`.
        seed: First seed of everything random in it.
        bench: Bench on which its sessions run, in place of a new bench with that seed. Experiments that share a bench
            run a common session only once.

    Returns:
        Rows of numbers, published and predicted, and plots.

    Raises:
        UnknownNameError: There is no such experiment; the alternatives are listed.
        ParameterError: The seed is negative.
    """
    return EXPERIMENTS.find(name).run(bench or Bench(seed))


def run_several(
    names: Iterable[str] = (),
    *,
    bench: Bench | None = None,
    began: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> list[Outcome]:
    """Run experiments one after the other, with each session run once.

    Args:
        names: Names, each taken once; all experiments if there are none.
        bench: Bench on which the sessions of the experiments run.
        began: Called when an experiment begins, with its name, the number of finished experiments, and the number of
            all.

    Raises:
        UnknownNameError: There is no such experiment, found before any of them runs.
    """
    wanted = tuple(dict.fromkeys(names)) or EXPERIMENTS.names()
    found = [EXPERIMENTS.find(name) for name in wanted]
    shared = bench or Bench()
    outcomes = []
    for number, experiment in enumerate(found):
        began(experiment.name, number, len(found))
        outcomes.append(experiment.run(shared))
    return outcomes
