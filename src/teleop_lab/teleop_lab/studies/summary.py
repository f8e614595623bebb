"""Summary: means over the seeds with intervals, and the effect of each value in paired comparisons."""

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from teleop_core.kernels.geometry import Array

if TYPE_CHECKING:
    import xarray

    from teleop_lab.studies.study import Study

_DRAWS = 2000
_SHARE = (2.5, 97.5)


class Mean(NamedTuple):
    """A mean or another statistic, and its 95 % bootstrap interval; NaN without values."""

    value: float
    low: float
    high: float
    samples: int

    def __str__(self) -> str:
        if not self.samples:
            return "–"
        if self.samples == 1:
            return f"{self.value:.4g}"
        return f"{self.value:.4g} ({self.low:.4g} … {self.high:.4g})"


Statistic = Callable[..., Any]
"""Statistic of samples along an axis, such as ``np.mean``."""


def mean_of(values: Array) -> Mean:
    """Mean of values (N,) with its interval; values that are not numbers are ignored.

    Source:
        Efron 1979: percentiles of the means of resampled values; the random numbers are the same in each call.
    """
    return _figure(values, np.mean)


def median_of(values: Array) -> Mean:
    """Median of values (N,) with its interval, computed as in :func:`mean_of`."""
    return _figure(values, np.median)


def apart(values: Array, others: Array) -> Mean:
    """Median of some values (N,) minus that of others (M,); both are resampled independently."""
    one, other = _known(values), _known(others)
    count = min(len(one), len(other))
    if not count:
        return mean_of(np.empty(0))
    value = float(np.median(one) - np.median(other))
    low, high = np.percentile(_drawn(one, np.median, 0) - _drawn(other, np.median, 1), _SHARE)
    return Mean(value, float(low), float(high), count)


def _figure(values: Array, statistic: Statistic) -> Mean:
    known = _known(values)
    if len(known) < 2:
        value = float(known[0]) if len(known) else float("nan")
        return Mean(value, value, value, len(known))
    low, high = np.percentile(_drawn(known, statistic, 0), _SHARE)
    return Mean(float(statistic(known)), float(low), float(high), len(known))


def _known(values: Array) -> Array:
    found = np.asarray(values, np.float64)
    return found[np.isfinite(found)]


def _drawn(known: Array, statistic: Statistic, seed: int) -> Array:
    """Statistic of each sample that is resampled from values (N,)."""
    draws = np.random.default_rng(seed).integers(0, len(known), (_DRAWS, len(known)))
    return np.asarray(statistic(known[draws], axis=1))


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
    from scipy.stats import t as student

    count, seeds = scores.shape
    if count < 2:
        return 0.0
    if seeds < 2:
        return float("inf")
    free = (count - 1) * (seeds - 1)
    left = scores - scores.mean(axis=1, keepdims=True) - scores.mean(axis=0) + scores.mean()
    spread = np.sqrt((left * left).sum() / free)
    return float(student.ppf(1.0 - 0.05 / (count - 1), free) * spread * np.sqrt(2.0 / seeds))


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
    """Difference between each value of a parameter and its first value, paired by seed and all other values."""
    changes: dict[str, list[Mean]] = {}
    for name, values in study.swept.items():
        first = found[metric].isel({name: 0})
        pairs = [found[metric].isel({name: i}) - first for i in range(1, len(values))]
        changes[name] = [mean_of(pair.values.ravel()) for pair in pairs]
    return changes


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
