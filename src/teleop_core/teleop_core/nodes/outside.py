"""Outside: commands from other processes to a slave whose stages share its process.

There a stage's values go straight to the slave, and no port reads ``slave/servo_jp`` or ``slave/servo_cp``. Clients of
CRTK need a reader of both, and may command the arm while the session's own stages do not.
"""

from collections.abc import Callable, Mapping
from typing import Any

from teleop_core.bags.messages import Refusal
from teleop_core.bags.ros_types import deserialise
from teleop_core.graph.stage import STAGES
from teleop_core.graph.topics import SLAVE_SERVO_JP, Topic
from teleop_core.middleware.world import Qos, Taker
from teleop_core.nodes.crtk import Refusals
from teleop_core.nodes.streams import message_type

_PERIOD = 0.01  # time between two readings [s]
_QUALITY = Qos(depth=100, is_reliable=False)  # the session's own stages send on these topics too


class OutsideCommands:
    """Reader of commands that others send on topics of the session's own stages.

    Args:
        node: The slave.
        takes: Function that takes a message, for each topic.
        refusals: Counter of refused commands.
    """

    def __init__(self, node: Any, takes: Mapping[Topic, Callable[[Any], None]], refusals: Refusals) -> None:
        self._node, self._takes, self._refusals = node, takes, refusals
        self._takers: dict[Topic, Taker] = {}
        self._ours: set[bytes] = set()
        self._timer = node.ros.create_timer(_PERIOD, self._read)

    def close(self) -> None:
        """Close the topics."""
        self._node.ros.destroy(self._timer)
        self._listen(is_inside=False)

    def _read(self) -> None:
        """Take the newest message of each other publisher."""
        self._listen(is_inside=self._node.is_at_work and self._node.input(SLAVE_SERVO_JP).subscription is None)
        for topic, taker in self._takers.items():
            newest: dict[bytes, bytes] = {}
            while (taken := taker.take()) is not None:
                newest[taken.sender] = taken.data
            for sender, data in newest.items():
                if not self._is_ours(topic, sender):
                    self._take(topic, data)

    def _listen(self, *, is_inside: bool) -> None:
        """Read the topics if the stage that commands the slave is in its process, and not otherwise."""
        if is_inside and not self._takers:
            create = self._node.ros.create_taker
            self._takers = {t: create(message_type(t.kind.ros_type), t.name, _QUALITY) for t in self._takes}
        elif not is_inside:
            for taker in self._takers.values():
                taker.close()
            self._takers = {}

    def _is_ours(self, topic: Topic, sender: bytes) -> bool:
        """Whether a stage of the session sends the messages of a publisher."""
        if sender not in self._ours:
            ends = self._node.ros.publishers(self._node.ros.resolve_topic_name(topic.name))
            self._ours |= {end.sender for end in ends if end.node.rpartition("/")[2] in STAGES.names()}
        return sender in self._ours

    def _take(self, topic: Topic, data: bytes) -> None:
        try:
            message = deserialise(data, topic.kind.ros_type)
        except ValueError:
            self._refusals.add(topic.name, f"refused: it {Refusal.MALFORMED.value}")
            return
        self._takes[topic](message)
