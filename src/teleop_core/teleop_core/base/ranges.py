"""Ranges: allowed values of numbers from users and files, by their unit, declared once for all readers.

Parameters, arms that are read from files, and traces of networks are checked against these ranges. A number beyond
``most`` is impossible for any arm and is refused. A number beyond ``usual`` gives a warning, because it probably has
another unit.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

from teleop_core.base.errors import ParameterError


class Range(NamedTuple):
    """Possible magnitudes of a quantity, and the unit that a number larger than ``usual`` probably has."""

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
"""Ranges by unit. No arm turns by more than four revolutions to either side, or faster than 50 rad/s."""
MOST_OF_ARM = 1e3
"""Largest length in an arm [m] or limit of its joints [rad, m]; the longest arms span 500 m. Some files contain limits
of 999999 that mean no limit, or far origins that mean a position on a map."""
LONGEST_DELAY = 10.0
"""Longest delay of a packet [s]: a packet to the Moon and back takes 2.6 s; in the experiment ETS-VII it took 7 s."""
LATEST_S = 4e9
"""Latest time of a clock [s] since 1970, in the year 2096."""


def range_of(unit: str) -> Range:
    """Range of a unit; for ``rad or m`` the wider of both ranges; for an unknown unit, the range of all numbers."""
    parts = [RANGES.get(part, Range(math.inf)) for part in unit.split(" or ")]
    return max(parts, key=lambda part: part.most)


def check(name: str, value: float, unit: str, most: float = math.inf) -> float:
    """Return the number if it is finite, within its range and not larger than ``most``.

    Raises:
        ParameterError: The number is not allowed; the error states the allowed numbers.
    """
    most = min(most, range_of(unit).most)
    if not (math.isfinite(value) and abs(value) <= most):
        end = f" {unit}" if unit else ""
        needed = f"between {-most:g} and {most:g}{end}" if math.isfinite(most) else "finite"
        raise ParameterError(name, value, needed)
    return value


def unusual(names: Iterable[str], values: Iterable[float], unit: str) -> str:
    """Text about numbers that probably have another unit; empty if there are none."""
    found = range_of(unit)
    large = [(n, v) for n, v in zip(names, values, strict=True) if abs(v) > found.usual]
    if not large:
        return ""
    listed = ", ".join(f"{name} {value:g}" for name, value in large)
    return f"{listed} {unit}: are they {found.looks_like}?"
