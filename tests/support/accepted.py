"""What a live input says to values: its own kernel is asked, without a middleware."""

from typing import Any

import numpy as np

from teleop_core.bags.messages import Refusal
from teleop_core.graph.topics import Kind
from teleop_core.kernels.fields import record
from teleop_core.nodes import wire
from teleop_core.nodes.sender import Sender


def why_refused(kind: Kind, stamp_ns: int, values: Any, last_ns: int | None) -> Refusal | None:
    """Reason why a live input refuses values after a message with the stamp ``last_ns``; None if it takes them."""
    reading: Any = record(wire.Reading)
    row, target, sender = values.copy(), np.zeros(len(values)), Sender(into=reading)
    reading.width, reading.is_pose = len(values), kind is Kind.POSE
    reading.row_at, reading.target_at = row.ctypes.data, target.ctypes.data
    if last_ns is not None:
        reading.has_stamp, reading.stamp_ns = 1, last_ns
    is_accepted = wire.accept(sender.own, stamp_ns, 0, 0)
    assert np.array_equal(target, values) or not is_accepted
    assert is_accepted or not target.any()
    found = [reason for reason, count in zip(wire.REASONS, reading.refused, strict=False) if count]
    assert len(found) == 1 - is_accepted
    return found[0] if found else None
