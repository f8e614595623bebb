"""CRTK: operating state and state commands of an arm, as the Collaborative Robotics Toolkit defines them.

``operating_state`` (crtk_msgs/OperatingState) is sent when it changes and once a second; ``state_command``
(crtk_msgs/StringStamped) takes the commands of :mod:`teleop_core.slave.operation.states`. Both need the package
crtk_msgs; without it, an arm has only its services and reports.
"""

from collections import deque
from collections.abc import Callable
from typing import Any

from teleop_core.bags.messages import SECOND_NS
from teleop_core.base.errors import TeleopError
from teleop_core.middleware.platform import Qos
from teleop_core.nodes.streams import message_type
from teleop_core.slave.operation.states import COMMANDS, Answer

OPERATING_STATE = "crtk_msgs/msg/OperatingState"
STATE_COMMAND = "crtk_msgs/msg/StringStamped"
_PERIOD = 1.0  # period of operating_state while nothing changes [s]
_QUIET = 1.0  # shortest time between two log lines about one topic [s]
Condition = tuple[str, bool, bool]
"""Name of the state, whether the arm is homed, whether it is busy."""


def is_installed() -> bool:
    """Whether the messages of CRTK are installed."""
    try:
        message_type(OPERATING_STATE)
    except ImportError:
        return False
    return True


_STOPPING = ("disable", "pause", "stop")
SINGLE = Qos(depth=10)
"""QoS of one-shot commands: reliable, so that none is lost if the sender is reliable too."""
STREAMED = Qos(depth=1, is_reliable=False)
"""QoS of streamed commands: best effort, so that messages of any sender are received; only the newest command counts.
"""
_LATCHED = Qos(depth=10, is_latched=True)
"""QoS of states: a late subscriber with transient-local durability receives the last value."""


class OperatingStateTopics:
    """Topics of the operating state of one arm, served by the executor.

    The node's loop calls :meth:`note` and never publishes these topics itself, so that no slow reader blocks the loop.

    Args:
        node: Node that owns the topics; its ``lock`` is held while a command is processed.
        arm: Namespace of the topics, ``slave`` or ``master``.
        request: Executes a command by name and returns an answer with a text.
        condition: Returns the current condition.
        aged: Returns why a command with a stamp is refused at a time [ns]; None if it is not. Commands that stop an
            arm have any age.
    """

    def __init__(
        self,
        node: Any,
        arm: str,
        request: Callable[[str], tuple[Answer, str]],
        condition: Callable[[], Condition],
        aged: Callable[[int, int], tuple[Answer, str] | None] = lambda stamp_ns, now_ns: None,
    ) -> None:
        self._node, self._request, self._condition, self._aged = node, request, condition, aged
        self._kind = message_type(OPERATING_STATE)
        self._changes: deque[tuple[int, Condition]] = deque(maxlen=100)
        self._publisher = node.ros.create_lifecycle_publisher(self._kind, f"{arm}/operating_state", _LATCHED)
        self._commands = node.ros.create_subscription(
            message_type(STATE_COMMAND), f"{arm}/state_command", self._take, SINGLE
        )
        self._guard = node.ros.create_guard_condition(self._send_changes)
        self._timer = node.ros.create_timer(_PERIOD, self._send)

    def note(self, stamp_ns: int) -> None:
        """Let the executor send the current condition soon, with a stamp [ns]; may be called from any thread."""
        self._changes.append((stamp_ns, self._condition()))
        self._guard.trigger()

    def close(self) -> None:
        """Close the topics."""
        self._node.ros.destroy(self._timer)
        self._node.ros.destroy(self._guard)
        self._node.ros.destroy(self._commands)
        self._node.ros.destroy(self._publisher)

    def _take(self, message: Any) -> None:
        name, log = message.string.strip(), self._node.ros.get_logger()
        if name not in COMMANDS:
            known = ", ".join(COMMANDS)
            log.warning(f"no state command {name!r:.40}; known: {known}")
            return
        stamp = message.header.stamp
        try:
            with self._node.lock:
                aged = self._aged(stamp.sec * SECOND_NS + stamp.nanosec, self._node.platform.time_ns())
                answer, text = (aged if name not in _STOPPING else None) or self._request(name)
        except TeleopError as error:
            log.warning(str(error))
            return
        log.info(text) if answer in {Answer.DONE, Answer.ALREADY} else log.warning(text)

    def _send_changes(self) -> None:
        while self._changes:
            self._publish(*self._changes.popleft())

    def _send(self) -> None:
        self._send_changes()
        self._publish(self._node.platform.time_ns(), self._condition())

    def _publish(self, stamp_ns: int, condition: Condition) -> None:
        message = self._kind(state=condition[0], is_homed=condition[1], is_busy=condition[2])
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, SECOND_NS)
        self._publisher.publish(message)


class Refusals:
    """Counts refused commands by topic, and logs the reason at most once a second.

    Args:
        node: Node that logs the reasons.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._counts: dict[str, int] = {}
        self._told: dict[str, float] = {}

    def add(self, topic: str, text: str) -> None:
        """Count a refused command."""
        self._counts[topic] = self._counts.get(topic, 0) + 1
        now = 1e-9 * self._node.platform.monotonic_ns()
        if now - self._told.get(topic, -_QUIET) >= _QUIET:
            self._told[topic] = now
            self._node.ros.get_logger().warning(f"{topic}: {text}")

    def values(self) -> dict[str, str]:
        """Counts for the node's report."""
        return {f"refused.{name}": str(count) for name, count in self._counts.items()}
