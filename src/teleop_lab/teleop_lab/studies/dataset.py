"""Dataset: results of a study as named arrays."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from teleop_core.evaluation.score import keys
from teleop_lab.studies.point import Point, code_digest, own_digest
from teleop_lab.studies.store import Store

if TYPE_CHECKING:
    import xarray

    from teleop_lab.studies.study import Study


def swept_coordinates(study: "Study") -> dict[str, object]:
    """Values of each swept parameter; values that are not plain are converted to texts."""
    return {
        name: [v if isinstance(v, int | float | str) else str(v) for v in values]
        for name, values in study.swept.items()
    }


def units_of_scores() -> dict[str, str]:
    """Unit of each key of a score."""
    return {name: key.unit for key in keys() for name in key.names()}


def dataset_of(study: "Study", points: Sequence[Point], store: Store) -> "xarray.Dataset":
    """Results as an xarray data set.

    A dimension for each parameter that is swept, and ``seed``; a variable for each score, NaN where
    it does not apply or the session failed; ``error`` has the reason, and ``seconds`` the duration of the session.
    """
    import xarray

    sizes = [*(len(values) for values in study.swept.values()), len(study.seeds)]
    results = [store.result(point) for point in points]
    coordinates = swept_coordinates(study)
    coordinates["seed"] = list(study.seeds)
    units = units_of_scores()
    variables = {}
    for metric in study.metrics:
        numbers = [
            np.nan if result is None or (value := result.scores.get(metric)) is None else value for result in results
        ]
        shaped = np.array(numbers, np.float64).reshape(sizes)
        variables[metric] = (study.names, shaped, {"units": units.get(metric, "1")})
    errors = np.array(["" if r is None else r.error for r in results], object).reshape(sizes)
    took = np.array([0.0 if r is None else r.seconds for r in results]).reshape(sizes)
    variables["error"] = (study.names, errors, {})
    variables["seconds"] = (study.names, took, {"units": "s"})
    about = {
        "scenario": study.scenario or "",
        "code": code_digest() + own_digest(),
        "settings": str(dict(study.settings)),
        "sessions": len(points),
    }
    return xarray.Dataset(variables, coordinates, about)
