"""Ticking node: makes one step of its stage per millisecond, with its own clock."""

from collections.abc import Callable, Iterable

from teleop_core.nodes.base import CoreNode


class TickingNode(CoreNode):
    """Node that makes exactly one step for every tick, however late its wake-ups are."""

    def start(self) -> None:
        """Store the offset between the monotonic time of the loop and the time of stamps."""
        self.epoch_ns = self.world.time_ns() - self.world.monotonic_ns()

    def turn(self) -> None:
        """Make all steps that are due."""
        ticks = self.schedule.due()
        self.take()
        self.work(ticks, self.send_report)

    def take(self) -> None:
        """Read the received messages."""
        self.read_ports()

    def step(self, tick_ns: int) -> None:
        """Make the step of one tick [ns, monotonic]; the session calls :meth:`tell` later."""
        self.work((tick_ns,))

    def work(self, ticks: Iterable[int], report: Callable[[int], None] | None = None) -> None:
        """Make the steps of some ticks with the messages already read.

        Args:
            ticks: Times of the ticks [ns, monotonic].
            report: Called with the stamp of each step [ns] when all its topics are sent.
        """
        self.ports.add_up()
        for tick_ns in ticks:
            self.make_tick(tick_ns, report)

    def make_tick(self, tick_ns: int, report: Callable[[int], None] | None = None) -> None:
        """Make the step of one tick [ns, monotonic] with the messages already read, and send its outputs."""
        now_ns = tick_ns + self.epoch_ns
        self.row["now_ns"] = now_ns
        self.advance(now_ns)
        self.send(now_ns)
        if report is not None:
            report(now_ns)

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
