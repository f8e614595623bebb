"""Poses: moving nodes of the page, thirty times a second and many at once.

viser compares every new pose with the last one by ``np.allclose``, and then sends position and rotation. This
comparison takes more time than everything else. Here all bodies of an arm are compared together beforehand, so viser's
comparison is skipped. The messages and the attributes of the nodes are the same.
"""

from typing import Any

import numpy as np
import viser
from viser import _messages

from teleop_core.kernels.geometry import Array

_STILL = 2e-5
"""Change of a pose [m, parts of a turn] below which nothing is sent."""


def set_pose(node: viser.SceneNodeHandle, pose: Array) -> None:
    """Move a node to a pose (7,): x, y, z [m], quaternion w, x, y, z, in the node above."""
    held: Any = node._impl
    x, y, z, *turn = pose.tolist()
    held.position[:], held.wxyz[:] = pose[:3], pose[3:]
    send = held.api._queue_scene_message
    send(_messages.SetPositionMessage(held.name, (x, y, z)))
    send(_messages.SetOrientationMessage(held.name, tuple(turn)))


def move(node: viser.SceneNodeHandle, pose: Array) -> None:
    """The same, unless it is there already."""
    place, turn = node.position, node.wxyz
    if max(np.abs(place - pose[:3]).max(), np.abs(turn - pose[3:]).max()) > _STILL:
        set_pose(node, pose)


def moved(poses: Array, drawn: Array) -> list[int]:
    """Indices of those of poses (N, 7) that differ from what is drawn (N, 7); NaN never does."""
    return np.flatnonzero(np.abs(poses - drawn).max(axis=1) > _STILL).tolist()
