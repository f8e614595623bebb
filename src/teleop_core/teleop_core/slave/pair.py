"""Pair: a server and its simulated arm as one object, to move a slave without other stages."""

from dataclasses import dataclass, fields

import numpy as np

from teleop_core.graph import DT, RunningStage, Stage, assign
from teleop_core.kernels import Integers, addressed, call_address, kernel
from teleop_core.slave import commands, slave, slave_sim
from teleop_core.slave.parameters import SlaveParameters


@dataclass(frozen=True, kw_only=True)
class ArmParameters(SlaveParameters, slave_sim.SlaveSimParameters):
    """Parameters of a server and of its simulated arm."""

    @staticmethod
    def of(server: SlaveParameters, simulated: slave_sim.SlaveSimParameters) -> "ArmParameters":
        """Parameters from two groups, which must name the same robot."""
        groups = (simulated, server)
        return ArmParameters(**{f.name: getattr(g, f.name) for g in groups for f in fields(g)})


@kernel
def arm_step(calls: Integers, row: commands.SlaveRow, dt: float) -> None:
    """One tick of the server and its simulated arm on one row of signals.

    Args:
        calls: Addresses of the steps of server and simulated arm, and of their blocks (2, 2).
        row: Signals of server and simulated arm; the server reads measured values of the previous tick.
        dt: Tick [s], which the blocks contain too.
    """
    for i in range(2):
        call_address(calls[i, 0], calls[i, 1])
    row.slave_measured_js_ns = row.now_ns


class SimulatedArm(RunningStage):
    """A server and its simulated arm, stepped together without a graph.

    Args:
        parameters: Parameters of server and simulated arm.
        dt: Tick [s].

    Attributes:
        server: The server; its signals are those of the pair.
        simulated: The simulated arm; its signals are those of the pair.

    Raises:
        ParameterError: As in :class:`~teleop_core.slave.slave.Slave` and
            :class:`~teleop_core.slave.slave_sim.SlaveSim`.
    """

    def __init__(self, parameters: ArmParameters, dt: float = DT) -> None:
        self.server, self.simulated = slave.Slave(parameters, dt), slave_sim.SlaveSim(parameters, dt)
        self.robot = self.server.robot
        super().__init__(_PAIR, self.robot.n, dt)
        for stage in (self.server, self.simulated):
            stage.signals = self.signals
        self._steps = [addressed(one.kernel, *one.arguments, self.signals, dt) for one in (self.server, self.simulated)]
        calls = np.array([(step.address, step.block_address) for step in self._steps], np.int64)
        self.kernel, self.arguments = arm_step, (calls,)
        self._begin = self.signals.copy()
        self.reset()

    def reset(self) -> None:
        """Return to home, at rest, without any command."""
        assign(self.signals, self._begin)
        for stage in (self.server, self.simulated):
            stage.reset()

    def prepare(self, ticks: int) -> None:
        """Prepare the next steps: draw the noise of the simulated arm."""
        self.simulated.prepare(ticks)

    def retune(self, parameters: ArmParameters) -> None:
        """Take new parameters from the next tick on; raises as the two stages do."""
        self.simulated.retune(parameters)
        self.server.retune(parameters)

    @property
    def lead(self) -> int:
        """Ticks of the move from home to the slave's start; the slave follows no command before its end."""
        return self.server.lead


_PAIR = Stage(
    "arm",
    ArmParameters,
    reads=slave.SLAVE.reads,
    writes=(*slave.SLAVE.writes, *slave_sim.SLAVE_SIM.writes),
    late=slave.SLAVE.late,
    notes=slave.SLAVE.notes,
    make=SimulatedArm,
)
