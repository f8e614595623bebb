"""Operation on topics and services: the emergency stop of all arms, and the commands of each arm."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Protocol

from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from teleop_core.middleware.platform import Owner, Qos
from teleop_core.nodes.streams import RareTakers
from teleop_core.slave.operation.presses import Presses
from teleop_core.slave.operation.states import COMMANDS, Answer

STOP_TOPIC = "/teleop/stop"
"""Emergency stop of all arms, std_msgs/Bool: true stops; false means that the button is alive and not pressed."""
RELEASE = "release"
"""Service that overrides pressed stop buttons; it is not a command of the arm's state."""
_EVERY = 4
_BEAT_NS = 100_000_000
"""Period at which a button of this package repeats its state, after its first message [ns]."""
_LOOK = 0.1
"""Period at which a slave looks for buttons that have sent nothing yet [s]."""
_GRACE_NS = 500_000_000
"""A button that has sent nothing for this time after its discovery counts as pressed [ns].

A button that repeats its state is received within this time, because reader and sender discover each other within
about a tenth of a second.
"""
_BYTES = 5
"""A Bool as CDR: four bytes of encapsulation, one of data."""
READERS = (Qos(keeps_all=True), Qos(keeps_all=True, is_latched=True), Qos(keeps_all=True, is_reliable=False))
"""Readers of the stop: the first for all reliable senders; the second for the state that a button had before it was
discovered; the third for best-effort senders, which a reliable reader does not receive. They keep all messages,
because a release must not replace an unread press in the queue."""


class StopButton:
    """Emergency stop button: publishes its state, also to readers that are discovered later.

    Args:
        owner: Node that owns the button.
    """

    def __init__(self, owner: Owner) -> None:
        self._platform = owner.platform
        self._own = owner.ros.create_publisher(Bool, STOP_TOPIC, Qos(depth=1, is_latched=True))
        self._is_pressed: bool | None = None
        self._said_ns = 0

    def say(self, *, is_pressed: bool) -> None:
        """Publish that the button is pressed or released; may be called from any thread.

        A release is published once: the middleware repeats the last message until it has arrived, and a missing
        message before it would count as a press.
        """
        if self._is_pressed is False and not is_pressed:
            return
        self._say(is_pressed)

    def beat(self) -> None:
        """Repeat the button's state, if it has a state and was silent for some time.

        A slave with ``operation.heartbeat`` counts the silence of a known button as a press.
        """
        silence_ns = self._platform.monotonic_ns() - self._said_ns
        if self._is_pressed is not None and silence_ns > _BEAT_NS:
            self._say(self._is_pressed)

    def _say(self, is_pressed: bool) -> None:
        self._is_pressed, self._said_ns = is_pressed, self._platform.monotonic_ns()
        self._own.publish(Bool(data=is_pressed))

    @property
    def listeners(self) -> int:
        """Number of discovered readers."""
        return int(self._own.get_subscription_count())


