"""Ticking node: makes one step of its stage per millisecond, with its own clock."""

from teleop_core.nodes.base import CoreNode


class TickingNode(CoreNode):
    """Node that makes exactly one step for every tick, however late its wake-ups are."""

    def start(self) -> None:
        """Store the offset between the monotonic time of the loop and the time of stamps."""
        self.epoch_ns = self.platform.time_ns() - self.platform.monotonic_ns()

    def take(self) -> None:
        """Read the received messages."""
        self.read_ports()

    def step(self, tick_ns: int) -> None:
        """Make the step of one tick [ns, monotonic] with the messages already read, and send its outputs."""
        self.ports.add_up()
        now_ns = tick_ns + self.epoch_ns
        self.row["now_ns"] = now_ns
        self.advance(now_ns)
        self.send(now_ns)

    def tell(self) -> None:
        """Report the state after the last step, if it has changed."""
        self.send_report(self.row["now_ns"])

    def advance(self, now_ns: int) -> None:
        """Make one step that starts at ``now_ns`` [ns]."""
        with self.lock:
            self.stage.step()

    def send(self, now_ns: int) -> None:
        """Send the outputs of a step that started at ``now_ns`` [ns]."""
        self.ports.send(now_ns)
