"""Pose measures: position accuracy and repeatability of an arm that moves to a position repeatedly."""

import numpy as np

from teleop_core.kernels.geometry import Array


def accuracy(attained: Array, commanded: Array) -> Array:
    """Distance between the mean of the attained positions and the commanded position.

    Args:
        attained: Positions (..., N, 3) after N moves to the same position.
        commanded: The commanded position (..., 3).

    Returns:
        AP (...), in the unit of the positions.

    Source:
        ISO 9283:1998, 7.2.1.
    """
    off: Array = np.linalg.norm(attained.mean(axis=-2) - commanded, axis=-1)
    return off


def repeatability(attained: Array) -> Array:
    """Radius around the mean of the attained positions: mean distance plus three standard deviations.

    Args:
        attained: Positions (..., N, 3) after N moves to the same position, N >= 2.

    Returns:
        RP (...), in the unit of the positions.

    Source:
        ISO 9283:1998, 7.2.2.
    """
    middle = attained.mean(axis=-2, keepdims=True)
    far: Array = np.linalg.norm(attained - middle, axis=-1)
    spread: Array = far.mean(axis=-1) + 3.0 * far.std(axis=-1, ddof=1)
    return spread
