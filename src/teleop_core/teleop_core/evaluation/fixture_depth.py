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
    for index in np.unique(states.fixture).tolist():
        fixture = states.fixtures[index]
        if not fixture.fault:
            here = states.fixture == index
            depth[here] = fixture.depths(offsets[here], gain[here], axes)
    return depth
