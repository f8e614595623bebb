"""Passivity as a stage: the slave's port, between the arriving commands and inverse kinematics.

The stage counts the energy through the slave's tip. It applies the passivity law that the hand's side selects to the
command. Without this stage the energy that the slave gives to its environment is not limited.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.coupling.passivity import MEMORY, PASSIVITIES
from teleop_core.coupling.passivity.port import IN, LAW, ROUND, TURN_IN, begin_round, count, hear_energy, port_work
from teleop_core.graph import DT, Row, RunningStage, Stage, assign, copy, topics
from teleop_core.kernels import Array, Fields, PoseRow, Wrench, inner, kernel, record, records
from teleop_core.kernels.geometry import turn_between
from teleop_core.kernels.room import room


@dataclass(frozen=True, kw_only=True)
class PassivityParameters:
    """Parameters of the slave's side, of every kind of passivity."""

    recovery: float = parameter(
        0.2,
        Within(1e-3, 100.0, "s"),
        "time constant with which the slave's command makes up the distance that it lost for want of energy",
        source="assumed",
    )
    recovery_speed: float = parameter(
        5e-3,
        Within(0.0, 1.0, "m/s"),
        "largest speed at which the slave's command makes up a lost distance, or moves back because "
        "the slave spent more energy than it had",
        source="assumed: at this speed an arm hits steel with some 2 N",
    )
    least_force: float = parameter(
        0.01,
        Within(0.0, 10.0, "N"),
        "a smaller force on the tip counts as zero; must exceed the force that the sensor reports without contact",
        source="assumed: suits an ideal sensor",
    )
    credit: float = parameter(
        2e-4,
        Within(0.0, 1.0, "J"),
        "credit of energy that the arm can spend before the hand has supplied any: with tank and "
        "tdpa once, with wave in each contact. Energy that the world returns repays it first and "
        "never goes to the hand",
        source="assumed: moves the arm by half a millimetre before the hand supplies energy",
    )
    credit_force: float = parameter(
        1.0,
        Within(1e-3, 100.0, "N"),
        "with wave, force on the tip up to which the whole credit is available; from twice this "
        "force on there is no credit, and an arm that overspent at a hard obstacle gives the energy "
        "back",
        source="assumed: the force of a gentle touch",
    )
    stop_force: float = parameter(
        5.0,
        Within(0.1, 1000.0, "N"),
        "force on the tip at which the tank stops a command that moves against the force; the arm "
        "lags behind its command, and therefore still presses harder",
        source="assumed: less than the continuous force of the RCRT-1's drives",
    )
    approach_stiffness: float = parameter(
        1300.0,
        Within(1.0, 1e6, "N/m"),
        "stiffness of objects that the tip may meet: with tank and tdpa, the command leads the tip "
        "only as far as the remaining energy pays for pressing into such an object",
        source="assumed: silicone; pressing into softer objects needs less energy, and harder objects stop the arm",
    )


class PassivityLaws(NamedTuple):
    """The slave's side of all kinds, and their memory."""

    slaves: Any
    numbers: Array
    memory: Array
    flow: Array  # energies since the last command: received from the other side, in, out
    last: Array  # the last command that was given (7,)


class PortState(Fields):
    """State record of the slave's port."""

    tip: PoseRow
    tip_ns: int
    force: Wrench
    felt: Wrench  # mean over the last motion of the tip
    before: Wrench
    command_ns: int
    has_last: int


@inner
def _observe(s: PortState, laws: PassivityLaws, row: Row, port: Array) -> None:
    """Count the energy through the tip since its last measurement.

    The force is the mean of the measured forces at start and end of the motion, so that a spring takes and returns
    equal energies.
    """
    is_late = row.slave_measured_cf_ns > row.slave_measured_cp_ns
    for i in range(6):
        now = s.before[i] if is_late else row.slave_measured_cf[i]
        s.felt[i], s.force[i] = 0.5 * (s.force[i] + now), now
        s.before[i] = row.slave_measured_cf[i]
    step, turn = room(3), room(3)
    if s.tip_ns != 0 and row.slave_measured_cp_ns > s.tip_ns:
        for i in range(3):
            step[i] = row.slave_measured_cp[i] - s.tip[i]
        turn_between(s.tip[3:7], row.slave_measured_cp[3:7], turn)
        came = port_work(s.felt[0:3], step)
        count(port, IN, came)
        turned = port_work(s.felt[3:6], turn)
        count(port, TURN_IN, turned)
        came += turned
        laws.flow[1] += max(came, 0.0)
        laws.flow[2] += max(-came, 0.0)
    copy(row.slave_measured_cp, s.tip)
    s.tip_ns = row.slave_measured_cp_ns


