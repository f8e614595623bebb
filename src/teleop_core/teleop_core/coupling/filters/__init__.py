"""Tremor filters: they remove tremor from the hand's position, one file per kind.

Each kind filters one coordinate. All kinds share the start, the behaviour after a pause or a jump, and the choice of
samples (:mod:`teleop_core.coupling.filters.tremor_filter`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from teleop_core.base import PartError, Registry, part_check
from teleop_core.base.registry import places, tried
from teleop_core.kernels import Array, fenced, is_whole, numbers_of, pointer

__all__ = ["LONGEST_NS", "MEMORY", "TREMOR_FILTERS", "TremorFilter", "register_tremor_filter"]

_ROW = "float64[::1]"
FILTER = f"float64({_ROW}, {_ROW}, float64, float64)"
"""Signature of a filter kernel, so that one compiled stage serves every kind."""
MEMORY = 32
"""Number of values that a filter remembers for each coordinate."""
LONGEST_NS = 10_000_000
"""Longest period that a filter gets [ns]; a longer period is split."""


@dataclass(frozen=True)
class TremorFilter:
    """A kind of tremor filter.

    Attributes:
        name: Name of the filter in ``--set tremor_filter.kind=``.
        parameters: Parameter group of the filter.
        filter: ``filter(numbers, memory, value, period)``, a kernel or a plain function, called for every sample of
            each coordinate except the first. ``numbers`` are the numbers of the parameters. ``memory`` (32,) is kept
            from sample to sample, and is zero at the start. ``value`` is the displacement from the first sample [m].
            ``period`` is the time since the last sample [s], 10 ms at most. The function returns the filtered value
            [m]. It must return 0 as long as all values are 0.
        numbers: ``numbers(parameters)`` returns the ``numbers`` of ``filter``, if they differ from the numbers of the
            parameters in their order.
    """

    name: str
    parameters: type
    filter: Callable[[Array, Array, float, float], float]
    numbers: Callable[[Any], Array] = numbers_of

    filter_pointer = cached_property(lambda self: pointer(self.filter, FILTER))
    """The filter as an argument for kernels."""


def _try(part: TremorFilter) -> None:
    """Filter some values, so that errors are reported before anything runs."""
    needs = "one with filter(numbers, memory, value, period) -> float and parameters that all have defaults"
    with tried("tremor filter", part.name, needs):
        numbers, _ = fenced(part.numbers(part.parameters()))  # an index one too large reads NaN
        memory, fence = fenced(np.zeros(MEMORY))
        rest = float(part.filter(numbers, memory, 0.0, 1e-3))
        for i in range(64):
            filtered = float(part.filter(numbers, memory, 1e-3 * math.sin(0.1 * i), 1e-3))
            if not (math.isfinite(filtered) and is_whole(fence)):
                text = f"one whose filter is finite and remembers {MEMORY} numbers"
                raise PartError("tremor filter", part.name, f"{text}; it is {filtered!r}")
    if rest != 0.0:
        text = f"one whose filter gives 0 for 0, so that a resting hand rests; it is {rest!r}"
        raise PartError("tremor filter", part.name, text)


TREMOR_FILTERS: Registry[TremorFilter] = Registry(
    "tremor filter",
    "tremor_filters",
    places("teleop_core.coupling.filters", "notch band_stop kalman wflc"),
    part_check("tremor filter", TremorFilter, "filter"),
    _try,
)
"""All tremor filters by name."""

register_tremor_filter = TREMOR_FILTERS.register
"""Adds your filter under its own name; see :meth:`Registry.register`."""
