"""Fixture depth: how far points are outside of what a virtual fixture allows."""

import numpy as np

from teleop_core.evaluation.state_history import States
from teleop_core.geometry import Array


def fixture_depth(positions: Array, states: States) -> Array:
    """Distance (N,) [m] of points outside of their fixture to the nearest point of it; zero inside.

    Args:
        positions: Points in the slave's base, shape (N, 3), [m].
        states: State at the time of each point, with the fixture on.
    """
    return penetration(positions, states.center, states.size)


def penetration(position: Array, center: Array, size: Array) -> Array:
    """Distance (N,) of points outside of boxes to the nearest point of the box; zero inside.

    Args:
        position: Points, shape (N, 3).
        center: Centres of the boxes, shape (N, 3), in the same frame and unit.
        size: Wall to wall, shape (N, 3).
    """
    outside = np.maximum(np.abs(position - center) - 0.5 * size, 0.0)
    depth: Array = np.sqrt(np.einsum("ij,ij->i", outside, outside))
    return depth
