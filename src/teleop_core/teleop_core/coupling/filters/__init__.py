"""Tremor filters: what takes the tremor out of the hand's position, one file per kind.

A kind filters one coordinate. When it begins, what happens after a pause or a jump, and which
samples it gets are the same for all (:mod:`teleop_core.coupling.filters.tremor_filter`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numba import types

from teleop_core.base import PartError, Registry, part_check
from teleop_core.base.registry import places, tried
from teleop_core.kernels import Array, fenced, is_whole, numbers_of, pointer

__all__ = ["LONGEST_NS", "MEMORY", "TREMOR_FILTERS", "TremorFilter", "register_tremor_filter"]

_ROW = types.float64[::1]
FILTER = types.float64(_ROW, _ROW, types.float64, types.float64)
"""Signature of a filter kernel, so that one compiled stage serves every kind."""
MEMORY = 32
"""Numbers that a filter remembers of each coordinate."""
LONGEST_NS = 10_000_000
"""Longest period that a filter is given; a longer one is split [ns]."""


@dataclass(frozen=True)
class TremorFilter:
    """A kind of tremor filter.

    Attributes:
        name: What ``--set tremor_filter.kind=`` calls it.
        parameters: Its parameter group.
        filter: ``filter(numbers, memory, value, period)``, a kernel or a plain function, called for every sample of
            each coordinate but the one with which it begins. ``numbers`` are those of the parameters; ``memory`` (32,)
            is kept from sample to sample, and zero where the filter begins; ``value`` is the way from the place where
            it began [m]; ``period`` is the time since the sample before [s], 10 ms at most. Returns the filtered value
            [m]; as long as all values are 0 it returns 0.
        numbers: ``numbers(parameters)`` gives what ``filter`` takes, if that is
            something else than the numbers of the parameters in their order.
    """

    name: str
    parameters: type
    filter: Callable[[Array, Array, float, float], float]
    numbers: Callable[[Any], Array] = numbers_of

    filter_pointer = cached_property(lambda self: pointer(self.filter, FILTER))
    """The filter as an argument for kernels."""


def _try(part: TremorFilter) -> None:
    """Filter some values, so that what cannot work is told before anything runs."""
    needs = "one with filter(numbers, memory, value, period) -> float and parameters that all have defaults"
    with tried("tremor filter", part.name, needs):
        numbers, _ = fenced(part.numbers(part.parameters()))  # one too far is NaN
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
"""All kinds by name."""

register_tremor_filter = TREMOR_FILTERS.register
"""Adds one of yours under its own name; see :meth:`Registry.register`."""
