"""Presses: which emergency stop buttons hold the stop pressed, so that no press is lost."""


class Presses:
    """State of every stop button that has sent a message, and of the stop that all buttons share.

    The stop is pressed while at least one button holds it. A button holds the stop from its press to its own release;
    messages of other buttons do not release it. :meth:`release` overrides all buttons.

    Every button numbers its messages, 1 for the first. A missing number means a lost message: lost by a full queue, by
    a blocked process, or by the network. A lost message may have been a press, so it counts as a press. Messages before
    the first received one count as lost too, unless the listener is idle, because they may have been sent to this
    listener. A message that arrives twice, through two readers, counts once.

    The state of a button that sends nothing is unknown, so such a button holds the stop (:meth:`doubt`).

    Methods that take a message return the states of the stop after it, oldest first: True means pressed. A lost
    message gives True first, followed by False if no button holds the stop.
    """

    def __init__(self) -> None:
        self._last: dict[bytes, int] = {}
        self._heard_ns: dict[bytes, int] = {}
        self._holders: dict[bytes, None] = {}  # pressed buttons, in the order of their presses
        self._doubted: set[bytes] = set()
        self._missing = self._told = 0

    @property
    def lost(self) -> int:
        """Number of messages lost so far, found by missing numbers or reported by the middleware."""
        return max(self._missing, self._told)

    @property
    def holders(self) -> tuple[bytes, ...]:
        """Buttons that hold the stop pressed, in the order of their presses."""
        return tuple(self._holders)

    @property
    def heard_ns(self) -> int | None:
        """Time of the last message of the button that has been silent longest [ns]; None without a button."""
        return min(self._heard_ns.values(), default=None)

    def silent(self, since_ns: int) -> tuple[bytes, ...]:
        """Buttons that have sent no message since the time ``since_ns`` [ns]."""
        return tuple(one for one, heard_ns in self._heard_ns.items() if heard_ns < since_ns)

    def lose(self, count: int) -> tuple[bool, ...]:
        """Take the middleware's count of lost messages, whose senders are unknown.

        Args:
            count: Number of messages that the middleware has lost so far, of all buttons.

        Returns:
            A press if ``count`` has grown since the last call. A loss that missing numbers have already shown may give
            a second press: subtracting it could hide a loss of another button.
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
            is_pressed: State in the message.
            is_idle: Whether the arm is disabled. Then presses before the first message from this button are ignored.

        Returns:
            States of the stop, oldest first; empty for a message that was already taken.
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
        """Take a message of a best-effort button, whose losses are not counted.

        Args:
            sender: Identity of the button; messages of a button that :meth:`take` knows are ignored.
            now_ns: Time [ns], as in :meth:`take`.
            is_pressed: State in the message.
        """
        return () if sender in self._last else self._note(sender, now_ns, is_pressed=is_pressed)

    def doubt(self, sender: bytes) -> tuple[bool, ...]:
        """Count a button that was discovered but has sent no message as pressed.

        The button counts as pressed until it reports its release, or is overridden.

        Args:
            sender: As in :meth:`take`. The call is ignored if the button is known, or for a second call for this
                button.
        """
        if self.knows(sender) or sender in self._doubted:
            return ()
        self._doubted.add(sender)
        self._holders[sender] = None
        return (True,)

    def release(self) -> None:
        """Override all buttons: none holds the stop, and none counts as silent before its next message."""
        self._holders.clear()
        self._heard_ns.clear()

    def knows(self, sender: bytes) -> bool:
        """Whether a message of this button was received."""
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
