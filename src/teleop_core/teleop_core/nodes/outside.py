"""Outside: commands from other processes to a slave whose stages share its process.

There a stage's values go straight to the slave, and no port reads ``slave/servo_jp`` or ``slave/servo_cp``. Clients of
CRTK need a reader of both, and may command the arm while the session's own stages do not. A reader exists only while
there is such a client: it also receives the messages of the session's own stages, which are otherwise sent to nobody.
"""

from collections.abc import Callable, Mapping
from typing import Any

from teleop_core.bags.messages import Refusal
from teleop_core.bags.ros_types import deserialise
from teleop_core.graph.stage import STAGES
from teleop_core.graph.topics import SLAVE_SERVO_JP, Topic
from teleop_core.middleware.platform import Qos, Taker, Timer
from teleop_core.nodes.crtk import Refusals
from teleop_core.nodes.streams import message_type

_LOOK = 0.1  # time between two looks for other publishers [s]
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
        self._look_timer = node.ros.create_timer(_LOOK, self._look)
        self._read_timer: Timer | None = None

    def close(self) -> None:
        """Close the topics."""
        self._node.ros.destroy(self._look_timer)
        self._end()

    def _look(self) -> None:
        """Read the topics while another process publishes one of them, and not otherwise."""
        is_inside = self._node.is_at_work and self._node.input(SLAVE_SERVO_JP).subscription is None
        if not (is_inside and any(map(self._has_others, self._takes))):
            self._end()
        elif self._read_timer is None:
            ros = self._node.ros
            self._takers = {t: ros.create_taker(message_type(t.kind.ros_type), t.name, _QUALITY) for t in self._takes}
            self._read_timer = ros.create_timer(_PERIOD, self._read)

    def _end(self) -> None:
        if self._read_timer is not None:
            self._node.ros.destroy(self._read_timer)
        for taker in self._takers.values():
            taker.close()
        self._read_timer, self._takers = None, {}

    def _has_others(self, topic: Topic) -> bool:
        """Whether a publisher of a topic is not a stage of the session."""
        ros = self._node.ros
        name = ros.resolve_topic_name(topic.name)
        if ros.count_publishers(name) <= 1:  # that of the session's own stage
            return False
        ends = ros.publishers(name)
        self._ours = {end.sender for end in ends if end.node.rpartition("/")[2] in STAGES.names()}
        return any(end.sender not in self._ours for end in ends)

    def _read(self) -> None:
        """Take the newest message of each other publisher."""
        for topic, taker in self._takers.items():
            newest: dict[bytes, bytes] = {}
            while (taken := taker.take()) is not None:
                newest[taken.sender] = taken.data
            for sender, data in newest.items():
                if sender not in self._ours:
                    self._take(topic, data)

    def _take(self, topic: Topic, data: bytes) -> None:
        try:
            message = deserialise(data, topic.kind.ros_type)
        except ValueError:
            self._refusals.add(topic.name, f"refused: it {Refusal.MALFORMED.value}")
            return
        self._takes[topic](message)
