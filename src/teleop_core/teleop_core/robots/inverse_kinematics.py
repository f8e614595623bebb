"""Inverse kinematics as a stage: every slave pose becomes joint references, within joint speeds."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from teleop_core.geometry import transform_from_pose
from teleop_core.kernels import bound, kernel
from teleop_core.parameters import parameter
from teleop_core.robots import load_robot_set
from teleop_core.signals import DT, copy, make_signals


@dataclass(frozen=True, kw_only=True)
class InverseKinematicsParameters:
    """Parameters of :class:`InverseKinematics`."""

    robot: str = parameter("rcrt1", fixed=True, doc="slave robot, one of `teleop robot`")
    geometry: tuple[str, ...] = parameter(
        (), fixed=True, doc="symbol=value in place of the robot's lengths and options [m, rad]"
    )
    speed_share: float = parameter(
        1.0, lower=0.01, upper=1.0, doc="share of the drives' speed limits that references may use"
    )
    feedback_timeout: float = parameter(
        0.1, unit="s", lower=0.002, upper=5.0,
        doc="with an older slave setpoint, solutions start from the slave's joints again",
    )  # fmt: skip


def scratch(joints: int) -> Any:
    """Plain arrays for robot kernels, which cannot take fields of records, and the timeout [s]."""
    return (np.zeros((4, 4)), np.zeros(joints), np.zeros(joints), np.zeros(2), np.zeros(1))


@kernel
def inverse_kinematics_step(ik: Any, limits: Any, geometry: Any, work: Any, row: Any) -> None:
    """One slave pose: write slave_servo_jp, ik_status and ik_residual.

    The answer is the neighbour of the last one; while the slave does not follow, of the slave's
    own setpoint, so that a restart never asks for another branch.
    """
    T, seed, q, residual, timeout = work
    if row.stamp_ns - row.setpoint_stamp_ns > timeout[0] * 1e9:
        copy(row.slave_setpoint_js, seed)
    transform_from_pose(row.slave_servo_cp, T)
    status = ik(T, seed, limits, geometry, q, residual)
    if status >= 0:
        copy(q, seed)
    copy(seed, row.slave_servo_jp)
    copy(residual, row.ik_residual)
    row.ik_status = status
    row.servo_stamp_ns = row.stamp_ns


class InverseKinematics:
    """Stage that turns slave poses into joint references.

    ``signals`` is the record it reads (``stamp_ns``, ``slave_servo_cp``, ``slave_setpoint_js``,
    ``setpoint_stamp_ns``) and writes (``slave_servo_jp``, ``servo_stamp_ns``, ``ik_status``,
    ``ik_residual``).
    """

    def __init__(self, parameters: InverseKinematicsParameters, signals: Any = None) -> None:
        self.robot = load_robot_set(parameters.robot, parameters.geometry)
        self.signals = make_signals(self.robot.n)[0] if signals is None else signals
        self.work = scratch(self.robot.n)
        self.limits = self.robot.limits(DT)
        self.retune(parameters)
        self.reset()
        self._step = bound(
            inverse_kinematics_step, self.robot.ik_pointer, self.limits, self.robot.geometry_row,
            self.work, self.signals,
        )  # fmt: skip

    def reset(self) -> None:
        """Start from home."""
        self.work[1][:] = self.robot.home

    def retune(self, parameters: InverseKinematicsParameters) -> None:
        """Take new parameters from the next pose on."""
        self.limits[2] = self.robot.limits(DT)[2] * parameters.speed_share
        self.work[4][0] = parameters.feedback_timeout

    def step(self) -> None:
        """Process one slave pose."""
        self._step()
