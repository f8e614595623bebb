"""Sender: what the numbers and stamps of a topic's messages tell about who sends them.

The middleware numbers the messages of each publisher from 1 on, and does not say which publisher a
message is from. Two publishers therefore show as numbers that jump to and fro. The owner of a topic
is who was first; messages of others are refused until the owner has been silent for a while.
"""

from enum import Enum

from teleop_core.bags.messages import Refusal
from teleop_core.nodes.rate import Recent

SECOND_NS = 1_000_000_000
AHEAD_NS = SECOND_NS
"""Stamps that lie farther in the future are those of another clock [ns]."""
_JUMP = 100
"""Messages that may be lost at once, beside what a flood would have brought in between."""


class StampFault(Enum):
    """What is wrong with the stamps of a sender, and what to do about it."""

    ZERO = "its stamps are 0: stamp each message with the time of its sample"
    FROZEN = "its stamps do not move: stamp each message with the time of its sample"
    BACKWARDS = "its stamps go back: send from one source, in order"


class Sender:
    """What is known of the sender of one topic.

    Args:
        limit: Messages a second beyond which the rest is refused as a flood.
        silence: Time without a message after which another sender may take the topic [s].

    Attributes:
        gaps: Messages of the owner that did not arrive.
        repeats: Messages with the stamp of the one before.
        reordered: Messages with an older stamp than the one before.
        owners: How many senders have owned the topic.
        conflict: Whether two senders were heard at once, until :meth:`forget`.
        ages: Time from the stamp of a message to its arrival [ns], of the last thousand.
    """

    def __init__(self, limit: int = 5000, silence: float = 0.5) -> None:
        self._limit, self._silence_ns = limit, round(silence * SECOND_NS)
        self.gaps = self.repeats = self.reordered = self.owners = 0
        self.ages = Recent()
        self.forget()

    def forget(self) -> None:
        """Let the next message be that of the owner, whoever sends it."""
        self._number = self._sent_ns = self._heard_ns = self._window_ns = self._in_window = 0
        self.has_other = self.conflict = False
        self.fault: StampFault | None = None
        self.clear_ages()

    def clear_ages(self) -> None:
        """Begin anew with times that two clocks make up, as after one of them was stepped."""
        self.ages.clear()
        self.newest_age_ns = 0

    def admit(self, number: int, sent_ns: int, now_ns: int) -> Refusal | None:
        """Reason to refuse a message before it is read; None for one of the owner.

        Args:
            number: Its number in its publisher's sequence; 0 where the middleware has none.
            sent_ns: When it was sent, by the clock of the sender [ns].
            now_ns: Monotonic time [ns].
        """
        if now_ns - self._window_ns >= SECOND_NS:
            self._window_ns, self._in_window = now_ns, 0
        self._in_window += 1
        if self._in_window > self._limit:
            return Refusal.FLOOD
        step = number - self._number
        if step != 1 and self._number and number and not self._is_own(step, sent_ns, now_ns):
            self.has_other = True
            return Refusal.SECOND_PUBLISHER
        self._number, self._sent_ns, self._heard_ns = number, sent_ns, now_ns
        self.conflict = self.conflict or self.has_other  # the owner is still there
        self.owners = self.owners or 1
        return None

    def _is_own(self, step: int, sent_ns: int, now_ns: int) -> bool:
        """Whether a message that is not the next one may be the owner's, or makes a new owner.

        The owner can have sent no more messages in between than there was time for; how long they
        took to arrive tells nothing.
        """
        between_ns = max(sent_ns - self._sent_ns, 0)
        if 0 < step <= _JUMP + self._limit * between_ns // SECOND_NS:
            self.gaps += step - 1
            return True
        if now_ns - self._heard_ns > self._silence_ns:
            self.owners += 1
            self.has_other = False
            return True
        return False

    def release(self) -> None:
        """Let another sender have the topic: the owner's publisher is gone."""
        self._number = 0
        self.has_other = False

    def note_stamp(self, stamp_ns: int, now_ns: int) -> None:
        """Note the age of a sound message; ``now_ns`` is the time of the system's clock [ns]."""
        self.newest_age_ns = now_ns - stamp_ns
        self.ages.put(self.newest_age_ns)
        self.fault = None

    def note_old(self, stamp_ns: int, last_ns: int) -> None:
        """Note a message whose stamp is not newer than the last one."""
        if stamp_ns < last_ns:
            self.reordered += 1
            self.fault = StampFault.BACKWARDS
        else:
            self.repeats += 1
            self.fault = StampFault.FROZEN
        if stamp_ns == 0:
            self.fault = StampFault.ZERO

    def concerns(self, name: str) -> list[str]:
        """What is wrong with the sender now, in words that say what to do."""
        found = []
        if self.fault is not None:
            found.append(f"{name}: {self.fault.value}")
        if self.newest_age_ns < -AHEAD_NS:
            ahead = f"{-self.newest_age_ns / SECOND_NS:.1f} s ahead of this clock"
            found.append(f"{name}: stamps are {ahead}: set the clocks, or stamp with ROS time")
        return found
