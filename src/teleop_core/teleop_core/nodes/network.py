"""Node ``network``: delays and loses messages between both sides, whichever node publishes them."""

from typing import Any

from teleop_core.coupling.network.network import BACK, THERE
from teleop_core.coupling.network.presets import NetworkParameters
from teleop_core.graph import topics
from teleop_core.graph.signals import TICK_NS
from teleop_core.nodes.ticking import TickingNode

_THERE = (topics.NETWORK_SERVO_CP, topics.NETWORK_MASTER_ENERGY, topics.NETWORK_JAW_SERVO_JP)


class NetworkNode(TickingNode):
    """Passes on the messages that arrive in a tick; if none arrives, nothing is sent.

    Each stamp is passed on once, except stamps of the slave's setpoint, which may change while its stamp stays the
    same.
    """

    def setup(self, parameters: NetworkParameters) -> None:
        """Make the network, and open its topics."""
        super().setup(parameters)
        self._passed = {topic: 0 for topic in self.description.writes if topic is not topics.NETWORK_STATE}

    def turn(self) -> None:
        """Make all steps that are due; a packet counts as sent when this node reads it, even if this node is late."""
        due, state = list(self.schedule.due()), self.stage.state
        for tick_ns in due[:-1]:
            self.make_tick(tick_ns, self.send_report)
        self.read_ports()
        state["behind"] = (self.world.monotonic_ns() - due[-1]) // TICK_NS
        self.make_tick(due[-1], self.send_report)

    def send(self, now_ns: int) -> None:
        """Send the messages that arrived in the step and, at intervals, the counts."""
        has_come = self.stage.state["arrived"]
        silent = {topic.name for topic in self._passed if not self._is_due(topic, has_come)}
        self.ports.send(now_ns, silent)

    def _is_due(self, topic: topics.Topic, has_come: Any) -> bool:
        """Whether a new message of a topic arrived."""
        if not has_come[THERE if topic in _THERE else BACK]:
            return False
        before_ns, stamp_ns = self._passed[topic], self.row[f"{topic.field}_ns"]
        self._passed[topic] = stamp_ns
        return stamp_ns != before_ns or topic is topics.NETWORK_SETPOINT_CP