@inner
def _begin(s: PortState, laws: PassivityLaws, heard: Array, port: Array) -> None:
    """Begin the round that the hand's side announces, without any drift."""
    begin_round(port, heard[LAW], heard[ROUND])
    for i in range(laws.memory.shape[0]):
        laws.memory[i] = 0.0
    for i in range(3):
        laws.flow[i] = 0.0
    s.has_last = 0


@kernel
def passivity_step(p: Fields, s: PortState, laws: PassivityLaws, row: Row, dt: float) -> None:
    """One tick: count the energy at the tip, and process a command that has arrived.

    Args:
        p: Not used.
        s: State record; written.
        laws: :class:`PassivityLaws`; written.
        row: Signals; ``slave_energy`` and ``passivity_servo_cp`` are written.
        dt: Tick [s].
    """
    port, heard = row.slave_energy, row.master_energy
    if heard[ROUND] > port[ROUND]:
        _begin(s, laws, heard, port)
    _observe(s, laws, row, port)
    laws.flow[0] += hear_energy(port, heard)
    if row.slave_servo_cp_ns == s.command_ns:
        return
    elapsed = max(1e-9 * (row.slave_servo_cp_ns - s.command_ns), dt) if s.has_last else dt
    s.command_ns = row.slave_servo_cp_ns
    copy(row.slave_servo_cp, row.passivity_servo_cp)
    law = int(port[LAW])
    # The first command of a round is the slave's position. While the slave does not follow, all commands are its
    # position.
    if s.has_last and 0 <= law < len(laws.slaves):
        laws.slaves[law](
            laws.numbers, laws.memory, laws.flow, s.force, s.tip, laws.last, heard, port,
            row.passivity_servo_cp, elapsed,
        )  # fmt: skip
    copy(row.passivity_servo_cp, laws.last)
    s.has_last = 1
    for i in range(3):
        laws.flow[i] = 0.0


class SlaveSide(RunningStage):
    """Stage of the slave's port."""

    def __init__(self, parameters: PassivityParameters, dt: float = DT) -> None:
        super().__init__(PASSIVITY, 0, dt)
        self.parameters, self.state = records([("none", "i8")])[0], record(PortState)
        self.kernel = passivity_step
        slaves = tuple(PASSIVITIES.find(name).slave_pointer for name in PASSIVITIES)
        self._laws = PassivityLaws(slaves, np.zeros(7), np.zeros(MEMORY), np.zeros(3), np.zeros(7))
        self.arguments = (self.parameters, self.state, self._laws)
        self._start = self.signals.copy()
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Set energy and drift to zero, and forget the command."""
        assign(self.state, 0)
        assign(self.signals, self._start)
        for array in self._laws[2:]:
            array[:] = 0.0

    def retune(self, parameters: PassivityParameters) -> None:
        """Take new parameters from the next command on."""
        self._laws.numbers[:] = (
            parameters.recovery,
            parameters.recovery_speed,
            parameters.least_force,
            parameters.credit,
            parameters.credit_force,
            parameters.stop_force,
            parameters.approach_stiffness,
        )


PASSIVITY = Stage(
    "passivity",
    PassivityParameters,
    reads=(topics.SLAVE_SERVO_CP, topics.MASTER_ENERGY, topics.SLAVE_MEASURED_CF, topics.SLAVE_MEASURED_CP),
    writes=(topics.PASSIVITY_SERVO_CP, topics.SLAVE_ENERGY),
    late=(topics.SLAVE_MEASURED_CF, topics.SLAVE_MEASURED_CP),
    replaces=topics.SLAVE_SERVO_CP,
    make=SlaveSide,
)
