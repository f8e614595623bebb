"""Series: the messages of one topic as columns, collected from successive parts of a recording."""

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags import messages, ros_types, walk
from teleop_core.bags.layouts import Bytes, Layout, Stamps, Values, discover, frame_of
from teleop_core.graph.topics import BY_NAME, Kind


@dataclass(frozen=True, eq=False)
class Series:
    """Messages of one topic in the order of their log times.

    Attributes:
        stamp_ns: Stamps of the headers, shape (N,), [ns].
        log_ns: Times of recording, shape (N,), [ns].
        values: Columns as in :class:`~teleop_core.graph.topics.Kind`, shape (N, width).
        names: Joint names in the order of the columns; empty without joints.
        frame_id: Frame in the header of the first message.
    """

    stamp_ns: Stamps
    log_ns: Stamps
    values: Values
    names: tuple[str, ...] = ()
    frame_id: str = ""

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def at(self, time_ns: int) -> int:
        """Index of the last message recorded at or before a time [ns]; -1 if the time is before the first message."""
        return int(np.searchsorted(self.log_ns, time_ns, side="right")) - 1

    def only(self, is_kept: NDArray[np.bool_]) -> "Series":
        """The messages for which ``is_kept``, shape (N,), is True."""
        return self if is_kept.all() else self[is_kept]

    def __getitem__(self, rows: slice | NDArray[np.bool_] | NDArray[np.int64]) -> "Series":
        """Messages selected by a slice, a mask or an array of indices."""
        stamps, logs, values = self.stamp_ns[rows], self.log_ns[rows], self.values[rows]
        return Series(stamps, logs, values, self.names, self.frame_id)


def empty(width: int) -> Series:
    """Series without messages, with ``width`` columns."""
    return Series(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, width)))


def kind_of(name: str, ros_type: str) -> Kind | None:
    """Kind of a topic's values; None if messages of its type cannot be read."""
    topic = BY_NAME.get(name)
    if topic is not None and topic.kind.ros_type == ros_type:
        return topic.kind
    return next((kind for kind in reversed(Kind) if kind.ros_type == ros_type), None)


class UnreadableMessageError(ValueError):
    """Bytes that are not a valid message of their type."""


