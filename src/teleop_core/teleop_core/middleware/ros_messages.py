"""Conversion of messages to bytes and back with ROS's own serializers, for every platform."""

from typing import Any

from rclpy.serialization import deserialize_message, serialize_message


def read_message(data: bytes, kind: Any) -> Any:
    """Message of a class, from its bytes; raises the exceptions of rclpy for malformed bytes."""
    return deserialize_message(data, kind)


def write_message(message: Any) -> bytes:
    """Bytes of a message."""
    data: bytes = serialize_message(message)
    return data
