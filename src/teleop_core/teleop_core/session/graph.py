"""Graph: which stage reads and writes which topic, and one tick of all of them."""

from dataclasses import dataclass
from typing import Any

from teleop_core import topics
from teleop_core.bags.recording import RecordingParameters
from teleop_core.geometry import Array
from teleop_core.kernels import kernel
from teleop_core.mapping.motion_scaling import (
    MotionScaling,
    MotionScalingParameters,
    motion_scaling_step,
)
from teleop_core.master.haptic_master import (
    HapticMaster,
    HapticMasterParameters,
    haptic_master_step,
)
from teleop_core.robots.inverse_kinematics import (
    InverseKinematics,
    InverseKinematicsParameters,
    inverse_kinematics_step,
)
from teleop_core.signals import TICK_NS, copy, make_signals
from teleop_core.slave.slave_sim import SlaveSim, SlaveSimParameters, slave_step
from teleop_core.topics import Topic


@dataclass(frozen=True)
class Stage:
    """One node of the graph: its parameters and topics."""

    name: str
    parameters: type
    reads: tuple[Topic, ...]
    writes: tuple[Topic, ...]


STAGES = (
    Stage(
        "haptic_master",
        HapticMasterParameters,
        (topics.MASTER_SERVO_CF,),
        (topics.MASTER_MEASURED_CP, topics.MASTER_MEASURED_CV, topics.MASTER_MEASURED_CF,
         topics.MASTER_BUTTONS),
    ),
    Stage(
        "motion_scaling",
        MotionScalingParameters,
        (topics.MASTER_MEASURED_CP, topics.MASTER_BUTTONS, topics.SLAVE_SETPOINT_CP),
        (topics.SLAVE_SERVO_CP, topics.MASTER_SERVO_CF, topics.TELEOP_STATE),
    ),
    Stage(
        "inverse_kinematics",
        InverseKinematicsParameters,
        (topics.SLAVE_SERVO_CP, topics.SLAVE_SETPOINT_JS),
        (topics.SLAVE_SERVO_JP,),
    ),
    Stage(
        "slave_sim",
        SlaveSimParameters,
        (topics.SLAVE_SERVO_JP,),
        (topics.SLAVE_SETPOINT_JS, topics.SLAVE_SETPOINT_CP, topics.SLAVE_MEASURED_JS,
         topics.SLAVE_MEASURED_CP),
    ),
    Stage("recorder", RecordingParameters, topics.ALL, ()),
)  # fmt: skip
"""The graph, in the order in which a tick goes through it; every stage also sends diagnostics."""

STAGE = {stage.name: stage for stage in STAGES}


@kernel
def _tick(stamp_ns: int, scaling: Any, ik: Any, slave: Any, row: Any) -> None:
    """One tick behind the master: scaling, inverse kinematics, slave, on one record."""
    row.stamp_ns = row.now_ns = stamp_ns
    motion_scaling_step(scaling[0], scaling[1], row)
    inverse_kinematics_step(ik[0], ik[1], ik[2], ik[3], row)
    p, s, work, robot, geometry, dynamics = slave
    slave_step(p, s, work, robot, geometry, dynamics, row)


@kernel
def _run_block(
    first_ns: int, master: Any, drawn: Any, scaling: Any, ik: Any, slave: Any, row: Any, block: Any
) -> None:
    """Run the whole graph for each row of ``block`` and write the signals there."""
    wanted, attitudes, noise, buttons = drawn
    for i in range(block.shape[0]):
        p, s, handle = master
        haptic_master_step(p, s, handle, wanted[i], attitudes[i], noise[i], buttons[i], row)
        _tick(first_ns + i * 1_000_000, scaling, ik, slave, row)
        block[i] = row


@kernel
def _replay_block(samples: Any, scaling: Any, ik: Any, slave: Any, row: Any, block: Any) -> None:
    """As :func:`_run_block`, with the master's topics of ``samples`` in place of the master."""
    for i in range(block.shape[0]):
        sample = samples[i]
        copy(sample.master_measured_cp, row.master_measured_cp)
        copy(sample.master_measured_cv, row.master_measured_cv)
        copy(sample.master_measured_cf, row.master_measured_cf)
        copy(sample.master_buttons, row.master_buttons)
        _tick(sample.stamp_ns, scaling, ik, slave, row)
        block[i] = row


class Graph:
    """All stages on one record of signals, in virtual time.

    Args:
        parameters: Stage name to its parameter group, as in :data:`STAGES`.
        recorded: Path for an operator that follows a recording; see
            :class:`teleop_core.master.paths.Path`.
    """

    def __init__(
        self, parameters: dict[str, Any], recorded: tuple[Array, Array] | None = None
    ) -> None:
        self.ik = InverseKinematics(parameters["inverse_kinematics"])
        self.robot = self.ik.robot
        self.signals = self.ik.signals
        self.slave = SlaveSim(parameters["slave_sim"], self.signals)
        self.master = HapticMaster(parameters["haptic_master"], self.signals, recorded)
        self.scaling = MotionScaling(parameters["motion_scaling"], self.signals)
        self.now_ns = 0
        """Stamp of the last tick [ns]; the first tick has 1 ms."""

    def _stages(self) -> tuple[Any, Any, Any]:
        ik, slave = self.ik, self.slave
        return (
            (self.scaling.parameters, self.scaling.state),
            (ik.robot.ik_pointer, ik.limits, ik.robot.geometry_row, ik.work),
            (slave.parameters, slave.state, slave.work, slave.pointers,
             slave.robot.geometry_row, slave.dynamics),
        )  # fmt: skip

    def run(self, ticks: int) -> Any:
        """Next ``ticks`` ticks of the session.

        Returns:
            Signals after each tick, a structured array (ticks,).
        """
        block = make_signals(self.robot.n, ticks)
        master = (self.master.parameters, self.master.state, self.master.handle)
        first_ns = self.now_ns + TICK_NS
        _run_block(first_ns, master, self.master.draw(ticks), *self._stages(), self.signals, block)
        self.now_ns += ticks * TICK_NS
        return block

    def replay(self, samples: Any) -> Any:
        """Ticks with recorded master samples in place of the simulated master.

        Args:
            samples: Signals (N,) of which ``stamp_ns`` and the master's topics are used.

        Returns:
            Signals after each tick, a structured array (N,).
        """
        block = make_signals(self.robot.n, len(samples))
        _replay_block(samples, *self._stages(), self.signals, block)
        self.now_ns = int(samples["stamp_ns"][-1])
        return block
