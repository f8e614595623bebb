"""Markers: shapes that RViz and Foxglove draw beside a robot, as bytes, without ROS.

This module builds the bytes itself: a path of hundreds of points is one block of bytes here. The messages of rclpy
need hundreds of objects for the same path, which takes too long in a running session.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from teleop_core.bags.cdr import Template
from teleop_core.bags.layouts import SECOND_NS
from teleop_core.graph.topics import Kind, Quality, Topic
from teleop_core.kernels.geometry import Array

MARKERS = Topic("teleop/markers", Kind.REPORT, quality=Quality.REPORT, message="visualization_msgs/msg/MarkerArray")
"""Topic of the shapes that show fixture, forces and paths of an arm."""
Color = tuple[float, float, float, float]
"""Red, green, blue, opacity, 0 to 1."""
_NONE = np.zeros((0, 3))


class MarkerShape(IntEnum):
    """Values of the field ``type`` of visualization_msgs/Marker."""

    ARROW = 0
    CUBE = 1
    SPHERE = 2
    LINE_STRIP = 4
    LINE_LIST = 5


@dataclass(frozen=True, eq=False)
class Marker:
    """One shape that RViz or Foxglove draws.

    Attributes:
        name: Namespace of the marker, different for each marker of a topic.
        frame: Frame in which pose and points are given.
        shape: Type of the shape; a cube or sphere fills the box of size ``scale``.
        pose: Pose of the shape (7,): x, y, z [m], quaternion w, x, y, z.
        scale: Size along x, y, z [m]. For a line, the first value is its width. For an arrow between two points, the
            values are the shaft diameter, the head diameter and the head length.
        color: Colour of the shape.
        points: Points of a line, or start and tip of an arrow (N, 3) [m].
        is_shown: Whether the marker is drawn; False removes it.
    """

    name: str
    frame: str
    shape: MarkerShape
    pose: Array = field(default_factory=lambda: np.array([0.0, 0, 0, 1, 0, 0, 0]))
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    color: Color = (1.0, 1.0, 1.0, 1.0)
    points: Array = field(default_factory=_NONE.copy)
    is_shown: bool = True


def marker_message(stamp_ns: int, markers: Iterable[Marker]) -> bytes:
    """Message of ``visualization_msgs/MarkerArray``.

    Args:
        stamp_ns: Stamp of all markers [ns].
        markers: The shapes.
    """
    shapes, cdr = list(markers), Template()
    cdr.length(len(shapes))
    for marker in shapes:
        _append(cdr, stamp_ns, marker)
    return bytes(cdr.template)


def _append(cdr: Template, stamp_ns: int, marker: Marker) -> None:
    x, y, z, qw, qx, qy, qz = marker.pose.tolist()
    cdr.numbers("i", stamp_ns // SECOND_NS)
    cdr.numbers("I", stamp_ns % SECOND_NS)
    cdr.string(marker.frame)
    cdr.string(marker.name)
    cdr.numbers("i", 0, int(marker.shape), 0 if marker.is_shown else 2)
    cdr.numbers("d", x, y, z, qx, qy, qz, qw, *marker.scale)
    cdr.numbers("f", *marker.color)
    cdr.numbers("I", 0, 0)  # lifetime 0: the marker stays until it is replaced
    cdr.numbers("B", 1)  # frame_locked: the marker moves with its frame
    cdr.length(len(marker.points))
    if len(marker.points):
        cdr.block("d", np.ascontiguousarray(marker.points, np.float64).tobytes())
    cdr.length(0)  # colours of the points
    cdr.string("")  # texture_resource
    cdr.numbers("I", 0, 0)
    for _ in range(2):  # frame and format of the texture
        cdr.string("")
    cdr.length(0)
    cdr.length(0)  # uv_coordinates
    for _ in range(3):  # text, mesh_resource, name of mesh_file
        cdr.string("")
    cdr.length(0)
    cdr.numbers("B", 0)
