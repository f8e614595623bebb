"""Led slave: a simulated arm and its server, tick by tick, with the joint commands that lead them."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from teleop_core.graph import TICK_NS
from teleop_core.kernels import Array
from teleop_core.slave.commands import CommandStatus
from teleop_core.slave.pair import SimulatedArm


class LedSlave:
    """A slave and the ticks that its commands come in; ``now_ns`` is its clock, from where its signals stand."""

    def __init__(self, slave: SimulatedArm) -> None:
        self.slave, self.row = slave, slave.signals
        self.now_ns = int(self.row["now_ns"])

    def tick(self, command: Array | None = None, stamp_ns: int | None = None) -> CommandStatus:
        """One tick, with a command or without; returns the status."""
        self.now_ns += TICK_NS
        if command is not None:
            self.row["slave_servo_jp"] = command
            self.row["slave_servo_jp_ns"] = self.now_ns if stamp_ns is None else stamp_ns
        self.row["now_ns"] = self.now_ns
        self.slave.step()
        return CommandStatus(self.row["command_status"])

    def along(self, commands: Iterable[Array | None]) -> NDArray[np.void]:
        """Signals (N,) of ticks with a command each, or without."""
        rows = []
        for command in commands:
            self.tick(command)
            rows.append(self.row.copy())
        return np.array(rows)

    @property
    def setpoint(self) -> Array:
        """Where the server leads the joints (n,)."""
        return self.row["slave_setpoint_js"].copy()
