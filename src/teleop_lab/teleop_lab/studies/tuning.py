"""Tuning: the values of some parameters with which a score is best, found by Optuna."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from teleop_core.base.errors import ParameterError, SessionError, TeleopError
from teleop_core.session import api, runner
from teleop_lab.studies.point import PointResult
from teleop_lab.studies.store import Store
from teleop_lab.studies.study import Study, common, is_number, named, read_entries
from teleop_lab.studies.summary import least_difference
from teleop_lab.studies.workers import in_processes

_KEYS = ("scenario", "seeds", "set", "tune", "minimize", "maximize", "parts", "duration")
_TOGETHER = 5
"""Number of trials whose values are chosen together, before any of them runs, so that several processes can run them.
It is not an option, because the result must not depend on the machine."""
_ROUNDING = 1e-12
"""Relative difference of two means that is no difference."""


class SearchRange(NamedTuple):
    """Range in which a parameter is searched. If ``low`` and ``high`` are integers, only integers are tried.

    Attributes:
        low: Least value.
        high: Greatest value.
        is_log: Whether the search is uniform in the logarithm.
    """

    low: float
    high: float
    is_log: bool = False


class Trial(NamedTuple):
    """Result of one set of parameter values.

    Attributes:
        values: Values by parameter.
        scores: Score of each seed; empty if a session failed or has no such score.
        error: Reason why the scores are missing.
    """

    values: Mapping[str, api.Setting]
    scores: tuple[float, ...]
    error: str

    @property
    def score(self) -> float | None:
        """Mean over the seeds; None without scores."""
        return sum(self.scores) / len(self.scores) if self.scores else None


@dataclass(frozen=True)
class Tuned:
    """Result of a search.

    Attributes:
        trials: All trials, in their order.
        best: The best trial.
        least: Least difference from the best score that is told from chance; infinite with one seed.
        alike: Trials that cannot be told from the best, with the best itself.
    """

    trials: tuple[Trial, ...]
    best: Trial
    least: float
    alike: tuple[Trial, ...]

    @staticmethod
    def of(trials: Sequence[Trial], *, is_largest: bool) -> "Tuned":
        """Result of trials of which at least one has a score."""
        scored = [trial for trial in trials if trial.score is not None]
        means = [trial.score or 0.0 for trial in scored]
        top = max(means) if is_largest else min(means)
        least = least_difference(np.array([trial.scores for trial in scored]))
        near = least + _ROUNDING * abs(top)
        alike = tuple(trial for trial, mean in zip(scored, means, strict=True) if abs(mean - top) <= near)
        return Tuned(tuple(trials), scored[means.index(top)], least, alike)

    def told(self, metric: str) -> str:
        """Sentence that says from which other values the best values cannot be told, and how well they are known."""
        count = len([trial for trial in self.trials if trial.score is not None])
        if math.isinf(self.least):
            return f"One seed tells no values apart; the interval of the best values needs 2 seeds or more ({metric})."
        if len(self.alike) == 1:
            return f"All other values tried are worse: {metric} differs by more than {self.least:.2g} (95 %)."
        spans = ", ".join(f"{name} {_span([one.values[name] for one in self.alike])}" for name in self.best.values)
        return (
            f"Cannot be told apart from the best: {len(self.alike) - 1} of {count - 1} other trials, whose {metric} "
            f"differs by less than {self.least:.2g} (95 %). Interval of the best: {spans}."
        )


def _span(values: Sequence[api.Setting]) -> str:
    """Range of values that are numbers, or the list of other values."""
    numbers = [float(value) for value in values if is_number(value)]  # type: ignore[arg-type]
    if len(numbers) == len(values):
        return f"{min(numbers):.3g} … {max(numbers):.3g}"
    return " or ".join(dict.fromkeys(map(str, values)))


@dataclass(frozen=True)
class Tuning:
    """Search for the values of some parameters with which a score is best.

    Attributes:
        scenario: One of ``teleop scenarios``; None for the defaults.
        searched: A :class:`SearchRange` or a list of choices for each parameter, named as on the command line.
        seeds: Seeds of the hands over which a score is averaged; values that suit only one hand are useless.
        metric: Key of the score, such as ``task.time_s``.
        is_largest: Whether the largest score is the best one.
        settings: Parameters that are the same in all sessions.
        parts: Files that register parts of your own.

    Raises:
        TeleopError: A range, parameter, key of a score or part is wrong; no session was run.
    """

    scenario: str | None
    searched: Mapping[str, SearchRange | Sequence[api.Setting]]
    seeds: Sequence[int]
    metric: str
    is_largest: bool = False
    settings: Mapping[str, api.Setting] = field(default_factory=dict)
    parts: Sequence[Path] = ()

    def __post_init__(self) -> None:
        if not self.searched:
            raise ParameterError("tune", {}, "at least one parameter")
        for name, where in self.searched.items():
            if isinstance(where, SearchRange) and not (
                math.isfinite(where.high - where.low) and where.low < where.high
            ):
                raise ParameterError(f"tune of {name}", tuple(where[:2]), "low below high")
            if isinstance(where, SearchRange) and where.is_log and where.low <= 0.0:
                raise ParameterError(f"low of {name}", where.low, "above 0 with log")
        study = self.study()
        for name, values in study.swept.items():  # each value separately, so that an error names its parameter
            for value in values:
                first = {other: ends[0] for other, ends in study.swept.items()}
                study.points_at({**first, name: value})

    def study(self) -> Study:
        """Study over the lowest and highest values of all ranges; the search uses its store."""
        ends = {
            name: where[:2] if isinstance(where, SearchRange) else tuple(where) for name, where in self.searched.items()
        }
        return Study(self.scenario, ends, self.seeds, (self.metric,), self.settings, self.parts)

    def run(
        self,
        store: Path | str | None = None,
        *,
        trials: int = 30,
        jobs: int | None = None,
        progress: Callable[[int, int], None] = runner.silent,
    ) -> Tuned:
        """Run trials; the values of each trial depend on the scores of earlier trials.

        If a search with a store is killed and continued, it tries the same values as an uninterrupted search. A search
        with more trials continues after the stored trials.

        Args:
            store: Directory of the results, made if it is missing; None keeps them in memory.
            trials: Number of trials.
            jobs: Processes; None: as many as processors.
            progress: Called with the number of finished trials, and the number of all.

        Raises:
            SessionError: No trial has a score, Optuna is missing, or the store belongs to another search.
            ParameterError: ``trials`` is less than 1.
        """
        if trials < 1:
            raise ParameterError("trials", trials, "1 or more")
        optuna = _optuna()
        study = self.study()
        kept = study.store(store)
        # The random numbers are the same in each call, so equal results lead to equal proposals.
        search = optuna.create_study(
            direction="maximize" if self.is_largest else "minimize", sampler=optuna.samplers.TPESampler(seed=0)
        )
        done: list[Trial] = []
        while len(done) < trials:
            progress(len(done), trials)
            asked = [search.ask() for _ in range(min(_TOGETHER, trials - len(done)))]
            chosen = [self._values(trial) for trial in asked]
            for trial, found in zip(asked, self._scores(study, chosen, kept, jobs), strict=True):
                fail = optuna.trial.TrialState.FAIL if found.score is None else None
                search.tell(trial, found.score, state=fail)
                done.append(found)
        progress(trials, trials)
        if all(trial.score is None for trial in done):
            raise SessionError(f"no trial has {self.metric}; first: {done[0].error}")
        return Tuned.of(done, is_largest=self.is_largest)

    def _values(self, trial: Any) -> dict[str, api.Setting]:
        found: dict[str, api.Setting] = {}
        for name, where in self.searched.items():
            if not isinstance(where, SearchRange):
                # Optuna supports only plain values, so a list is represented by its index.
                found[name] = where[trial.suggest_categorical(name, list(range(len(where))))]
            elif isinstance(where.low, int) and isinstance(where.high, int):
                found[name] = trial.suggest_int(name, where.low, where.high, log=where.is_log)
            else:
                found[name] = trial.suggest_float(name, where.low, where.high, log=where.is_log)
        return found

    def _scores(self, study: Study, chosen: list[dict[str, api.Setting]], kept: Store, jobs: int | None) -> list[Trial]:
        """Scores of the chosen values; sessions that are missing in the store are run."""
        points, refused = [], []
        for values in chosen:
            try:
                points.append(study.points_at(values))
                refused.append("")
            except TeleopError as error:
                points.append([])
                refused.append(" ".join(str(error).split()))
        to_run = {point.name: point for own in points for point in own if kept.reason(point)}
        for result in in_processes(list(to_run.values()), study.metrics, study.parts, jobs, kept.folder):
            kept.take(result)
        found = []
        for values, own, why in zip(chosen, points, refused, strict=True):
            results = [kept.result(point) for point in own]
            found.append(self._trial(values, [one for one in results if one is not None], why))
        return found

    def _trial(self, values: dict[str, api.Setting], results: list[PointResult], error: str) -> Trial:
        found = [one.scores.get(self.metric) for one in results]
        error = error or next((one.error for one in results if one.error), "")
        if error or None in found:
            return Trial(values, (), error or f"a recording without {self.metric}")
        return Trial(values, tuple(map(float, found)), "")  # type: ignore[arg-type]


def _optuna() -> Any:
    try:
        import optuna
    except ImportError as error:
        raise SessionError("tuning needs Optuna: pip install teleop_lab[tune]") from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna


def read_tuning(path: Path | str) -> Tuning:
    """Read a search from a YAML file.

    The entries are scenario, set, tune, minimize or maximize, seeds, parts and duration.

    A parameter below ``tune`` is a list of choices, or a range such as ``{low: 0.1, high: 1.0, log: true}``.

    Raises:
        TeleopError: The file cannot be read, or does not describe a search.
    """
    content = read_entries(path, _KEYS)
    metrics = [(word, content[word]) for word in ("minimize", "maximize") if word in content]
    if len(metrics) != 1:
        raise ParameterError("minimize, maximize", dict(metrics), "one of them: key of a score")
    searched: dict[str, SearchRange | Sequence[api.Setting]] = {}
    for name, where in named(content, "tune").items():
        searched[name] = _range(name, where)
    ((word, metric),) = metrics
    return Tuning(searched=searched, metric=str(metric), is_largest=word == "maximize", **common(content, Path(path)))


def _range(name: str, where: object) -> SearchRange | Sequence[api.Setting]:
    if isinstance(where, list):
        return where
    hint = "a list of choices, or {low: 0.1, high: 1.0}, with log: true for equal ratios"
    if not isinstance(where, dict) or not {"low", "high"} <= set(where) <= {"low", "high", "log"}:
        raise ParameterError(f"tune of {name}", where, hint)
    low, high = where["low"], where["high"]
    if not all(isinstance(x, int | float) and not isinstance(x, bool) for x in (low, high)):
        raise ParameterError(f"tune of {name}", where, hint)
    return SearchRange(low, high, bool(where.get("log", False)))
