"""Presses: what messages of emergency stop buttons say, so that no press of one is lost."""


class Presses:
    """Orders the messages of all stop buttons, and takes a lost message as a press.

    Every sender numbers its messages, 1 for the first. A number that is left out belongs to a
    message that was lost, by a full queue, by a process that stood still, or on the way; it may
    have been a press, so it counts as one. A message that arrives twice, through two readers,
    counts once.
    """

    def __init__(self) -> None:
        self._last: dict[bytes, int] = {}
        self.lost = 0
        """Messages that were lost so far."""

    def take(self, sender: bytes, number: int, *, is_pressed: bool) -> tuple[bool, ...]:
        """States of the button, oldest first, that a message of a reliable sender adds.

        Args:
            sender: Identity of the sender.
            number: Number of the message at its sender, 1 for the first; 0 where the middleware
                does not number messages.
            is_pressed: What the message says.

        Returns:
            Nothing for a message that was taken already; a press first where messages are missing
            before this one. Of a sender that is heard for the first time nothing is missing.
        """
        last = self._last.get(sender, number - 1)
        if 0 < number <= last:
            return ()
        self._last[sender] = number
        missing = max(0, number - last - 1)
        self.lost += missing
        return (True, is_pressed) if missing else (is_pressed,)

    def knows(self, sender: bytes) -> bool:
        """Whether a reliable message of this sender has been taken."""
        return sender in self._last
