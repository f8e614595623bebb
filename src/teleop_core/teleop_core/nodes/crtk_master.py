"""CRTK master: the operating state of a haptic device, whose motors push in ENABLED alone."""

from typing import Any

from teleop_core.nodes.crtk import Condition, OperatingState, is_installed
from teleop_core.slave.operation.states import (
    TABLE,
    Answer,
    Event,
    State,
    answer_text,
    command_event,
)


class CrtkMaster:
    """Operating state of the device in the hand.

    It is enabled from the start and needs no homing: its encoders know where it is. Outside of
    ENABLED its motors give no force, and the hand moves it freely. An emergency stop of the
    session makes it FAULT until it is released.

    Args:
        node: Node that owns the topics.
    """

    def __init__(self, node: Any) -> None:
        self._node, self._state, self._is_stopped = node, State.ENABLED, False
        self._topics: OperatingState | None = None
        if is_installed():
            self._topics = OperatingState(node, "master", self.request, self._condition)

    @property
    def is_enabled(self) -> bool:
        """Whether its motors may push."""
        return self._state is State.ENABLED and not self._is_stopped

    def request(self, name: str) -> tuple[Answer, str]:
        """Take a command by name; the answer comes in words as well.

        Raises:
            UnknownNameError: There is no such command.
        """
        event, before = command_event(name), self._state
        follower = int(TABLE[before, event])
        if follower < 0:
            return Answer.REFUSED, answer_text(event, Answer.REFUSED, before)
        self._state = State(follower)
        is_new = self._state is not before or event is Event.HOME
        answer = Answer.DONE if is_new else Answer.ALREADY
        self._note()
        return answer, answer_text(event, answer, before)

    def press(self, *, is_pressed: bool) -> None:
        """Take a message of the stop button."""
        if is_pressed is not self._is_stopped:
            self._is_stopped = is_pressed
            self._note()

    def close(self) -> None:
        """Withdraw the topics."""
        if self._topics is not None:
            self._topics.close()

    def _note(self) -> None:
        if self._topics is not None:
            self._topics.note(self._node.get_clock().now().nanoseconds)

    def _condition(self) -> Condition:
        return (State.FAULT if self._is_stopped else self._state).name, True, False
