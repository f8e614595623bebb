"""Operation on topics and services: the emergency stop of all arms, and the commands of each."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Protocol

from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from teleop_core.middleware.world import Owner, Qos
from teleop_core.slave.operation.presses import Presses
from teleop_core.slave.operation.states import COMMANDS, Answer

STOP_TOPIC = "/teleop/stop"
"""Emergency stop of all arms, std_msgs/Bool: true stops; false says that it is alive."""
RELEASE = "release"
"""Service that overrides stop buttons which are pressed; it is no command of the arm's state."""
_EVERY = 4
_BEAT_NS = 100_000_000
"""A button of this package that has spoken says its state again so often [ns]."""
_LOOK = 0.1
"""A slave looks for buttons that it has not heard so often [s]."""
_GRACE_NS = 500_000_000
"""A button that was found so long ago and has said nothing counts as pressed [ns].

Who sends again and again is heard within it, for reader and sender find each other about a tenth of a second apart.
"""
_BYTES = 5
"""A Bool as CDR: four bytes of encapsulation, one of data."""
READERS = (Qos(keeps_all=True), Qos(keeps_all=True, is_latched=True), Qos(keeps_all=True, is_reliable=False))
"""Readers of the stop: for all who send reliably; for the state that a button had before it was
found; for those who send at best effort, whom a reliable reader does not hear. They keep all, for a
press must not make room for a release."""


class StopButton:
    """Emergency stop button: says its state, and tells it to whoever comes later too.

    Args:
        owner: Node that owns it.
    """

    def __init__(self, owner: Owner) -> None:
        self._world = owner.world
        self._own = owner.ros.create_publisher(Bool, STOP_TOPIC, Qos(depth=1, is_latched=True))
        self._is_pressed: bool | None = None
        self._said_ns = 0

    def say(self, *, is_pressed: bool) -> None:
        """Say that it is pressed, or that it is not; from any thread.

        A release is said once: the middleware sends the last message again until it has arrived,
        and one that is missing before it would count as a press.
        """
        if self._is_pressed is False and not is_pressed:
            return
        self._say(is_pressed)

    def beat(self) -> None:
        """Repeat its state, if it has one and was silent for a while.

        A slave with ``operation.heartbeat`` counts the silence of a known button as a press.
        """
        silence_ns = self._world.monotonic_ns() - self._said_ns
        if self._is_pressed is not None and silence_ns > _BEAT_NS:
            self._say(self._is_pressed)

    def _say(self, is_pressed: bool) -> None:
        self._is_pressed, self._said_ns = is_pressed, self._world.monotonic_ns()
        self._own.publish(Bool(data=is_pressed))

    @property
    def listeners(self) -> int:
        """Readers that were found."""
        return int(self._own.get_subscription_count())


