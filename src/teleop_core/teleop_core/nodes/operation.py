"""Operation on topics and services: the emergency stop of all arms, and the commands of each."""

from typing import Any, Protocol

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from teleop_core.nodes.streams import Unattended
from teleop_core.operation.states import COMMANDS, Answer

STOP_TOPIC = "/teleop/stop"
"""Emergency stop of all arms, std_msgs/Bool: true stops; false says that it is alive."""
_EVERY = 4
_BYTES = 5
"""A Bool as CDR: four bytes of encapsulation, one of data."""


def stop_profile(reliability: ReliabilityPolicy) -> QoSProfile:
    """Quality of a reader of the stop."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=10, reliability=reliability,
        durability=DurabilityPolicy.VOLATILE,
    )  # fmt: skip


class StopInput:
    """The emergency stop, looked at in every tick: 2 µs, and no executor on the way.

    Of a reliable sender no message is lost, but a reliable reader does not hear one that sends at
    best effort; so there are two readers, the second of which is looked at in every fourth tick.

    Args:
        node: Node that owns it.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._own = [
            node.create_subscription(
                Bool, STOP_TOPIC, _ignore, stop_profile(reliability), raw=True,
                callback_group=Unattended(),
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            )
            for reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT)
        ]  # fmt: skip
        self._take = [own.handle.take_message for own in self._own]
        self._ticks = 0

    def take(self) -> list[bool]:
        """What was said since the last call, oldest first: pressed or not; mostly nothing."""
        found = []
        self._ticks += 1
        for take in self._take if self._ticks % _EVERY == 0 else self._take[:1]:
            while (taken := take(Bool, True)) is not None:
                data = taken[0]
                if len(data) >= _BYTES:
                    found.append(data[_BYTES - 1] != 0)
        return found

    def close(self) -> None:
        """Stop listening."""
        for own in self._own:
            self._node.destroy_subscription(own)


def _ignore(data: bytes) -> None:
    """Stand in for the callback that is never called."""


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
