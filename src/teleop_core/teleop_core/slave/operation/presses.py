"""Presses: which emergency stop buttons hold the stop pressed, so that no press is lost."""


class Presses:
    """State of every stop button that was heard, and of the stop that all of them share.

    The stop is pressed while at least one button holds it. A button holds it from its press to its
    own release: what another button says releases nothing. :meth:`release` overrides them all.

    Every button numbers its messages, 1 for the first. A missing number belongs to a message that was lost: by a full
    queue, by a process that stood still, or on the way. It may have been a press, so it counts as one. What a button
    said before it is heard for the first time may have been sent to this listener too, so messages before the first one
    count as missing, unless the listener is idle. A message that arrives twice, through two readers, counts once.

    Of a button that says nothing, nobody knows whether it is pressed: it holds the stop (:meth:`doubt`).

    Methods that take a message return what the stop is after it, oldest first: a press alone
    (True), followed by False where no button holds the stop any more.
    """

    def __init__(self) -> None:
        self._last: dict[bytes, int] = {}
        self._heard_ns: dict[bytes, int] = {}
        self._holders: dict[bytes, None] = {}  # in the order of their presses
        self._doubted: set[bytes] = set()
        self._missing = self._told = 0

    @property
    def lost(self) -> int:
        """Messages that were lost so far, by their numbers or by the middleware's account."""
        return max(self._missing, self._told)

    @property
    def holders(self) -> tuple[bytes, ...]:
        """Buttons that hold the stop pressed, in the order of their presses."""
        return tuple(self._holders)

    @property
    def heard_ns(self) -> int | None:
        """Time of the last message of the button that is silent longest [ns]; None without one."""
        return min(self._heard_ns.values(), default=None)

    def silent(self, since_ns: int) -> tuple[bytes, ...]:
        """Buttons that have said nothing since a time [ns]."""
        return tuple(one for one, heard_ns in self._heard_ns.items() if heard_ns < since_ns)

    def lose(self, count: int) -> tuple[bool, ...]:
        """Take the middleware's count of lost messages, whose senders are unknown.

        Args:
            count: Messages that it has lost so far, of all buttons.

        Returns:
            A press, if these are more than at the last call. A loss that the numbers told too may
            give a second press: subtracting it could hide a loss of another button.
        """
        is_new = count > self._told
        self._told = count
        return self._pressed() if is_new else ()

    def take(
        self, sender: bytes, number: int, now_ns: int, *, is_pressed: bool, is_idle: bool = False
    ) -> tuple[bool, ...]:
        """Take a message of a reliable button.

        Args:
            sender: Identity of the button.
            number: Number of the message at its button, 1 for the first; 0 where the middleware
                does not number messages.
            now_ns: Time [ns], of any clock that never goes back.
            is_pressed: What the message says.
            is_idle: Whether a press that a person made before this button was heard for the first
                time stops nothing: the arm is disabled.

        Returns:
            Nothing for a message that was taken already.
        """
        last = self._last.get(sender, number - 1 if is_idle else 0)
        if 0 < number <= last:
            return ()
        self._last[sender] = number
        missing = max(0, number - last - 1)
        self._missing += missing
        said = self._note(sender, now_ns, is_pressed=is_pressed)
        return (True, *said) if missing else said

    def overhear(self, sender: bytes, now_ns: int, *, is_pressed: bool) -> tuple[bool, ...]:
        """Take a message of a best-effort button, whose losses nobody counts.

        Args:
            sender: Identity of the button; one that :meth:`take` knows is passed over.
            now_ns: As there.
            is_pressed: What the message says.
        """
        return () if sender in self._last else self._note(sender, now_ns, is_pressed=is_pressed)

    def doubt(self, sender: bytes) -> tuple[bool, ...]:
        """Have a button that was found and has never been heard hold the stop.

        It counts as pressed until it says that it is released, or is overridden.

        Args:
            sender: As in :meth:`take`; one that is known, or was doubted before, is passed over.
        """
        if self.knows(sender) or sender in self._doubted:
            return ()
        self._doubted.add(sender)
        self._holders[sender] = None
        return (True,)

    def release(self) -> None:
        """Override all buttons: none holds the stop, and none is missed before it speaks again."""
        self._holders.clear()
        self._heard_ns.clear()

    def knows(self, sender: bytes) -> bool:
        """Whether this button has been heard."""
        return sender in self._heard_ns or sender in self._last

    def _note(self, sender: bytes, now_ns: int, *, is_pressed: bool) -> tuple[bool, ...]:
        self._heard_ns[sender] = now_ns
        if is_pressed:
            self._holders[sender] = None
            return (True,)
        self._holders.pop(sender, None)
        return (bool(self._holders),)

    def _pressed(self) -> tuple[bool, ...]:
        return (True,) if self._holders else (True, False)
