"""Tendons of the RCRT-1: motor-side angles of joints 5 and 6, which share an idler."""

import math

import numpy as np
from numpy.typing import NDArray

from teleop_core.errors import ParameterError
from teleop_core.geometry import Array
from teleop_core.portable import product


def tendon_motor_angles(
    joints: Array, *, ratio5: float = 1.0, ratio6: float = 1.0, coupling: float = 0.0
) -> Array:
    """Motor-side angles of tendon joints 5 and 6: q5* = ratio5 q5, q6* = ratio6 q6 + coupling q5.

    The joint-6 tendon runs over an idler on axis 5, so a move of joint 5 pulls it. The defaults
    are what the published numbers were computed with: no coupling. With the printed radii
    ratio5 = r5/r5* = 0.7143, ratio6 = r6/r6* = 1.3889 and coupling = r5/r6* = 1.3889.

    Args:
        joints: Joint angles 5 and 6, (..., 2) [rad].
        ratio5: Pulley ratio of joint 5, not 0.
        ratio6: Pulley ratio of joint 6, not 0.
        coupling: Motor-6 turn per joint-5 turn; its sign depends on the routing.

    Returns:
        Motor-side angles (..., 2) [rad].

    Raises:
        ParameterError: A ratio is zero.

    Source:
        Vongbunyong 2008, eqs. 3.5-3.7, completed by the balance of tendon travel.
    """
    return product(joints, _tendon_matrix(ratio5, ratio6, coupling).T)


def tendon_joint_angles(
    motors: Array, *, ratio5: float = 1.0, ratio6: float = 1.0, coupling: float = 0.0
) -> Array:
    """Joint angles 5 and 6, (..., 2) [rad]: the inverse of :func:`tendon_motor_angles`."""
    (r5, _), (c, r6) = _tendon_matrix(ratio5, ratio6, coupling)
    return product(motors, np.array([[1.0 / r5, 0.0], [-c / (r5 * r6), 1.0 / r6]]).T)


def _tendon_matrix(ratio5: float, ratio6: float, coupling: float) -> NDArray[np.float64]:
    for name, ratio in (("ratio5", ratio5), ("ratio6", ratio6)):
        if ratio == 0.0 or not math.isfinite(ratio):
            raise ParameterError(name, ratio, "finite and not 0")
    return np.array([[ratio5, 0.0], [coupling, ratio6]])
