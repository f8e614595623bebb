"""Inverse kinematics as a stage: every slave pose becomes joint references, within joint speeds."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from teleop_core.geometry import Array, transform_from_pose
from teleop_core.kernels import kernel
from teleop_core.parameters import parameter
from teleop_core.robots import load_robot_set
from teleop_core.robots.parameters import RobotParameters
from teleop_core.signals import DT, copy
from teleop_core.stage import RunningStage, Stage
from teleop_core.topics import SLAVE_SERVO_CP, SLAVE_SERVO_JP, SLAVE_SETPOINT_JS


@dataclass(frozen=True, kw_only=True)
class InverseKinematicsParameters(RobotParameters):
    """Parameters of :class:`InverseKinematics`."""

    speed_share: float = parameter(
        1.0, lower=0.01, upper=1.0, doc="share of the drives' speed limits that references may use"
    )
    feedback_timeout: float = parameter(
        0.1, unit="s", lower=0.002, upper=5.0,
        doc="with an older slave setpoint, solutions start from the slave's joints again",
    )  # fmt: skip


class Solver(NamedTuple):
    """Solver of one robot with room to work in: plain arrays, which robot kernels take."""

    ik: Any
    limits: Array
    geometry: Array
    timeout: Array  # of the feedback (1,) [s]
    T: Array
    seed: Array  # the last answer (n,)
    q: Array
    residual: Array


@kernel
def inverse_kinematics_step(solver: Any, row: Any, dt: float) -> None:
    """One slave pose: write slave_servo_jp, ik_status and ik_residual.

    The answer is the neighbour of the last one; while the slave does not follow, of the slave's
    own setpoint, so that a restart never asks for another branch.
    """
    T, seed, q, residual = solver.T, solver.seed, solver.q, solver.residual
    if row.slave_servo_cp_ns - row.slave_setpoint_js_ns > solver.timeout[0] * 1e9:
        copy(row.slave_setpoint_js, seed)
    transform_from_pose(row.slave_servo_cp, T)
    status = solver.ik(T, seed, solver.limits, solver.geometry, q, residual)
    if status >= 0:
        copy(q, seed)
    copy(seed, row.slave_servo_jp)
    copy(residual, row.ik_residual)
    row.ik_status = status


class InverseKinematics(RunningStage):
    """Stage that turns slave poses into joint references; ``ik_status`` tells how it went."""

    def __init__(self, parameters: InverseKinematicsParameters, dt: float = DT) -> None:
        self.robot = load_robot_set(parameters.robot, parameters.geometry)
        n = self.robot.n
        super().__init__(INVERSE_KINEMATICS, n, dt)
        self._solver = Solver(
            self.robot.ik_pointer, self.robot.limits(dt).copy(), self.robot.geometry_row.copy(),
            np.zeros(1), np.zeros((4, 4)), np.zeros(n), np.zeros(n), np.zeros(2),
        )  # fmt: skip
        self.kernel, self.arguments = inverse_kinematics_step, (self._solver,)
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Start from home."""
        self._solver.seed[:] = self.robot.home

    def retune(self, parameters: InverseKinematicsParameters) -> None:
        """Take new parameters from the next pose on."""
        self._solver.limits[2] = self.robot.limits(self.dt)[2] * parameters.speed_share
        self._solver.timeout[0] = parameters.feedback_timeout


INVERSE_KINEMATICS = Stage(
    "inverse_kinematics",
    InverseKinematicsParameters,
    reads=(SLAVE_SERVO_CP, SLAVE_SETPOINT_JS),
    writes=(SLAVE_SERVO_JP,),
    late=(SLAVE_SETPOINT_JS,),
    trigger=SLAVE_SERVO_CP,
    needs=(SLAVE_SETPOINT_JS,),
    notes=(("ik_status", "i8"), ("ik_residual", "f8", (2,))),
    make=InverseKinematics,
)
