"""Inside: faults of a drill inside simulated processes, and clocks with an error."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from teleop_drill.drill import inside
from teleop_drill.simulation.machine import Clock, Machine

if TYPE_CHECKING:
    from teleop_drill.simulation.session import SimulatedSession


class SimulatedSteering:
    """Simulated form of :class:`~teleop_drill.nodes.drill_site.Steering`.

    Args:
        machine: Machine of the processes.

    Attributes:
        session: The processes.
    """

    def __init__(self, machine: Machine) -> None:
        self._machine, self._joints = machine, inside.Joints()
        self.word = inside.WORKS
        self.session: SimulatedSession | None = None
        inside.Passing.control = self
        machine.scheduler.at(0, self._look)

    @staticmethod
    @contextmanager
    def installed(machine: Machine) -> Iterator[None]:
        """Let stages that the drill orders to hang wait in simulated time."""
        inside.register()
        before = inside.Passing.sleep
        inside.Passing.sleep = staticmethod(machine.scheduler.sleep)
        try:
            yield
        finally:
            inside.Passing.control, inside.Passing.sleep = None, before

    def write(self, word: int = inside.WORKS, offset_ns: int = 0) -> None:
        """Set the order to the stage, and the error of the clock [ns]."""
        self.word = word
        for process in self._machine.processes:
            if process.name not in {"drill", "arm"}:
                process.use_clock(Clock(offset_ns, self._machine.clock.drift))

    def _look(self) -> None:
        """Pass the drill's orders on to the joints of the simulated arm."""
        scheduler = self._machine.scheduler
        node = None if self.session is None else self.session.node("slave_sim")
        if node is not None and node.stage is not None:
            self._joints.obey(node.stage, self.word)
        scheduler.at(scheduler.now_ns + round(1e9 * inside.TURN), self._look)
