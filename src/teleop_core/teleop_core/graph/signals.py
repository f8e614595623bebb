"""Signals: one record per stage with the newest value and stamp of every topic at its ports.

A stage is independent of the others: it reads and writes only the fields of its own record. In virtual time the
composed tick copies values from record to record. In a node, subscriptions write into the record and publishers read
from it. The computation is the same.

Every topic has two fields, as :attr:`Topic.field <teleop_core.graph.topics.Topic.field>` names
them: the columns of its kind, and ``<field>_ns``, its stamp [ns].
"""

from collections.abc import Iterable
from typing import Any

from teleop_core.graph.topics import TELEOP_STATE, Kind, Topic
from teleop_core.kernels import Array, kernel, records
from teleop_core.kernels.groups import Field
from teleop_core.kernels.layout import COUNT, PerJoints

TICK_NS = 1_000_000
"""Control period of every stage unless a session says otherwise [ns]."""
DT: float = TICK_NS / 1e9
"""The control period in seconds."""
PHASES = ("take", "step", "give", "tell")
"""Phases of a tick of a live process, whose times its nodes report."""

STATE_FIELDS = TELEOP_STATE.columns
STATE = {name: index for index, name in enumerate(STATE_FIELDS)}


def topic_fields(topics: Iterable[Topic], joints: int) -> list[Field]:
    """Fields of values and stamps of some topics, for a robot with this many joints."""
    fields: list[Field] = []
    for topic in topics:
        width, each = topic.width(joints), topic.width(1)
        fields.append((topic.field, "f8", (PerJoints(joints, each) if topic.kind.has_joints else width,)))
        fields.append((f"{topic.field}_ns", "i8"))
    return fields


def make_signals(topics: Iterable[Topic], joints: int, notes: Iterable[Field] = ()) -> Any:
    """Zeroed signals (1,) with unit quaternions, so that every pose is valid from the start.

    Args:
        topics: Topics for which the record has ports.
        joints: Number of joints of the arm; 0 if no topic has joints.
        notes: Further fields, which are never recorded.

    Returns:
        One record with ``now_ns``, the time of the tick [ns], the topics' fields, and the notes.
    """
    ports = list(topics)
    signals = records([("now_ns", "i8"), *topic_fields(ports, joints), *notes], 1)
    for topic in ports:
        if topic.kind is Kind.POSE:
            signals[topic.field][:, 3] = 1.0
        elif topic.kind is Kind.POSES:
            signals[topic.field][:, 3::7] = 1.0
    return signals


def assign(target: Any, source: Any) -> None:
    """Set all fields of ``target`` to the values of ``source``, a record of the same type, or to 0."""
    for name in target.dtype.names:
        if name == COUNT:
            continue
        target[name] = source if isinstance(source, int) else source[name]


@kernel
def copy(source: Array, target: Array) -> None:
    """Copy a row, element by element: numba cannot pass fields of records to typed pointers."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@kernel
def add(source: Array, target: Array) -> None:
    """Add row ``source`` to row ``target``, element by element."""
    for i in range(target.shape[0]):
        target[i] += source[i]