class StopInput:
    """Reader of the emergency stop in every tick; reading takes 1 µs and needs no executor.

    The first reader is read in every tick; the other two, and the count of lost messages, in every fourth tick. No
    press is lost: readers keep all messages, and missing messages count as a press
    (:class:`~teleop_core.slave.operation.presses.Presses`). Missing messages are found by the message numbers and by
    the loss count of the first reader, which receives all reliable senders. The second reader also receives earlier
    states. A button that exists but sends nothing counts as pressed after half a second, because it may have been
    pressed before its discovery.

    Args:
        owner: Node that owns it; its executor looks for buttons that send nothing.

    Attributes:
        has_new: Whether a message of a new button was received; reset it before calling :meth:`learn`.
    """

    def __init__(self, owner: Owner) -> None:
        self._ros, self.has_new = owner.ros, False
        self._now_ns = owner.platform.monotonic_ns
        self._found_ns: dict[bytes, int] = {}  # buttons that have sent nothing yet
        self._silent: tuple[bytes, ...] = ()
        self._timer = self._ros.create_timer(_LOOK, self._look_for_silent)
        self._takers = [self._ros.create_taker(Bool, STOP_TOPIC, qos) for qos in READERS]
        self._rare = RareTakers(owner.platform, self._takers)
        self._presses, self._ticks = Presses(), 0
        self._names: dict[bytes, str] = {}

    def take(self, now_ns: int = 0, *, is_idle: bool = False) -> list[bool]:
        """States of the stop since the last call, oldest first: pressed or not; usually empty.

        Args:
            now_ns: Time of any monotonic clock [ns].
            is_idle: Whether the arm is idle, so that a press before a new button's first message had nothing to stop.
        """
        found: list[bool] = []
        self._ticks += 1
        presses, best_effort = self._presses, len(self._takers) - 1
        looks_at_all = self._ticks % _EVERY == 0
        while (one := self._rare.next(len(self._takers) if looks_at_all else 1)) is not None:
            index, taken = one
            if len(taken.data) < _BYTES:
                continue
            self.has_new = self.has_new or not presses.knows(taken.sender)
            is_pressed = taken.data[_BYTES - 1] != 0
            if index == best_effort:
                found += presses.overhear(taken.sender, now_ns, is_pressed=is_pressed)
            else:
                found += presses.take(taken.sender, taken.number, now_ns, is_pressed=is_pressed, is_idle=is_idle)
        if not looks_at_all:
            return found
        if self._silent:  # look for silent buttons after all messages are read
            found += [said for one in self._silent for said in presses.doubt(one)]
        return [*presses.lose(self._takers[0].lost), *found]

    def _look_for_silent(self) -> None:
        now_ns = self._now_ns()
        self._found_ns = {one: self._found_ns.get(one, now_ns) for one in self._unheard()}
        self._silent = tuple(one for one, since_ns in self._found_ns.items() if now_ns - since_ns >= _GRACE_NS)

    @property
    def heard_ns(self) -> int | None:
        """Time of the last message of the button that has been silent longest [ns]."""
        return self._presses.heard_ns

    @property
    def lost(self) -> int:
        """Number of lost messages of stop buttons; each counted as a press."""
        return self._presses.lost

    def holders(self, silent_since_ns: int = 0) -> tuple[bytes, ...]:
        """Buttons that are pressed, or have been silent since ``silent_since_ns``."""
        presses = self._presses
        return tuple(dict.fromkeys((*presses.holders, *presses.silent(silent_since_ns))))

    def learn(self) -> None:
        """Look up the names of new buttons while they exist; takes longer than a tick."""
        self._look_up()

    def names(self, buttons: Iterable[bytes]) -> str:
        """Names of buttons, as text for users; takes longer than a tick."""
        there = self._look_up()
        return " and ".join(self._names.get(one, "a button") + ("" if one in there else " (gone)") for one in buttons)

    def unheard(self) -> str:
        """Names of buttons whose state is unknown; takes longer than a tick.

        These buttons exist, have sent nothing yet, and do not send their last state to late readers.
        """
        return " and ".join(self._unheard().values())

    def _unheard(self) -> dict[bytes, str]:
        return {
            one: name
            for one, (name, is_latched) in self._look_up().items()
            if not (is_latched or self._presses.knows(one))
        }

    def release(self) -> None:
        """Override all buttons that are pressed or missing."""
        self._presses.release()

    def close(self) -> None:
        """Stop listening."""
        self._ros.destroy(self._timer)
        for taker in self._takers:
            taker.close()

    def _look_up(self) -> dict[bytes, tuple[str, bool]]:
        """Name of each existing button, and whether it sends its last state to late readers."""
        there = {end.sender: (end.node, end.is_latched) for end in self._ros.publishers(STOP_TOPIC)}
        self._names |= {sender: name for sender, (name, _) in there.items()}
        return there


class CommandReceiver(Protocol):
    """Receiver of the stop and of named commands; each command is answered with a text."""

    def request(self, event: str) -> tuple[Answer, str]:
        """Execute a command."""

    def press(self, *, is_pressed: bool, heard_ns: int) -> None:
        """Process a state of the stop buttons."""


class CommandServices:
    """Services ``slave/enable``, ``slave/stop``, … and ``slave/release`` of one arm.

    All are std_srvs/Trigger. ``slave/release`` overrides the stop buttons that are pressed or missing, and its answer
    names them; the stop stays latched until ``slave/reset``.

    Args:
        node: Node that owns the services; its ``lock`` is held while a command is processed.
        arm: Receiver of the commands.
        stop: Emergency stop of the arm.
        holders: Returns the buttons that are pressed or missing now.
    """

    def __init__(
        self, node: Any, arm: CommandReceiver, stop: StopInput, holders: Callable[[], tuple[bytes, ...]]
    ) -> None:
        self._node, self._arm, self._stop, self._holders = node, arm, stop, holders
        calls = {name: partial(self._command, name) for name in COMMANDS}
        self._own = [
            node.ros.create_service(Trigger, f"slave/{name}", call)
            for name, call in (calls | {RELEASE: self._release}).items()
        ]

    def _command(self, name: str, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._node.lock:
            found, text = self._arm.request(name)
            holders = self._holders() if found is Answer.STOPPED else ()
        if holders:
            names = self._stop.names(holders)
            text += f"; {names} presses it, and `teleop operate release` overrides that"
        response.success, response.message = found in {Answer.DONE, Answer.ALREADY}, text
        return response

    def _release(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._node.lock:
            holders = self._holders()
            self._stop.release()
            self._arm.press(is_pressed=False, heard_ns=int(self._node.row["now_ns"]))
        done = f"overrides {self._stop.names(holders)}" if holders else "no stop button is pressed"
        response.success, response.message = True, f"{RELEASE}: {done}"
        return response

    def close(self) -> None:
        """Close the services."""
        for service in self._own:
            self._node.ros.destroy(service)
