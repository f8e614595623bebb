"""Printed: what people did at the conditions of a study, as a source printed it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import stdtrit

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array

_TAIL = 0.025


@dataclass(frozen=True, eq=False)
class Printed:
    """People's scores.

    Attributes:
        source: Where they are printed.
        values: For each score an array (conditions, 3) of mean, low and high end of its 95 % interval, in the order of
            the conditions; the unit is that of the score.
    """

    source: str
    values: Mapping[str, Array]


def read_printed(content: Mapping[str, Any], metrics: Sequence[str], conditions: int) -> Printed | None:
    """Entries ``source``, ``people``, and for each score a mean or a pair of mean and standard deviation per condition.

    Raises:
        ParameterError: An entry is missing or has another form.
    """
    if not content:
        return None
    entries = dict(content)
    source, people = str(entries.pop("source", "")), entries.pop("people", 0)
    if not source or not isinstance(people, int) or people < 2:
        raise ParameterError("printed", dict(content), "an entry with source and people, two or more")
    half = -float(stdtrit(people - 1, _TAIL)) / math.sqrt(people)
    values = {}
    for name, rows in entries.items():
        if name not in metrics:
            raise ParameterError("printed", name, f"one of the study's metrics: {', '.join(metrics)}")
        try:
            pairs = np.array([row if isinstance(row, list) else (row, 0.0) for row in rows], np.float64)
            mean, deviation = pairs.reshape(conditions, 2).T
        except (TypeError, ValueError):
            text = f"{conditions} means, or pairs of mean and standard deviation: one for each condition"
            raise ParameterError(f"printed {name}", rows, text) from None
        values[name] = np.column_stack((mean, mean - half * deviation, mean + half * deviation))
    return Printed(source, values)
