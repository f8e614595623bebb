"""Sender: information about a topic's sender from the numbers and stamps of its messages.

The middleware identifies the publisher of each message, and numbers each publisher's messages from 1 on. The first
publisher is the owner of a topic; messages of other publishers are refused until the owner has been silent for some
time. A missing number means a lost message.
"""

from enum import Enum

from teleop_core.bags.messages import Refusal
from teleop_core.nodes.rate import Recent

SECOND_NS = 1_000_000_000
AHEAD_NS = SECOND_NS
"""A stamp that is farther in the future than this comes from another clock [ns]."""


class StampFault(Enum):
    """Fault of a sender's stamps, with advice."""

    ZERO = "its stamps are 0: stamp each message with the time of its sample"
    FROZEN = "its stamps do not move: stamp each message with the time of its sample"
    BACKWARDS = "its stamps go back: send from one source, in order"


class Sender:
    """Data about the sender of one topic.

    Args:
        limit: Largest number of messages per second; further messages are refused as a flood.
        silence: Time without a message after which another sender may become the owner of the topic [s].

    Attributes:
        gaps: Messages of the owner that did not arrive.
        repeats: Messages with the same stamp as the previous message.
        reordered: Messages with an older stamp than the previous message.
        owners: Number of senders that have owned the topic.
        conflict: Whether two senders sent at the same time; reset by :meth:`forget`.
        ages: Times from the stamp of a message to its arrival [ns], for the last thousand messages.
    """

    def __init__(self, limit: int = 5000, silence: float = 0.5) -> None:
        self._limit, self._silence_ns = limit, round(silence * SECOND_NS)
        self.gaps = self.repeats = self.reordered = self.owners = 0
        self.ages = Recent()
        self.forget()

    def forget(self) -> None:
        """Make the sender of the next message the owner."""
        self._owner, self._number, self._heard_ns = b"", 0, 0
        self._window_ns = self._in_window = 0
        self.has_other = self.conflict = False
        self.fault: StampFault | None = None
        self.clear_ages()

    def clear_ages(self) -> None:
        """Delete the ages, which compare two clocks, because one of the clocks was stepped."""
        self.ages.clear()
        self.newest_age_ns = 0

    def admit(self, sender: bytes, number: int, now_ns: int) -> Refusal | None:
        """Reason to refuse a message before it is read; None for a message of the owner.

        Args:
            sender: Publisher that sent the message.
            number: Number of the message in the publisher's sequence; 0 if the middleware has no numbers.
            now_ns: Monotonic time [ns].
        """
        if now_ns - self._window_ns >= SECOND_NS:
            self._window_ns, self._in_window = now_ns, 0
        self._in_window += 1
        if self._in_window > self._limit:
            return Refusal.FLOOD
        if sender != self._owner:
            if self._owner and now_ns - self._heard_ns <= self._silence_ns:
                self.has_other = True
                return Refusal.SECOND_PUBLISHER
            self._owner, self._number, self.has_other = sender, 0, False
            self.owners += 1
        self._heard_ns = now_ns
        if number > self._number:  # a message that was only overtaken is not lost
            self.gaps += number - self._number - 1 if self._number else 0
            self._number = number
        self.conflict = self.conflict or self.has_other  # the owner still sends
        return None

    def release(self) -> None:
        """Free the topic for another sender, because the owner's publisher no longer exists."""
        self._owner = b""

    def note_stamp(self, stamp_ns: int, now_ns: int) -> None:
        """Store the age of a valid message; ``now_ns`` is the time of the system's clock [ns]."""
        self.newest_age_ns = now_ns - stamp_ns
        self.ages.put(self.newest_age_ns)
        self.fault = None

    def note_old(self, stamp_ns: int, last_ns: int) -> None:
        """Count a message whose stamp is not newer than the last stamp."""
        if stamp_ns < last_ns:
            self.reordered += 1
            self.fault = StampFault.BACKWARDS
        else:
            self.repeats += 1
            self.fault = StampFault.FROZEN
        if stamp_ns == 0:
            self.fault = StampFault.ZERO

    def concerns(self, name: str) -> list[str]:
        """Texts about current problems of the sender, with advice."""
        found = []
        if self.fault is not None:
            found.append(f"{name}: {self.fault.value}")
        if self.newest_age_ns < -AHEAD_NS:
            ahead = f"{-self.newest_age_ns / SECOND_NS:.1f} s ahead of this clock"
            found.append(f"{name}: stamps are {ahead}: set the clocks, or stamp with ROS time")
        return found