class Column:
    """Reader of one topic's messages; malformed messages are left out and counted.

    Args:
        name: Topic.
        kind: Kind of the values. For joints of a topic that this package does not define, the first message determines
            the kind.
        joint_names: Wanted order of the joints; empty for the order in the first message.

    Attributes:
        total: Number of all messages.
        left_out: Number of messages that were left out, by reason.
    """

    def __init__(self, name: str, kind: Kind, joint_names: tuple[str, ...]) -> None:
        self.name, self.kind, self._wanted = name, kind, joint_names
        self._layout: Layout | None = None
        self.names: tuple[str, ...] = ()
        self.frame_id = ""
        self._is_new = True
        self.total, self.left_out, self._frames = 0, Counter[messages.Refusal](), Counter[str]()

    def read(self, data: Bytes, begins: Stamps, sizes: Stamps, log_ns: Stamps) -> Series:
        """Series of messages ``data[begins[i] : begins[i] + sizes[i]]``.

        Raises:
            ValueError: The topic lacks wanted joints; the error text names them.
        """
        self.total += len(begins)
        if self._is_new:
            self._begin(data, begins, sizes)
        found = self._fast(data, begins, sizes)
        if found is not None:
            return Series(found[0], log_ns.copy(), found[1], self.names, self.frame_id)
        stamps, values, kept = self._slow(data, begins, sizes)
        return Series(stamps, log_ns[kept], values, self.names, self.frame_id)

    def notes(self) -> list[str]:
        """Notes for the user on messages that were left out, with the reason, and on messages in another frame."""
        return [
            f"{self.name}: {count} of {self.total} messages are left out: each {reason.value}"
            for reason, count in self.left_out.items()
        ] + [
            f"{self.name}: {count} messages are in the frame {frame!r}, but the first is in {self.frame_id!r}"
            for frame, count in self._frames.items()
            if frame != self.frame_id and not self.kind.has_names
        ]

    def _begin(self, data: Bytes, begins: Stamps, sizes: Stamps) -> None:
        """Learn the layout from the first readable message; messages of the most frequent size are tried first."""
        usual = np.bincount(sizes).argmax() if len(sizes) else 0
        for i in np.argsort(sizes != usual, kind="stable").tolist():
            try:
                self._learn(bytes(data[begins[i] : begins[i] + sizes[i]]))
            except UnreadableMessageError:
                continue
            self._is_new = False
            return

    def _learn(self, first: bytes) -> None:
        if self.kind is Kind.STATE and self.name not in BY_NAME:
            message = self._deserialised(first)
            self.kind = Kind.STATE if len(message.velocity) else Kind.JOINTS
        self._layout = discover(self.kind, first)
        if self._layout is not None:
            names, self.frame_id = self._layout.joint_names, self._layout.frame_id
        else:
            message = self._deserialised(first)
            names, self.frame_id = tuple(getattr(message, "name", ())), message.header.frame_id
        self.names = (self._wanted or names) if names else ()
        if missing := [name for name in self.names if name not in names]:
            raise ValueError(f"lacks joints {', '.join(missing)}; it has {', '.join(names)}")

    def _fast(self, data: Bytes, begins: Stamps, sizes: Stamps) -> tuple[Stamps, Values] | None:
        form = self._layout
        if form is None or not len(sizes) or sizes.min() != sizes.max() or sizes[0] < form.size:
            return None
        rows = walk.gather(data, begins, form.template, form.mask)
        if rows is None:
            return None
        stamps, values = form.decode(rows)
        if self.names != form.joint_names:
            count = len(form.joint_names)
            joints = [form.joint_names.index(name) for name in self.names]
            columns = [part + joint for part in range(0, form.width, count) for joint in joints]
            values = values[:, columns]
        return stamps, values

    def _slow(self, data: Bytes, begins: Stamps, sizes: Stamps) -> tuple[Stamps, Values, list[int]]:
        """Stamps and values, read message by message, and the indices of the messages that could be read."""
        stamps: list[int] = []
        values: list[Values] = []
        kept: list[int] = []
        for i, (begin, size) in enumerate(zip(begins.tolist(), sizes.tolist(), strict=True)):
            result = messages.read_any(self.kind, bytes(data[begin : begin + size]), self.names)
            if isinstance(result, messages.Refusal):
                self.left_out[result] += 1
                continue
            kept.append(i)
            self._frames[frame_of(bytes(data[begin : begin + size]))] += 1
            stamps.append(result[0])
            values.append(result[1])
        width = self.kind.width(len(self.names))
        return np.array(stamps, np.int64), np.array(values).reshape(-1, width), kept

    def _deserialised(self, data: bytes) -> Any:
        try:
            return ros_types.deserialise(data, self.kind.ros_type)
        except ValueError as error:
            raise UnreadableMessageError(str(error)) from error


def join(parts: list[Series], column: Column) -> Series:
    """One series of all parts, sorted by log time."""
    if not parts:
        width = column.kind.width(len(column.names))
        return empty(width)
    return replace(in_order(parts), names=column.names, frame_id=column.frame_id)


def in_order(parts: list[Series]) -> Series:
    """One series of all parts, sorted by log time; joint names are those of the first part.

    The argument ``parts`` must not be empty.
    """
    stamps = np.concatenate([part.stamp_ns for part in parts])
    logs = np.concatenate([part.log_ns for part in parts])
    values = np.concatenate([part.values for part in parts])
    whole = Series(stamps, logs, values, parts[0].names, parts[0].frame_id)
    return whole[np.argsort(logs, kind="stable")] if (np.diff(logs) < 0).any() else whole
