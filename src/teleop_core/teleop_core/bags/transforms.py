"""Transforms: messages of ``/tf`` and ``/robot_description`` as bytes, without ROS."""

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags import layouts, ros_types
from teleop_core.bags.cdr import Template
from teleop_core.base.errors import ShapeError
from teleop_core.graph.topics import Kind, Quality, Stamp, Topic
from teleop_core.kernels.geometry import Array

ROBOT_DESCRIPTION = Topic(
    "robot_description", Kind.REPORT, Stamp("none"), quality=Quality.LATCHED, message="std_msgs/msg/String"
)
"""Topic with the URDF of the slave."""
TF = Topic("tf", Kind.REPORT, quality=Quality.REPORT, message="tf2_msgs/msg/TFMessage")
"""Topic with the poses of the frames of all arms. All arms share this topic, since names of frames contain the arm's
name."""
WORLD = "world"
"""Root frame of the drawing; the poses of all arms' bases are given in this frame."""
_MESSAGE_ORDER = [0, 1, 2, 4, 5, 6, 3]  # columns of a pose in a message: x, y, z, qx, qy, qz, qw


class TransformMessages:
    """Messages of ``/tf`` that always contain the same frames.

    Args:
        frames: Names of parent and child of each transform.
    """

    def __init__(self, frames: tuple[tuple[str, str], ...]) -> None:
        self.frames = frames
        cdr = Template()
        cdr.length(len(frames))
        for index, (parent, child) in enumerate(frames):
            cdr.gap("i", slice(0, 1))
            cdr.gap("I", slice(0, 1))
            cdr.string(parent)
            cdr.string(child)
            cdr.gap("d", slice(7 * index, 7 * index + 7))
        self._template: layouts.Bytes = np.frombuffer(bytes(cdr.template), np.uint8)
        # Positions of the bytes of all stamps, and of all numbers, in a message.
        self._stamps = _places([at for at, code, *_ in cdr.gaps if code == "i"], 8)
        self._numbers = _places([at for at, code, *_ in cdr.gaps if code == "d"], 56)

    def encode(self, stamp_ns: layouts.Stamps, poses: Array) -> list[bytes]:
        """Messages of N times, one message for each time.

        Args:
            stamp_ns: Stamps (N,) [ns].
            poses: Poses of the child frames in their parent frames (N, frames, 7): x, y, z [m], quaternion w, x, y, z.

        Raises:
            ShapeError: ``poses`` does not have the shape (N, frames, 7).
        """
        if poses.shape != (len(stamp_ns), len(self.frames), 7):
            raise ShapeError("poses", (len(stamp_ns), len(self.frames), 7), poses.shape)
        rows = np.empty((len(stamp_ns), len(self._template)), np.uint8)
        rows[:] = self._template
        seconds = stamp_ns // layouts.SECOND_NS
        stamps = np.stack((seconds, stamp_ns - seconds * layouts.SECOND_NS), axis=1).astype("<u4")
        rows[:, self._stamps] = np.tile(stamps.view(np.uint8), len(self.frames))
        numbers = np.ascontiguousarray(poses[..., _MESSAGE_ORDER], dtype="<f8")
        rows[:, self._numbers] = numbers.reshape(len(rows), 7 * len(self.frames)).view(np.uint8)
        return [row.tobytes() for row in rows]


def _places(begins: list[int], size: int) -> NDArray[np.int64]:
    return np.asarray(np.add.outer(begins, np.arange(size)).ravel())


def text_message(text: str) -> bytes:
    """Bytes of a message that contains one text."""
    kind = ros_types.typestore().types[ROBOT_DESCRIPTION.message]
    return ros_types.serialise(kind(data=text))
