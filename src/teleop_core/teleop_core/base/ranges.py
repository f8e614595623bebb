"""Ranges: what a number from outside may be at all, by its unit, declared once for all readers.

Parameters, arms of files and traces of networks are checked against them. A number beyond ``most`` is impossible for
any arm and is refused. One beyond ``usual`` gives a warning: it looks like another unit.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

from teleop_core.base.errors import ParameterError


class Range(NamedTuple):
    """Sizes of a quantity, whatever its sign, and what a larger one than ``usual`` looks like."""

    most: float
    usual: float = math.inf
    looks_like: str = ""


RANGES = {
    "": Range(1e9),
    "m": Range(1e7, 20.0, "mm"),
    "rad": Range(1e7, 8.0 * math.pi, "degrees"),
    "m/s": Range(1e3, 20.0, "mm/s"),
    "rad/s": Range(1e4, 50.0, "degrees/s"),
    "kg": Range(1e6),
    "kg·m²": Range(1e8),
    "N": Range(1e9),
    "N·m": Range(1e9),
    "N/m": Range(1e12),
    "N·m/rad": Range(1e12),
    "N·s/m": Range(1e9),
    "N·m·s/rad": Range(1e9),
    "s": Range(1e6),
}
"""By unit. Four rounds are more than arms turn to either side, 50 rad/s more than they do."""
MOST_OF_ARM = 1e3
"""Length in an arm [m] or limit of its joints [rad, m]; the longest arms span 500 m. Files write
limits of 999999 where they mean none, and origins far away where they mean a place on a map."""
LONGEST_DELAY = 10.0
"""Of a packet on its way [s]: to the Moon and back takes 2.6 s, ETS-VII took 7 s."""
LATEST_S = 4e9
"""Time of the clock [s] since 1970, the year 2096."""


def range_of(unit: str) -> Range:
    """Range of a unit; for ``rad or m`` the wider of both, for an unknown unit any number."""
    parts = [RANGES.get(part, Range(math.inf)) for part in unit.split(" or ")]
    return max(parts, key=lambda part: part.most)


def check(name: str, value: float, unit: str, most: float = math.inf) -> float:
    """The number, if it is finite and within its range, and no larger than ``most``.

    Raises:
        ParameterError: It is not; says which numbers are.
    """
    most = min(most, range_of(unit).most)
    if not (math.isfinite(value) and abs(value) <= most):
        end = f" {unit}" if unit else ""
        needed = f"between {-most:g} and {most:g}{end}" if math.isfinite(most) else "finite"
        raise ParameterError(name, value, needed)
    return value


def unusual(names: Iterable[str], values: Iterable[float], unit: str) -> str:
    """What looks like numbers of another unit, in words; empty if nothing does."""
    found = range_of(unit)
    large = [(n, v) for n, v in zip(names, values, strict=True) if abs(v) > found.usual]
    if not large:
        return ""
    listed = ", ".join(f"{name} {value:g}" for name, value in large)
    return f"{listed} {unit}: are they {found.looks_like}?"
