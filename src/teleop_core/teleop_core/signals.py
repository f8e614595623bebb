"""Signals: the newest value of every topic, as one record that all stages read and write.

In virtual time the stages share one record, so a stage reads what the stages before it wrote in
this tick and what the stages after it wrote in the last one. As a node, each stage has a record of
its own that its subscriptions fill and its publishers empty. The arithmetic is the same.
"""

from typing import Any

import numpy as np

from teleop_core.geometry import Array
from teleop_core.kernels import kernel
from teleop_core.topics import STREAMS, Kind

TICK_NS = 1_000_000
"""Control period of every stage [ns]."""
DT = 1e-3
"""Control period of every stage [s]."""

# What teleop/state reports, beside the streams; f8 so that a change is one comparison of rows.
STATE_FIELDS = (
    "is_following", "is_clutched", "is_fine", "gain", "is_fixture_on",
    "fixture_center_x", "fixture_center_y", "fixture_center_z",
    "fixture_size_x", "fixture_size_y", "fixture_size_z",
)  # fmt: skip
STATE = {name: index for index, name in enumerate(STATE_FIELDS)}


def signals_dtype(joints: int) -> np.dtype[Any]:
    """Record type for a slave with this many joints.

    One field per stream, named as :attr:`Topic.field`, with the columns of its kind; ``stamp_ns``
    of the master sample in force; ``now_ns``, the time of the slave's tick; ``servo_stamp_ns``
    and ``setpoint_stamp_ns``, the stamps that slave/servo_jp and slave/setpoint_js carry;
    ``teleop_state``, the columns :data:`STATE_FIELDS`; and how inverse kinematics and the slave
    took the command.
    """
    streams = [(topic.field, "f8", (topic.kind.width(joints),)) for topic in STREAMS]
    names = ("stamp_ns", "now_ns", "servo_stamp_ns", "setpoint_stamp_ns")
    stamps = [(name, "i8") for name in names]
    report = [
        ("teleop_state", "f8", (len(STATE_FIELDS),)),
        ("ik_residual", "f8", (2,)),
        ("ik_status", "i8"),
        ("command_status", "i8"),
    ]
    return np.dtype([*stamps, *streams, *report])


def make_signals(joints: int, count: int = 1) -> Any:
    """Zeroed signals (count,) with unit quaternions, so that every pose is valid from the start."""
    signals = np.zeros(count, signals_dtype(joints))
    for topic in STREAMS:
        if topic.kind is Kind.POSE:
            signals[topic.field][:, 3] = 1.0
    return signals


@kernel
def copy(source: Array, target: Array) -> None:
    """Copy a row, element by element: numba cannot pass fields of records to typed pointers."""
    for i in range(target.shape[0]):
        target[i] = source[i]
