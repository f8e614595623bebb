"""Rest: the rest pose of the stylus before a session; motions of operators are relative to it."""

import math

import numpy as np

from teleop_core.kernels.geometry import Array, quaternion_from_rotation, rotation

REST_TILT = math.radians(-23.4)
"""Tilt of the stylus in its inkwell about x [rad].

Vongbunyong 2008, table 6.1; the sign is chosen so that it agrees with the slave's home.
"""
REST_POSITION = (0.0, -0.065511, -0.088114)
"""Position of the stylus tip in the inkwell [m], in the master's base."""


def rest_pose() -> Array:
    """Pose (7,) in which the stylus of the haptic master rests, in the master's base."""
    pose = np.empty(7)
    pose[:3] = REST_POSITION
    quaternion_from_rotation(rotation("x", REST_TILT), pose[3:])
    return pose
