"""Bags of others: messages of both versions of ROS, and files of them as the rosbags library writes them."""

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from teleop_core.kernels.geometry import Array

Messages = Iterable[tuple[str, int, Any]]
"""Topics, log times [ns] and messages."""


@cache
def types_of(is_ros2: bool) -> Typestore:
    found = get_typestore(Stores.ROS2_JAZZY if is_ros2 else Stores.ROS1_NOETIC)
    if not is_ros2:
        text = "geometry_msgs/TransformStamped[] transforms"
        found.register(get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
    return found


class Maker:
    """Messages of either version of ROS."""

    def __init__(self, is_ros2: bool = True) -> None:
        self.types, self.is_ros2 = types_of(is_ros2), is_ros2

    def make(self, name: str, **values: Any) -> object:
        return self.types.types[name](**values)

    def header(self, stamp_ns: int, frame: str = "base", seq: int = 0) -> Any:
        sec, nanosec = divmod(int(stamp_ns), 1_000_000_000)
        stamp = self.make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        more = {} if self.is_ros2 else {"seq": seq}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **more)

    def pose(self, row: Sequence[float] | Array, kind: str, stamp_ns: Any, child: str = "tool", i: int = 0) -> Any:
        """Message number i of a kind, of a row with x, y, z [m] and w, x, y, z of a quaternion."""
        g = "geometry_msgs/msg"
        x, y, z = row[:3]
        turn = self.make(f"{g}/Quaternion", **dict(zip("wxyz", row[3:], strict=True)))
        pose = self.make(f"{g}/Pose", position=self.make(f"{g}/Point", x=x, y=y, z=z), orientation=turn)
        move = self.make(f"{g}/Transform", translation=self.make(f"{g}/Vector3", x=x, y=y, z=z), rotation=turn)
        spread = self.make(f"{g}/PoseWithCovariance", pose=pose, covariance=np.full(36, float(i)))
        head = self.header(stamp_ns, seq=i)
        moved = self.make(f"{g}/TransformStamped", header=head, child_frame_id=child, transform=move)
        zero = self.make(f"{g}/Vector3", x=0.0, y=0.0, z=float(i))
        twist = self.make(
            f"{g}/TwistWithCovariance",
            covariance=np.zeros(36),
            twist=self.make(f"{g}/Twist", linear=zero, angular=zero),
        )
        return {
            "PoseStamped": lambda: self.make(f"{g}/PoseStamped", header=head, pose=pose),
            "PoseWithCovarianceStamped": lambda: self.make(f"{g}/PoseWithCovarianceStamped", header=head, pose=spread),
            "TransformStamped": lambda: moved,
            "Odometry": lambda: self.make(
                "nav_msgs/msg/Odometry", header=head, child_frame_id=child, pose=spread, twist=twist
            ),
            "Pose": lambda: pose,
            "Transform": lambda: move,
            "TFMessage": lambda: self.make("tf2_msgs/msg/TFMessage", transforms=[moved]),
        }[kind]()

    def joy(self, stamp_ns: Any, buttons: list[int]) -> Any:
        return self.make(
            "sensor_msgs/msg/Joy",
            header=self.header(stamp_ns),
            axes=np.zeros(2, np.float32),
            buttons=np.array(buttons, np.int32),
        )


def write2(
    path: Path,
    messages: Messages,
    storage: StoragePlugin = StoragePlugin.MCAP,
    compression: CompressionMode | None = None,
) -> Path:
    """Rosbag2 directory."""
    writer = Writer2(path, version=9, storage_plugin=storage)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    return _filled(path, writer, messages, types_of(True), types_of(True).serialize_cdr)


def write1(path: Path, messages: Messages, compression: Writer1.CompressionFormat | None = None) -> Path:
    """ROS 1 bag."""
    writer = Writer1(path)
    if compression is not None:
        writer.set_compression(compression)
    return _filled(path, writer, messages, types_of(False), types_of(False).serialize_ros1)


def _filled(
    path: Path, writer: Writer1 | Writer2, messages: Messages, types: Typestore, serialise: Callable[..., Any]
) -> Path:
    made: dict[str, Any] = {}
    with writer:
        for topic, log_ns, message in messages:
            kind = message.__msgtype__
            if topic not in made:
                made[topic] = writer.add_connection(topic, kind, typestore=types)
            writer.write(made[topic], int(log_ns), serialise(message, kind))
    return path
