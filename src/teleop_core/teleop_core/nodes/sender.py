"""Sender: information about a topic's sender from the numbers and stamps of its messages.

The middleware identifies the publisher of each message, and numbers each publisher's messages from 1 on. The first
publisher is the owner of a topic; messages of other publishers are refused until the owner has been silent for some
time. A missing number means a lost message. The rules are kernels of :mod:`teleop_core.nodes.wire`.
"""

from enum import Enum
from functools import lru_cache
from typing import Any

from teleop_core.bags.messages import Refusal
from teleop_core.kernels.fields import Cells, record
from teleop_core.nodes import wire
from teleop_core.nodes.rate import Recent

SECOND_NS = wire.SECOND_NS
AHEAD_NS = SECOND_NS
"""A stamp that is farther in the future than this comes from another clock [ns]."""


class StampFault(Enum):
    """Fault of a sender's stamps, with advice."""

    ZERO = "its stamps are 0: stamp each message with the time of its sample"
    FROZEN = "its stamps do not move: stamp each message with the time of its sample"
    BACKWARDS = "its stamps go back: send from one source, in order"


_FAULTS = {wire.ZERO: StampFault.ZERO, wire.FROZEN: StampFault.FROZEN, wire.BACKWARDS: StampFault.BACKWARDS}


@lru_cache(maxsize=1024)
def halves(sender: bytes) -> tuple[int, int]:
    """First and last eight bytes of a publisher's identifier, as integers."""
    return int.from_bytes(sender[:8], "little", signed=True), int.from_bytes(sender[8:16], "little", signed=True)


class Sender:
    """Data about the sender of one topic.

    Args:
        limit: Largest number of messages per second; further messages are refused as a flood.
        silence: Time without a message after which another sender may become the owner of the topic [s].
        into: Record of :class:`~teleop_core.nodes.wire.Reading` that holds the data; None for a record of its own.

    Attributes:
        own: The record.
        ages: Times from the stamp of a message to its arrival [ns], for the last thousand messages.
    """

    def __init__(self, limit: int = 5000, silence: float = 0.5, into: Any = None) -> None:
        self.own: Any = record(wire.Reading) if into is None else into
        self._cells, self.ages = Cells(self.own), Recent()
        self._cells["limit"], self._cells["silence_ns"] = limit, round(silence * SECOND_NS)
        numbers, count = self.ages.numbers, self.ages.count
        self._cells["ages_at"], self._cells["ages"] = numbers.ctypes.data, len(numbers)
        self._cells["ages_count_at"] = count.ctypes.data
        self.forget()

    @property
    def gaps(self) -> int:
        """Messages of the owner that did not arrive."""
        return int(self._cells["gaps"])

    @property
    def repeats(self) -> int:
        """Messages with the same stamp as the previous message."""
        return int(self._cells["repeats"])

    @property
    def reordered(self) -> int:
        """Messages with an older stamp than the previous message."""
        return int(self._cells["reordered"])

    @property
    def owners(self) -> int:
        """Number of senders that have owned the topic."""
        return int(self._cells["owners"])

    @property
    def conflict(self) -> bool:
        """Whether two senders sent at the same time; reset by :meth:`forget`."""
        return bool(self._cells["conflict"])

    @property
    def fault(self) -> StampFault | None:
        """Fault of the newest stamps."""
        return _FAULTS.get(self._cells["fault"])

    @property
    def newest_age_ns(self) -> int:
        """Time from the stamp of the newest message to its arrival [ns]."""
        return int(self._cells["newest_age_ns"])

    def forget(self) -> None:
        """Make the sender of the next message the owner."""
        for name in ("has_owner", "number", "heard_ns", "window_ns", "in_window", "has_other", "conflict", "fault"):
            self._cells[name] = 0
        self.clear_ages()

    def clear_ages(self) -> None:
        """Delete the ages, which compare two clocks, because one of the clocks was stepped."""
        self.ages.clear()
        self._cells["newest_age_ns"] = 0

    def admit(self, sender: bytes, number: int, now_ns: int) -> Refusal | None:
        """Reason to refuse a message before it is read; None for a message of the owner.

        Args:
            sender: Publisher that sent the message, at most 16 bytes.
            number: Number of the message in the publisher's sequence; 0 if the middleware has no numbers.
            now_ns: Monotonic time [ns].
        """
        reason = wire.admit(self.own, *halves(sender), number, now_ns)
        return wire.REASONS[reason - 1] if reason else None

    def release(self) -> None:
        """Free the topic for another sender, because the owner's publisher no longer exists."""
        self._cells["has_owner"] = 0

    def note_stamp(self, stamp_ns: int, now_ns: int) -> None:
        """Store the age of a valid message; ``now_ns`` is the time of the system's clock [ns]."""
        wire.note_stamp(self.own, stamp_ns, now_ns)

    def note_old(self, stamp_ns: int, last_ns: int) -> None:
        """Count a message whose stamp is not newer than the last stamp."""
        wire.note_old(self.own, stamp_ns, last_ns)

    def concerns(self, name: str) -> list[str]:
        """Texts about current problems of the sender, with advice."""
        found = []
        if self.fault is not None:
            found.append(f"{name}: {self.fault.value}")
        if self.newest_age_ns < -AHEAD_NS:
            ahead = f"{-self.newest_age_ns / SECOND_NS:.1f} s ahead of this clock"
            found.append(f"{name}: stamps are {ahead}: set the clocks, or stamp with ROS time")
        return found
