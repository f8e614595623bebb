"""Summary: means over the seeds with intervals, and what each value changes, pair by pair."""

from collections.abc import Iterator, Sequence
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
    """A mean, and its 95 % interval by the bootstrap; NaN where nothing is."""

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


def mean_of(values: Array) -> Mean:
    """Mean of the numbers among some values (N,).

    Source:
        Efron 1979: percentiles of the means of samples drawn anew, always with the same numbers.
    """
    known = np.asarray(values, np.float64)
    known = known[np.isfinite(known)]
    if len(known) < 2:
        value = float(known[0]) if len(known) else float("nan")
        return Mean(value, value, value, len(known))
    draws = np.random.default_rng(0).integers(0, len(known), (_DRAWS, len(known)))
    low, high = np.percentile(known[draws].mean(axis=1), _SHARE)
    return Mean(float(known.mean()), float(low), float(high), len(known))


def conditions(study: "Study", found: "xarray.Dataset") -> "Iterator[tuple[dict[str, Any], Any]]":
    """Each combination of the swept values, with its part of the data set, over seeds alone."""
    places = [range(len(values)) for values in study.swept.values()]
    for indices in product(*places):
        at = dict(zip(study.swept, indices, strict=True))
        values = {name: study.swept[name][i] for name, i in at.items()}
        yield values, found.isel(at)


def differences(study: "Study", found: "xarray.Dataset", metric: str) -> dict[str, list[Mean]]:
    """What each value of a parameter changes against its first, by seed and all other values."""
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
