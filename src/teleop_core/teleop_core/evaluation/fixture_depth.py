"""Fixture depth: how far points are outside of what a virtual fixture allows."""

import numpy as np

from teleop_core.evaluation.state_history import States
from teleop_core.geometry import Array


def fixture_depth(positions: Array, states: States, axes: Array) -> Array:
    """Distance (N,) [m] of points outside of their fixture to the nearest point of it; zero inside.

    It is NaN for points that are no numbers, and where the fixture's shape is not known here.

    Args:
        positions: Points in the slave's base, shape (N, 3), [m].
        states: State at the time of each point, with the fixture on.
        axes: Rotation (3, 3) from the master's base to the slave's axes.
    """
    offsets, gain = positions - states.center, states.column("gain")
    depth = np.full(len(positions), np.nan)
    for fixture, count in states.fixture_counts().items():
        if not fixture.fault:
            here = states.is_told(fixture) if count < len(positions) else slice(None)
            depth[here] = fixture.depths(offsets[here], gain[here], axes)
    return depth
