"""Messages as bytes and back, by ROS's own serializers, whatever world they travel in."""

from typing import Any

from rclpy.serialization import deserialize_message, serialize_message


def read_message(data: bytes, kind: Any) -> Any:
    """Message of a class, from its bytes; raises what rclpy raises for malformed bytes."""
    return deserialize_message(data, kind)


def write_message(message: Any) -> bytes:
    """Bytes of a message."""
    data: bytes = serialize_message(message)
    return data