class StopInput:
    """The emergency stop, looked at in every tick: 1 µs, and no executor on the way.

    The first reader is looked at in every tick, the two others in every fourth. No press is lost:
    readers keep all messages, and what is missing counts as a press
    (:class:`~teleop_core.slave.operation.presses.Presses`), by the numbers of messages and by the
    account of the first reader, which hears all who send reliably. The second reader hears what was
    said long ago, too. A button that is there and says nothing counts as pressed after half a second: nobody knows
    whether it was pressed before it was found.

    Args:
        owner: Node that owns it; its executor looks for such buttons.

    Attributes:
        has_new: Whether a button was heard for the first time; set it back before :meth:`learn`.
    """

    def __init__(self, owner: Owner) -> None:
        self._ros, self.has_new = owner.ros, False
        self._now_ns = owner.world.monotonic_ns
        self._found_ns: dict[bytes, int] = {}  # of buttons that have said nothing yet
        self._silent: tuple[bytes, ...] = ()
        self._timer = self._ros.create_timer(_LOOK, self._look_for_silent)
        self._takers = [self._ros.create_taker(Bool, STOP_TOPIC, qos) for qos in READERS]
        self._presses, self._ticks = Presses(), 0
        self._names: dict[bytes, str] = {}

    def take(self, now_ns: int = 0, *, is_idle: bool = False) -> list[bool]:
        """What the stop was since the last call, oldest first: pressed or not; mostly nothing.

        Args:
            now_ns: Time, of any clock that never goes back [ns].
            is_idle: Whether a press before the first message of a new button stops nothing.
        """
        found: list[bool] = []
        self._ticks += 1
        presses, best_effort = self._presses, self._takers[-1]
        looks_at_all = self._ticks % _EVERY == 0
        for taker in self._takers if looks_at_all else self._takers[:1]:
            while (taken := taker.take()) is not None:
                if len(taken.data) < _BYTES:
                    continue
                self.has_new = self.has_new or not presses.knows(taken.sender)
                is_pressed = taken.data[_BYTES - 1] != 0
                if taker is best_effort:
                    found += presses.overhear(taken.sender, now_ns, is_pressed=is_pressed)
                else:
                    found += presses.take(taken.sender, taken.number, now_ns, is_pressed=is_pressed, is_idle=is_idle)
        if looks_at_all and self._silent:  # now that all they have said is read
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
        """Messages of stop buttons that were lost; each counted as a press."""
        return self._presses.lost

    def holders(self, silent_since_ns: int = 0) -> tuple[bytes, ...]:
        """Buttons that hold the stop pressed, or have been silent since ``silent_since_ns``."""
        presses = self._presses
        return tuple(dict.fromkeys((*presses.holders, *presses.silent(silent_since_ns))))

    def learn(self) -> None:
        """Look up the names of new buttons before they are gone; takes longer than a tick."""
        self._look_up()

    def names(self, buttons: Iterable[bytes]) -> str:
        """Names of buttons, for people; takes longer than a tick."""
        there = self._look_up()
        return " and ".join(self._names.get(one, "a button") + ("" if one in there else " (gone)") for one in buttons)

    def unheard(self) -> str:
        """Names of buttons whose state nobody knows; takes longer than a tick.

        They are there, have said nothing yet, and do not repeat their state for late readers.
        """
        return " and ".join(self._unheard().values())

    def _unheard(self) -> dict[bytes, str]:
        return {
            one: name
            for one, (name, is_latched) in self._look_up().items()
            if not (is_latched or self._presses.knows(one))
        }

    def release(self) -> None:
        """Override all buttons that hold the stop pressed, or are missed."""
        self._presses.release()

    def close(self) -> None:
        """Stop listening."""
        self._ros.destroy(self._timer)
        for taker in self._takers:
            taker.close()

    def _look_up(self) -> dict[bytes, tuple[str, bool]]:
        """Name of each button that is there, and whether it tells its state to who comes late."""
        there = {end.sender: (end.node, end.is_latched) for end in self._ros.publishers(STOP_TOPIC)}
        self._names |= {sender: name for sender, (name, _) in there.items()}
        return there


class Commanded(Protocol):
    """Taker of the stop and of named commands, each of which is answered with a text."""

    def request(self, event: str) -> tuple[Answer, str]:
        """Take a command."""

    def press(self, *, is_pressed: bool, heard_ns: int) -> None:
        """Take what stop buttons said."""


class CommandServices:
    """Services ``slave/enable``, ``slave/stop``, … and ``slave/release`` of one arm.

    All are std_srvs/Trigger. ``slave/release`` overrides the stop buttons that are pressed or
    missed, and its answer names them; the stop stays latched until ``slave/reset``.

    Args:
        node: Node that owns them; its ``lock`` is held while a command is taken.
        arm: What takes the commands.
        stop: Its emergency stop.
        holders: Which buttons hold the stop now.
    """

    def __init__(self, node: Any, arm: Commanded, stop: StopInput, holders: Callable[[], tuple[bytes, ...]]) -> None:
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
        """Withdraw them."""
        for service in self._own:
            self._node.ros.destroy(service)
