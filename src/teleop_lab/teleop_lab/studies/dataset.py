"""Dataset: results of a study as named arrays."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from teleop_core.evaluation.score import keys
from teleop_lab.studies.point import PointResult

if TYPE_CHECKING:
    import xarray


def swept_coordinates(swept: Mapping[str, Sequence[object]]) -> dict[str, object]:
    """Values of each swept parameter; lists and other composite values are converted to texts."""
    return {name: [v if isinstance(v, int | float | str) else str(v) for v in values] for name, values in swept.items()}


def units_of_scores() -> dict[str, str]:
    """Unit of each key of a score."""
    return {name: key.unit for key in keys() for name in key.names()}


def dataset_of(
    coordinates: Mapping[str, object],
    metrics: Sequence[str],
    results: Sequence[PointResult | None],
    about: Mapping[str, object],
) -> "xarray.Dataset":
    """Results as an xarray data set.

    Each score is a variable. Its value is NaN where the score does not apply or the session failed. The variable
    ``error`` contains the reason of a failure, and ``seconds`` contains the duration of the session.

    Args:
        coordinates: Values of each dimension.
        metrics: Keys of the scores.
        results: Result of each point, in the order of the dimensions; None if the result is missing.
        about: Attributes of the data set.
    """
    import xarray

    names = tuple(coordinates)
    sizes = [len(values) for values in coordinates.values()]  # type: ignore[arg-type]
    units = units_of_scores()
    variables = {}
    for metric in metrics:
        numbers = [
            np.nan if result is None or (value := result.scores.get(metric)) is None else value for result in results
        ]
        shaped = np.array(numbers, np.float64).reshape(sizes)
        variables[metric] = (names, shaped, {"units": units.get(metric, "1")})
    errors = np.array(["" if r is None else r.error for r in results], object).reshape(sizes)
    took = np.array([0.0 if r is None else r.seconds for r in results]).reshape(sizes)
    variables["error"] = (names, errors, {})
    variables["seconds"] = (names, took, {"units": "s"})
    return xarray.Dataset(variables, coordinates, about)
