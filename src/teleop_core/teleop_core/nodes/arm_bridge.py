"""Nodes ``arm_bridge`` and ``jaw_bridge``: real controllers instead of simulated drives."""

from collections.abc import Callable
from typing import Any

from teleop_core.graph.topics import SLAVE_OPERATION, Kind, Topic
from teleop_core.middleware.ros_messages import read_message
from teleop_core.nodes.news import Trouble
from teleop_core.nodes.streams import Subscription, message_type
from teleop_core.nodes.ticking import TickingNode
from teleop_core.slave.bridges import BRIDGES, Command
from teleop_core.slave.bridges.arm_bridge import BridgeParameters
from teleop_core.slave.bridges.hearing import Sample

_WAITING = 20  # number of the arm's messages that are queued while the loop is late


class ArmBridgeNode(TickingNode):
    """Sends the newest setpoint in the form that the controller accepts, and passes on the arm's measurements.

    For each valid sample of the arm, the node publishes one measurement, stamped with the time of the sample. Without
    valid samples it publishes nothing; the server then keeps the arm still. It also publishes nothing before the
    server is discovered.
    """

    def setup(self, parameters: BridgeParameters) -> None:
        """Make the stage, open its topics and the topics of the arm."""
        super().setup(parameters)
        kind, p = BRIDGES.find(parameters.kind.kind), parameters
        heard = Topic(p.state_topic or kind.state_topic, Kind.STATE)
        told = Topic(p.command_topic or kind.command_topic, Kind.REPORT, message=kind.message)
        self._kind, self._type = kind, message_type(kind.message)
        self._make: Callable[[str], Any] = lambda name: message_type(name)()
        self._arm = Subscription(self, heard, heard.name, _WAITING)
        self._sender = self.open_publisher(told)
        self._setpoint = self.input(self.description.reads[0])
        self._output = self.ports.output(self.description.writes[0])
        self._trouble = Trouble(self, "leads the arm")
        self.commands, self._has_server = 0, False

    def teardown(self) -> None:
        """Close what :meth:`setup` opened."""
        self._arm.close()
        super().teardown()

    def step(self, tick_ns: int) -> None:
        """Pass on the arm's measurements, and command the arm if a command is due."""
        if self.loop is not None and tick_ns != self.loop.newest_ns:
            return  # of several late ticks, the newest is enough
        now_ns = self.epoch_ns + tick_ns
        with self.lock:
            self._listen()
            command = self._command(now_ns) if self.stage.is_due(now_ns) else None
        if command is not None:
            message = self._type()
            self._kind.write(message, command, self.parameters.kind.parameters, self._make)
            self._sender.publish(message)
            self.commands += 1
        self._trouble.tell(self.stage.concerns())

    def _listen(self) -> None:
        if not self._has_server:  # a server that is discovered after the first message would miss the arm
            self._has_server = self._setpoint.publishers() > 0
        while (taken := self._arm.take()) is not None:
            message = read_message(taken.data, self._arm.type)
            stamp = message.header.stamp
            stamp_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
            if self.parameters.stamps == "sent":
                stamp_ns = taken.sent_ns
            sample = Sample(message.name, message.position, message.velocity, message.effort, stamp_ns)
            if self.stage.hear(sample, self.platform.time_ns()) and self._has_server:
                self.ports.send_now(self._output, stamp_ns)

    def _command(self, now_ns: int) -> Command | None:
        is_led = self.input(SLAVE_OPERATION).stamp_ns is not None
        found: Command | None = self.stage.command(now_ns, self._setpoint.age(), is_led)
        return found

    def values(self) -> dict[str, str]:
        """Number of sent commands, and number of refused samples of the arm."""
        refused = self.stage.hearing.refused.items()
        counts = {f"refused.arm.{wrong.value}": str(count) for wrong, count in refused}
        return {**counts, "commands": str(self.commands), "kind": self._kind.name}
