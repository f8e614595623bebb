"""Experiment: an experiment of a source; its function takes a bench and returns findings."""

from collections.abc import Callable
from dataclasses import dataclass

from teleop_core.base import PartError, Registry
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import Findings
from teleop_lab.experiments.outcome import Outcome

_PLACE = "teleop_lab.experiments"


@dataclass(frozen=True)
class Experiment:
    """An experiment of a source, compared with the printed results.

    Attributes:
        name: Name of the experiment for ``teleop experiment``.
        title: One line that describes the experiment.
        source: Source of the published numbers.
        measure: Function that runs the experiment. It gets its sessions from the bench, which runs each session only
            once.
    """

    name: str
    title: str
    source: str
    measure: Callable[[Bench], Findings]

    def run(self, bench: Bench) -> Outcome:
        """Run the experiment.

        Raises:
            PartError: The function ``measure`` did not return :class:`Findings`.
        """
        found = self.measure(bench)
        if not isinstance(found, Findings):
            text = f"one whose measure returns Findings, not a {type(found).__name__}"
            raise PartError("experiment", self.name, text)
        return Outcome(
            self.name, self.title, self.source, bench.seed, tuple(found.rows), tuple(found.figures), tuple(found.notes)
        )


def _checked(name: str, part: object) -> Experiment:
    if not isinstance(part, Experiment):
        raise PartError("experiment", name, f"an Experiment, not a {type(part).__name__}")
    if not callable(part.measure):
        raise PartError("experiment", name, "one whose measure can be called with a Bench")
    return part


EXPERIMENTS: Registry[Experiment] = Registry(
    "experiment",
    "experiments",
    {
        "resolution": f"{_PLACE}.resolution:RESOLUTION",
        "tendons": f"{_PLACE}.tendons:TENDONS",
        "poses": f"{_PLACE}.poses:POSES",
        "workspace": f"{_PLACE}.workspace:WORKSPACE",
        "filter": f"{_PLACE}.reference_filter:FILTER",
        "precision": f"{_PLACE}.precision:PRECISION",
        "repeatability": f"{_PLACE}.precision:REPEATABILITY",
        "responses": f"{_PLACE}.responses:RESPONSES",
        "accuracy": f"{_PLACE}.accuracy:ACCURACY",
        "master_slave": f"{_PLACE}.master_slave:MASTER_SLAVE",
        "controllers": f"{_PLACE}.controllers:CONTROLLERS",
        "gravity": f"{_PLACE}.gravity:GRAVITY",
        "robustness": f"{_PLACE}.robustness:ROBUSTNESS",
        "shares": f"{_PLACE}.shares:SHARES",
        "points24": f"{_PLACE}.points24:POINTS24",
        "stability": f"{_PLACE}.stability:STABILITY",
        "zwidth": f"{_PLACE}.zwidth:ZWIDTH",
        "transparency": f"{_PLACE}.transparency:TRANSPARENCY",
        "drift": f"{_PLACE}.drift:DRIFT",
        "puncture": f"{_PLACE}.puncture:PUNCTURE",
        "fitts": f"{_PLACE}.fitts:FITTS",
        "operator_models": f"{_PLACE}.operator_models:OPERATOR_MODELS",
        "blind": f"{_PLACE}.blind:BLIND",
        "delay": f"{_PLACE}.delay:DELAY",
        "scaling_under_delay": f"{_PLACE}.delay:SCALING_UNDER_DELAY",
        "move_and_wait": f"{_PLACE}.move_and_wait:MOVE_AND_WAIT",
        "uva": f"{_PLACE}.uva:UVA",
        "mma_frames": f"{_PLACE}.mma_frames:MMA_FRAMES",
        "mma_balance": f"{_PLACE}.mma_spring:MMA_BALANCE",
        "hybrid": f"{_PLACE}.hybrid:HYBRID",
        "parallel_robots": f"{_PLACE}.parallel_robots:PARALLEL_ROBOTS",
    },
    _checked,
    package="teleop_lab",
)
"""All experiments by name, in the order in which ``all`` runs them."""


def register_experiment(name: str, experiment: Experiment, *, replace: bool = False) -> Experiment:
    """Add an experiment until the program ends; see :meth:`Registry.add`."""
    return EXPERIMENTS.add(name, experiment, replace=replace)
