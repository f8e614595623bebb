"""Directions: parts of a vector along and across one, and ways to a point."""

import math

from teleop_core.base import ParameterError
from teleop_core.kernels import Array, inner

NEAR = 5e-3
"""A tip that is farther outside of a shape [m] does not get there within a tick."""
MIDDLE = 1e-150
"""Of ways shorter than this [m] squares underflow, so that they lead nowhere."""
ON_AXIS = 1e-12
"""So near to an axis rounding hides which way a point is off it [m]."""
_SHORTEST = 1e-6  # vector that counts as a direction
Direction = tuple[float, float, float]


def require_direction(name: str, vector: tuple[float, ...]) -> None:
    """Make sure that a vector (3,) has a direction.

    Raises:
        ParameterError: It is zero or nearly so.
    """
    if math.hypot(*vector) < _SHORTEST:
        raise ParameterError(name, vector, "a direction: not 0, 0, 0")


@inner
def unit(x: float, y: float, z: float) -> Direction:
    """Vector of length 1 that looks the same way; the one given is not zero."""
    size = math.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size


@inner
def length_of(vector: Array) -> float:
    """Length of a vector (3,)."""
    # Products, for powers round otherwise in plain Python.
    x, y, z = vector[0], vector[1], vector[2]
    return math.sqrt(x * x + y * y + z * z)


@inner
def make_unit(vector: Array) -> None:
    """Give a vector (3,) the length 1; it is not zero."""
    size = length_of(vector)
    for i in range(3):
        vector[i] /= size


@inner
def scale_to(vector: Array, wanted: float) -> None:
    """Give a vector (3,) another length; a negative one turns it round. It is not zero."""
    share = wanted / length_of(vector)
    for i in range(3):
        vector[i] *= share


@inner
def part_along(vector: Array, direction: Direction) -> float:
    """Part of a vector (3,) along a direction of length 1."""
    x, y, z = direction
    return vector[0] * x + vector[1] * y + vector[2] * z


@inner
def take_along(vector: Array, along: float, direction: Direction) -> float:
    """Take a part along a direction off a vector (3,); returns the length of what is left."""
    square = 0.0
    for i in range(3):
        vector[i] -= along * direction[i]
        square += vector[i] * vector[i]
    return math.sqrt(square)


@inner
def look_across(direction: Direction, vector: Array) -> float:
    """Write a vector (3,) at right angles to a direction of length 1; returns its length."""
    least, square = 0, 0.0
    for i in range(3):
        least = i if abs(direction[i]) < abs(direction[least]) else least
    for i in range(3):
        vector[i] = (1.0 if i == least else 0.0) - direction[least] * direction[i]
        square += vector[i] * vector[i]
    return math.sqrt(square)


@inner
def between_ends(along: float, whole: float) -> float:
    """Nearest place to a place, both from the middle, on a line of a length."""
    half = 0.5 * whole
    return min(max(along, -half), half)


@inner
def nearest_share(offset: Array, start: Array, end: Array) -> float:
    """Nearest place on a segment, as a share of it from its start, 0 to 1; 0 if it has no length.

    Args:
        offset: The point (3,).
        start: Of the segment (3,).
        end: Of the segment (3,).
    """
    along = square = 0.0
    for i in range(3):
        step = end[i] - start[i]
        along += (offset[i] - start[i]) * step
        square += step * step
    return min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
