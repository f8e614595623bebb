"""Directions: components of a vector along and across a direction, and nearest points on lines."""

import math

from teleop_core.base import ParameterError
from teleop_core.kernels import Array, inner

NEAR = 5e-3
"""Distance from a shape [m] that a tip cannot travel within one tick."""
MIDDLE = 1e-150
"""Vectors shorter than this [m] have no direction, because their squares underflow."""
ON_AXIS = 1e-12
"""Within this distance of an axis [m], rounding hides the direction of a point from the axis."""
_SHORTEST = 1e-6  # a shorter vector has no direction
Direction = tuple[float, float, float]


def require_direction(name: str, vector: tuple[float, ...]) -> None:
    """Raise an error if a vector (3,) is too short to have a direction.

    Raises:
        ParameterError: The vector is zero or nearly zero.
    """
    if math.hypot(*vector) < _SHORTEST:
        raise ParameterError(name, vector, "a direction: not 0, 0, 0")


@inner
def unit(x: float, y: float, z: float) -> Direction:
    """Unit vector in the direction of a given vector, which must not be zero."""
    size = math.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size


@inner
def length_of(vector: Array) -> float:
    """Length of a vector (3,)."""
    # Written as products, because plain Python rounds powers differently from compiled code.
    x, y, z = vector[0], vector[1], vector[2]
    return math.sqrt(x * x + y * y + z * z)


@inner
def make_unit(vector: Array) -> None:
    """Scale a vector (3,) to length 1 in place; it must not be zero."""
    size = length_of(vector)
    for i in range(3):
        vector[i] /= size


@inner
def scale_to(vector: Array, wanted: float) -> None:
    """Scale a vector (3,) to another length in place; a negative length reverses it. It must not be zero."""
    share = wanted / length_of(vector)
    for i in range(3):
        vector[i] *= share


@inner
def part_along(vector: Array, direction: Direction) -> float:
    """Component of a vector (3,) along a unit vector."""
    x, y, z = direction
    return vector[0] * x + vector[1] * y + vector[2] * z


@inner
def take_along(vector: Array, along: float, direction: Direction) -> float:
    """Subtract ``along`` times a unit direction from a vector (3,); return the remaining length."""
    square = 0.0
    for i in range(3):
        vector[i] -= along * direction[i]
        square += vector[i] * vector[i]
    return math.sqrt(square)


@inner
def look_across(direction: Direction, vector: Array) -> float:
    """Write a vector (3,) perpendicular to a unit direction; return its length."""
    least, square = 0, 0.0
    for i in range(3):
        least = i if abs(direction[i]) < abs(direction[least]) else least
    for i in range(3):
        vector[i] = (1.0 if i == least else 0.0) - direction[least] * direction[i]
        square += vector[i] * vector[i]
    return math.sqrt(square)


@inner
def between_ends(along: float, whole: float) -> float:
    """Point of a line of length ``whole`` nearest to ``along``; positions are measured from the middle of the line."""
    half = 0.5 * whole
    return min(max(along, -half), half)


@inner
def nearest_share(offset: Array, start: Array, end: Array) -> float:
    """Point of a segment nearest to ``offset``, as a share of the segment from 0 to 1; 0 for a segment of length 0.

    Args:
        offset: The given point (3,).
        start: Start of the segment (3,).
        end: End of the segment (3,).
    """
    along = square = 0.0
    for i in range(3):
        step = end[i] - start[i]
        along += (offset[i] - start[i]) * step
        square += step * step
    return min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
