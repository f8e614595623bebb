"""Axes by name, and the rotation that is made of three named axes."""

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array

AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


def axis_map(name: str, axes: tuple[str, ...]) -> Array:
    """Rotation (3, 3) whose rows are the named axes: with ("-z", "-x", "+y"), the new x is the old -z.

    Args:
        name: Name of the parameter, for messages.
        axes: Three of :data:`AXES`.

    Raises:
        ParameterError: An axis is used twice, or the map would mirror.

    Source:
        Vongbunyong 2008, eq. 6.2.3, for the defaults.
    """
    matrix = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        matrix[row, "xyz".index(axis[-1])] = -1.0 if axis[0] == "-" else 1.0
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    if a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g) != 1.0:  # exact, of 0 and ±1
        raise ParameterError(name, axes, "three axes at right angles that do not mirror")
    return matrix
