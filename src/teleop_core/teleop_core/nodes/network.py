"""Node ``network``: delays and loses messages between both sides, whichever node publishes them."""

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
        passed = [topic for topic in self.description.writes if topic is not topics.NETWORK_STATE]
        # For each output that passes something on: output, direction, field of its stamp, and whether it may repeat.
        self._passed = [
            (self.ports.output(t), THERE if t in _THERE else BACK, f"{t.field}_ns", t is topics.NETWORK_SETPOINT_CP)
            for t in passed
        ]
        self._last_ns = [0] * len(passed)

    def take(self) -> None:
        """Read the received messages; a packet counts as sent when this node reads it, even if this node is late."""
        loop = self.loop
        if loop is not None and len(loop.nodes) == 1:  # else packets come from this process, with the tick's time
            if loop.tick_ns != loop.newest_ns:
                return
            self.stage.state["behind"] = (self.platform.monotonic_ns() - loop.tick_ns) // TICK_NS
        super().take()

    def send(self, now_ns: int) -> None:
        """Send the messages that arrived in the step and, at intervals, the counts."""
        has_come, row = self.stage.state["arrived"].tolist(), self.row
        for i, (output, way, stamp, may_repeat) in enumerate(self._passed):
            is_due, stamp_ns = False, self._last_ns[i]
            if has_come[way]:
                self._last_ns[i] = row[stamp]
                is_due = may_repeat or row[stamp] != stamp_ns
            output.is_silent = not is_due
        self.ports.send(now_ns)
