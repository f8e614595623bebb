"""Operation on topics and services: the emergency stop of all arms, and the commands of each."""

import math
import time
from typing import Any, Protocol

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from teleop_core.nodes.taking import Taker
from teleop_core.slave.operation.presses import Presses
from teleop_core.slave.operation.states import COMMANDS, Answer

STOP_TOPIC = "/teleop/stop"
"""Emergency stop of all arms, std_msgs/Bool: true stops; false says that it is alive."""
_EVERY = 4
_STANDSTILL, _AFTER = 0.1, 1.0
"""Time between two looks that is a standstill, and in which it may have lost a button's first
messages after that [s]."""
_BYTES = 5
"""A Bool as CDR: four bytes of encapsulation, one of data."""
_RELIABLE, _BEST_EFFORT = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT
_VOLATILE, _LATCHED = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL
_READERS = ((_RELIABLE, _VOLATILE), (_RELIABLE, _LATCHED), (_BEST_EFFORT, _VOLATILE))
"""Readers of the stop: for all who send reliably; for the state that a button had before it was
found; for those who send at best effort, whom a reliable reader does not hear."""


def stop_profile(
    reliability: ReliabilityPolicy = _RELIABLE, durability: DurabilityPolicy = _VOLATILE
) -> QoSProfile:
    """QoS of a reader of the stop: it keeps all, for a press must not make room for a release."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL, reliability=reliability, durability=durability
    )


class StopButton:
    """Emergency stop button: says its state, and tells it to whoever comes later too.

    Args:
        node: Node that owns it.
    """

    def __init__(self, node: Any) -> None:
        profile = QoSProfile(depth=1, reliability=_RELIABLE, durability=_LATCHED)
        self._own = node.create_publisher(Bool, STOP_TOPIC, profile)
        self._is_released = False

    def say(self, *, is_pressed: bool) -> None:
        """Say that it is pressed, or that it is not; from any thread.

        A release is said once: the middleware sends the last message again until it has arrived,
        and one that is missing before it would count as a press.
        """
        if self._is_released and not is_pressed:
            return
        self._is_released = not is_pressed
        self._own.publish(Bool(data=is_pressed))

    @property
    def listeners(self) -> int:
        """Readers that were found."""
        return int(self._own.get_subscription_count())


class StopInput:
    """The emergency stop, looked at in every tick: 1 µs, and no executor on the way.

    The first reader is looked at in every tick, the two others in every fourth. No press is lost:
    readers keep all messages, a missing message counts as a press
    (:class:`~teleop_core.slave.operation.presses.Presses`), and a :class:`StopButton` that was
    pressed before it was found tells so. What is missing shows in the numbers of messages, and in
    the account of the first reader, which hears all who send reliably. A process that stands still
    as a button is found may lose its first messages, and neither tells: a button that the first
    reader hears for the first time soon after a standstill, and not from its first message on,
    counts as pressed. The second reader hears what was said long ago, too.

    Args:
        node: Node that owns it.
    """

    def __init__(self, node: Any) -> None:
        self._takers = [Taker(node, Bool, STOP_TOPIC, stop_profile(*kind)) for kind in _READERS]
        self._presses, self._ticks = Presses(), 0
        self._looked, self._still = math.inf, -math.inf  # times of the last look, and standstill

    def take(self) -> list[bool]:
        """What was said since the last call, oldest first: pressed or not; mostly nothing."""
        found: list[bool] = []
        self._ticks += 1
        now, before = time.monotonic(), self._looked
        self._looked = now
        if now - before > _STANDSTILL:
            self._still = now
        stood_still = now - self._still < _AFTER
        for taker in self._takers if self._ticks % _EVERY == 0 else self._takers[:1]:
            while (taken := taker.take()) is not None:
                if len(taken.data) < _BYTES:
                    continue
                is_pressed = taken.data[_BYTES - 1] != 0
                if taker is not self._takers[-1]:
                    found += self._presses.take(
                        taken.sender, taken.number, is_pressed=is_pressed,
                        stood_still=stood_still and taker is self._takers[0],
                    )  # fmt: skip
                elif not self._presses.knows(taken.sender):
                    found.append(is_pressed)
        return [*self._presses.lose(self._takers[0].lost), *found]

    @property
    def lost(self) -> int:
        """Messages of stop buttons that were lost; each counted as a press."""
        return self._presses.lost

    def close(self) -> None:
        """Stop listening."""
        for taker in self._takers:
            taker.close()


class Commanded(Protocol):
    """What takes commands by name; the answer comes with a text."""

    def request(self, event: str) -> tuple[Answer, str]:
        """Take one."""


class CommandServices:
    """Services ``slave/enable``, ``slave/stop``, … of one arm, all std_srvs/Trigger.

    Args:
        node: Node that owns them; its ``lock`` is held while a command is taken.
        arm: What takes the commands.
    """

    def __init__(self, node: Any, arm: Commanded) -> None:
        self._node, self._arm = node, arm
        self._own = [
            node.create_service(Trigger, f"slave/{name}", self._callback(name)) for name in COMMANDS
        ]

    def _callback(self, name: str) -> Any:
        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            with self._node.lock:
                found, text = self._arm.request(name)
            response.success, response.message = found in {Answer.DONE, Answer.ALREADY}, text
            return response

        return answer

    def close(self) -> None:
        """Withdraw them."""
        for service in self._own:
            self._node.destroy_service(service)
