"""Pose errors: how far poses are from their references."""

from dataclasses import dataclass

import numpy as np

from teleop_core.geometry import Array, roll_pitch_yaw, rotations_from_quaternions

DEGENERATE_DEG = 1.0
"""Roll and yaw are not defined where pitch is nearer to ±90° than this, [deg]."""


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Errors of N poses; NaN where a pose or its reference is not valid.

    Attributes:
        position_mm: Distances, shape (N,), [mm].
        roll_pitch_yaw_deg: Differences of the fixed angles, wrapped to ±180, shape (N, 3), [deg];
            roll and yaw are NaN near pitch ±90°.
        angle_deg: Angle of the one rotation between the two, shape (N,), [deg].
        is_degenerate: Whether pitch is too near to ±90° for roll and yaw, shape (N,).
    """

    position_mm: Array
    roll_pitch_yaw_deg: Array
    angle_deg: Array
    is_degenerate: "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]"


def pose_errors(poses: Array, references: Array) -> PoseErrors:
    """Errors of poses against their references, both in the same frame.

    Args:
        poses: Rows x, y, z [m] and quaternion w, x, y, z, shape (N, 7).
        references: The same, shape (N, 7).

    Source:
        Vongbunyong 2008, eqs. 2.7.1-2.7.6 (fixed angles) and section 7.6 (which error is meant).
    """
    a, b = _unit(poses[:, 3:7]), _unit(references[:, 3:7])
    angles, others = (roll_pitch_yaw(rotations_from_quaternions(q)) for q in (a, b))
    difference = np.degrees(_wrapped(angles - others))
    pitch = np.degrees(np.maximum(np.abs(angles[:, 1]), np.abs(others[:, 1])))
    is_degenerate = pitch > 90.0 - DEGENERATE_DEG
    difference[is_degenerate, ::2] = np.nan
    offset = poses[:, :3] - references[:, :3]
    distance = np.sqrt(np.einsum("ij,ij->i", offset, offset))
    return PoseErrors(distance * 1e3, difference, np.degrees(_angle(a, b)), is_degenerate)


def angles_between(quaternions: Array, others: Array) -> Array:
    """Angles (N,) [rad] between orientations (N, 4) of any length; NaN without a direction."""
    return _angle(_unit(quaternions), _unit(others))


def _unit(quaternions: Array) -> Array:
    """Quaternions of unit length; NaN for those of none."""
    norm = np.sqrt(np.einsum("ij,ij->i", quaternions, quaternions))
    with np.errstate(invalid="ignore", divide="ignore"):
        unit: Array = quaternions / norm[:, None]
    return unit


def _wrapped(angle: Array) -> Array:
    """The same angle [rad] between -π and π."""
    wrapped: Array = angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
    return wrapped


def _angle(a: Array, b: Array) -> Array:
    """Angle [rad] of the rotation from b to a; exact for small ones, unlike the arc cosine."""
    w = np.abs(np.einsum("ij,ij->i", a, b))
    axis = b[:, :1] * a[:, 1:] - a[:, :1] * b[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    angle: Array = 2.0 * np.arctan2(np.sqrt(np.einsum("ij,ij->i", axis, axis)), w)
    return angle
