"""Presses: what messages of emergency stop buttons say, so that no press of one is lost."""


class Presses:
    """Orders the messages of all stop buttons, and takes a lost message as a press.

    Every sender numbers its messages, 1 for the first. A number that is left out belongs to a
    message that was lost, by a full queue, by a process that stood still, or on the way; it may
    have been a press, so it counts as one. Of a sender that is heard for the first time all before
    may have been said long ago; it counts where the listener stood still meanwhile, for it may have
    been sent to it then. A message that arrives twice, through two readers, counts once.
    """

    def __init__(self) -> None:
        self._last: dict[bytes, int] = {}
        self._missing = self._told = 0

    @property
    def lost(self) -> int:
        """Messages that were lost so far, by their numbers or by the middleware's account."""
        return max(self._missing, self._told)

    def lose(self, count: int) -> tuple[bool, ...]:
        """States of the button that the middleware's own account of lost messages adds.

        Args:
            count: Messages that it has lost so far, of all senders.

        Returns:
            A press if these are more than at the last call; otherwise nothing. A loss that the
            numbers told too may give a second press: taking it off the account could hide the loss
            of another sender.
        """
        is_new = count > self._told
        self._told = count
        return (True,) if is_new else ()

    def take(
        self, sender: bytes, number: int, *, is_pressed: bool, stood_still: bool = False
    ) -> tuple[bool, ...]:
        """States of the button, oldest first, that a message of a reliable sender adds.

        Args:
            sender: Identity of the sender.
            number: Number of the message at its sender, 1 for the first; 0 where the middleware
                does not number messages.
            is_pressed: What the message says.
            stood_still: Whether the listener has just stood still.

        Returns:
            Nothing for a message that was taken already; a press first where messages are missing
            before this one. Of a sender that is heard for the first time nothing is missing, but
            after a standstill all before.
        """
        last = self._last.get(sender, 0 if stood_still else number - 1)
        if 0 < number <= last:
            return ()
        self._last[sender] = number
        missing = max(0, number - last - 1)
        self._missing += missing
        return (True, is_pressed) if missing else (is_pressed,)

    def knows(self, sender: bytes) -> bool:
        """Whether a reliable message of this sender has been taken."""
        return sender in self._last
