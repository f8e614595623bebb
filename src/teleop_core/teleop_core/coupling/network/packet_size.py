"""Size of a packet: its header, and the CDR bytes of each topic that it carries.

Every message is counted as ROS 2 serialises it. All topics of a packet are assumed to share one
datagram; what a middleware adds (RTPS headers, acknowledgements, discovery) is not counted.

Source:
    CDR, plain: OMG DDS-XTypes 1.3, 7.4. Header of IPv4: RFC 791, 3.1; of UDP: RFC 768.
"""

import numpy as np

from teleop_core.graph.topics import Topic
from teleop_core.kernels.geometry import Array

HEADER = 20 + 8
"""Bytes of the headers of IPv4, without options, and UDP."""
_ENCAPSULATION, _STAMP, _LENGTH, _DOUBLE = 4, 8, 4, 8


def message_size(topic: Topic) -> int:
    """Bytes of one message of a topic without joints, in CDR.

    Args:
        topic: The topic; its frame and the names of its numbers add to the size, because the message contains them.
    """
    size, names = _text(_STAMP, topic.frame_id), topic.names(())
    if not topic.kind.has_names:
        return _ENCAPSULATION + _aligned(size, _DOUBLE) + topic.width(0) * _DOUBLE
    size = _aligned(size, _LENGTH) + _LENGTH
    for name in names:
        size = _text(size, name)
    size = _aligned(_aligned(size, _LENGTH) + _LENGTH, _DOUBLE) + len(names) * _DOUBLE
    return _ENCAPSULATION + size + 2 * _LENGTH  # neither speeds nor efforts


def message_sizes(topics: tuple[Topic, ...]) -> Array:
    """Bytes of one message of each topic (K,)."""
    return np.array([message_size(topic) for topic in topics], dtype=float)


def _aligned(size: int, step: int) -> int:
    return -(-size // step) * step


def _text(size: int, text: str) -> int:
    """Size after a text was added: the text's length field, its bytes, and a zero."""
    return _aligned(size, _LENGTH) + _LENGTH + len(text.encode()) + 1
