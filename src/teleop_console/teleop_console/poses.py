"""Poses: move many nodes of the page thirty times a second.

viser compares every new pose with the last pose by ``np.allclose``, and then sends position and rotation. This
comparison takes most of the time. This module compares all bodies of an arm at once and skips viser's comparison. The
messages and the attributes of the nodes stay the same.
"""

from typing import Any

import numpy as np
import viser
from viser import _messages

from teleop_core.kernels.geometry import Array

_STILL = 2e-5
"""Change of position [m] or quaternion [1] below which a pose is not sent."""


def set_pose(node: viser.SceneNodeHandle, pose: Array) -> None:
    """Move a node to a pose (7,) in its parent node: x, y, z [m], quaternion w, x, y, z."""
    held: Any = node._impl
    x, y, z, *turn = pose.tolist()
    held.position[:], held.wxyz[:] = pose[:3], pose[3:]
    send = held.api._queue_scene_message
    send(_messages.SetPositionMessage(held.name, (x, y, z)))
    send(_messages.SetOrientationMessage(held.name, tuple(turn)))


def move(node: viser.SceneNodeHandle, pose: Array) -> None:
    """Move a node to a pose (7,) in its parent node, unless the node is already there."""
    place, turn = node.position, node.wxyz
    if max(np.abs(place - pose[:3]).max(), np.abs(turn - pose[3:]).max()) > _STILL:
        set_pose(node, pose)


def moved(poses: Array, drawn: Array) -> list[int]:
    """Indices of the poses (N, 7) that differ from the drawn poses (N, 7); a pose with NaN is never included."""
    return np.flatnonzero(np.abs(poses - drawn).max(axis=1) > _STILL).tolist()
