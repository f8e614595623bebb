"""ROS types: definitions, hashes and serialisation of Jazzy messages without a ROS installation."""

import struct
from functools import cache
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

DISTRIBUTION = "jazzy"
_UNREADABLE = (SerdeError, AssertionError, IndexError, ValueError, OverflowError, MemoryError, struct.error)
"""Exceptions that the rosbags library raises for bytes that are not a message of the type."""


@cache
def typestore() -> Any:
    """All message types of the distribution; loaded on first use, which takes 60 ms."""
    return get_typestore(Stores.ROS2_JAZZY)


@cache
def definition(ros_type: str) -> str:
    """Definition of a message type and of all types in it, as the text of a ``ros2msg`` schema."""
    return str(typestore().generate_msgdef(ros_type, ros_version=2)[0])


@cache
def type_hash(ros_type: str) -> str:
    """RIHS01 hash of a message type."""
    return str(typestore().hash_rihs01(ros_type))


def deserialise(data: bytes, ros_type: str) -> Any:
    """Message with the attributes of its ROS type.

    Up to eleven further bytes may follow the message: rclpy's serializer appends four bytes for each of two empty
    lists of doubles.

    Raises:
        ValueError: The bytes are not a message of this type.
    """
    said: Exception | None = None
    for size in (len(data), len(data) - 4, len(data) - 8):  # the type store accepts at most three further bytes
        try:
            return typestore().deserialize_cdr(data[:size], ros_type)
        except _UNREADABLE as error:
            said = said or error
    raise ValueError(f"a message of {len(data)} bytes is no valid {ros_type}: {said}") from said


def serialise(message: Any) -> bytes:
    """CDR bytes of a message whose type is from :func:`typestore`."""
    return bytes(typestore().serialize_cdr(message, message.__msgtype__))
