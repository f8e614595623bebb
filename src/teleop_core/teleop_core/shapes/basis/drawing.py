"""Drawing: lines for outlines of shapes."""

import math

import numpy as np

from teleop_core.kernels import Array, length

DRAWN = 0.1
"""Length of the part of an infinite shape that is drawn [m]."""
_LIFT = np.full((1, 3), np.nan)
# One line along all edges of a unit cube, corner by corner.
_CORNERS = np.array(
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0),
     (1, 0, 1), (1, 1, 1), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 1, 0), (0, 1, 1), (0, 0, 1)],
    dtype=np.float64,
)  # fmt: skip


def edges_of(size: tuple[float, ...] | Array) -> Array:
    """All edges of a box with sides ``size`` (3,) [m], as one line (16, 3) [m] relative to the middle of the box."""
    edges: Array = (_CORNERS - 0.5) * np.array(size)
    return edges


def great_circles(radius: float) -> Array:
    """Three great circles (N, 3) [m] around the middle, at right angles to each other."""
    angle = np.linspace(0.0, 2.0 * math.pi, 41)
    circle = np.stack((np.cos(angle), np.sin(angle), np.zeros_like(angle)), axis=1)
    return radius * with_lifts([np.roll(circle, turn, axis=1) for turn in range(3)])


def unit_vector(vector: tuple[float, ...]) -> Array:
    """Unit vector (3,) in the same direction."""
    out: Array = np.array(vector) / length(vector)
    return out


def across(normal: Array) -> tuple[Array, Array]:
    """Two vectors (3,) of length 1 at right angles to a normal (3,) and to each other."""
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= length(first)
    return first, np.cross(normal, first)


def square(normal: Array) -> Array:
    """A square of 100 mm around the middle, (5, 3) [m], perpendicular to a unit normal (3,)."""
    first, second = across(normal)
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    return 0.5 * DRAWN * np.array([a * first + b * second for a, b in corners])


def ring(middle: Array, axis: Array, radius: float) -> Array:
    """Circle (41, 3) [m] around a middle (3,) [m], perpendicular to a unit axis (3,)."""
    first, second = across(axis)
    angle = np.linspace(0.0, 2.0 * math.pi, 41)[:, None]
    circle: Array = middle + radius * (np.cos(angle) * first + np.sin(angle) * second)
    return circle


def segments_of(line: Array) -> Array:
    """Segments (N, 2, 3) between neighbouring points of a line (M, 3), without those that touch a row of NaN."""
    pairs = np.stack((line[:-1], line[1:]), axis=1)
    drawn: Array = pairs[np.isfinite(pairs).all(axis=(1, 2))]
    return drawn


def with_lifts(lines: list[Array]) -> Array:
    """Lines joined into one array (N, 3), with a row of NaN between two lines."""
    return np.concatenate([part for line in lines for part in (line, _LIFT)][:-1])
