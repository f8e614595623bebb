"""Summary: means over the seeds with intervals, and the effect of each value in paired comparisons."""

import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.special import stdtrit

from teleop_core.kernels.geometry import Array

if TYPE_CHECKING:
    import xarray

    from teleop_lab.studies.study import Study

_DRAWS = 2000
_TAIL = 0.025  # chance that an interval is too high, and that it is too low
_SHARE = (100.0 * _TAIL, 100.0 * (1.0 - _TAIL))


class Mean(NamedTuple):
    """A mean or another statistic, and its 95 % interval; NaN without values."""

    value: float
    low: float
    high: float
    samples: int

    @property
    def is_told(self) -> bool:
        """Whether a difference can be told from none: the interval of two or more samples does not include zero."""
        return self.samples > 1 and not self.low <= 0.0 <= self.high

    def __str__(self) -> str:
        if not self.samples:
            return "–"
        if self.samples == 1:
            return f"{self.value:.4g}"
        return f"{self.value:.4g} ({self.low:.4g} … {self.high:.4g})"


def mean_of(values: Array) -> Mean:
    """Mean of values (N,) with its interval, as :func:`change_of`; if no value is negative, it begins at 0 or above."""
    found = change_of(values)
    return found._replace(low=max(found.low, 0.0)) if (_known(values) >= 0.0).all() else found


def change_of(changes: Array, questions: int = 1) -> Mean:
    """Mean of differences (N,) with its interval; values that are not numbers are ignored.

    Args:
        changes: Independent differences.
        questions: Number of intervals of which the largest effect is taken (Bonferroni); more make each wider.

    Source:
        Student 1908. With five normal values, the bootstrap of Efron 1979 contains the true mean in 85 % of all cases.
    """
    known = _known(changes)
    mean = float(known.mean()) if len(known) else float("nan")
    if len(known) < 2:
        return Mean(mean, mean, mean, len(known))
    half = float(-stdtrit(len(known) - 1, _TAIL / questions) * known.std(ddof=1) / math.sqrt(len(known)))
    return Mean(mean, mean - half, mean + half, len(known))


def median_of(values: Array) -> Mean:
    """Median of values (N,) with its interval; values that are not numbers are ignored.

    Source:
        Efron 1979: percentiles of the medians of resampled values; the random numbers are the same in each call.
    """
    known = _known(values)
    if len(known) < 2:
        return change_of(known)
    low, high = np.percentile(_drawn(known, 0), _SHARE)
    return Mean(float(np.median(known)), float(low), float(high), len(known))


def apart(values: Array, others: Array) -> Mean:
    """Median of some values (N,) minus that of others (M,); both are resampled independently."""
    one, other = _known(values), _known(others)
    count = min(len(one), len(other))
    if not count:
        return change_of(np.empty(0))
    value = float(np.median(one) - np.median(other))
    low, high = np.percentile(_drawn(one, 0) - _drawn(other, 1), _SHARE)
    return Mean(value, float(low), float(high), count)


def _known(values: Array) -> Array:
    found = np.asarray(values, np.float64)
    return found[np.isfinite(found)]


def _drawn(known: Array, seed: int) -> Array:
    """Median of each sample that is resampled from values (N,)."""
    draws = np.random.default_rng(seed).integers(0, len(known), (_DRAWS, len(known)))
    return np.asarray(np.median(known[draws], axis=1))


def least_difference(scores: Array) -> float:
    """Least difference of two means that tells the best condition from another one, with a certainty of 95 % for all.

    The seeds are blocks: what a seed adds to all scores does not count. The spread that is left is assumed to be the
    same in all conditions.

    Args:
        scores: Scores by condition and seed, shape (N, M).

    Returns:
        The difference, in the unit of the scores; 0 for one condition, infinite for one seed.

    Source:
        Hsu 1981, comparisons with the best, by Bonferroni's inequality for the N - 1 other conditions.
    """
    count, seeds = scores.shape
    if count < 2:
        return 0.0
    if seeds < 2:
        return float("inf")
    free = (count - 1) * (seeds - 1)
    left = scores - scores.mean(axis=1, keepdims=True) - scores.mean(axis=0) + scores.mean()
    spread = np.sqrt((left * left).sum() / free)
    return float(-stdtrit(free, 0.05 / (count - 1)) * spread * np.sqrt(2.0 / seeds))


def conditions(study: "Study", found: "xarray.Dataset") -> "Iterator[tuple[dict[str, Any], Any]]":
    """Yield each combination of the swept values with its part of the data set.

    The seed is the only dimension of this part.
    """
    places = [range(len(values)) for values in study.swept.values()]
    for indices in product(*places):
        at = dict(zip(study.swept, indices, strict=True))
        values = {name: study.swept[name][i] for name, i in at.items()}
        yield values, found.isel(at)


def differences(study: "Study", found: "xarray.Dataset", metric: str) -> dict[str, list[Mean]]:
    """Difference between each value of a parameter and its first value.

    Sessions are paired by seed and all other values. Each seed gives one difference, the mean of its pairs; the
    interval is over the seeds.
    """
    changes: dict[str, list[Mean]] = {}
    for name, values in study.swept.items():
        first = found[metric].isel({name: 0})
        pairs = [found[metric].isel({name: i}) - first for i in range(1, len(values))]
        changes[name] = [change_of(_by_seed(pair)) for pair in pairs]
    return changes


class Interplay(NamedTuple):
    """How much the effect of one parameter depends on another one.

    Attributes:
        values: Value of each parameter, compared with its first value, where the dependence is largest.
        change: Effect of the first parameter at the second value of the other, minus that at its first value.
    """

    values: tuple[Any, Any]
    change: Mean


def interplay(study: "Study", found: "xarray.Dataset", metric: str, pair: tuple[str, str]) -> Interplay:
    """Largest interaction of two parameters that have two or more values each; its interval covers the choice."""
    one, other = pair
    places = list(product(range(1, len(study.swept[one])), range(1, len(study.swept[other]))))
    asked = []
    for i, j in places:
        far, near = (found[metric].isel({one: i, other: k}) - found[metric].isel({one: 0, other: k}) for k in (j, 0))
        change = change_of(_by_seed(far - near), len(places))
        asked.append(Interplay((study.swept[one][i], study.swept[other][j]), change))
    return max(asked, key=lambda each: (each.change.is_told, abs(np.nan_to_num(each.change.value))))


def _by_seed(values: Any) -> Array:
    """Mean over the swept parameters for each seed (or participant)."""
    rows = values.values.reshape(-1, values.shape[-1]).T  # the seed is the last dimension
    return np.array([np.mean(row[np.isfinite(row)]) if np.isfinite(row).any() else np.nan for row in rows])


def study_table(study: "Study", found: "xarray.Dataset") -> str:
    """Means over the seeds with 95 % intervals, as text."""
    heads, rows = [], []
    for name in (*study.swept, *study.metrics):
        unit = found[name].attrs.get("units", "1") if name in study.metrics else "1"
        heads.append(name if unit == "1" else f"{name} [{unit}]")
    for values, part in conditions(study, found):
        cells = [str(value) for value in values.values()]
        rows.append([*cells, *(str(mean_of(part[metric].values)) for metric in study.metrics)])
    return table_text(heads, rows)


def table_text(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as text."""
    from io import StringIO

    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(*heads, box=box.SIMPLE)
    for row in rows:
        table.add_row(*row)
    text = StringIO()
    Console(file=text, width=max(100, 26 * len(heads))).print(table)
    return text.getvalue().rstrip()
