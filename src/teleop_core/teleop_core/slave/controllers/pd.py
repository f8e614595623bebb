"""PD: proportional and derivative action alone, so friction leaves an error at rest."""

from dataclasses import dataclass

import numpy as np

from teleop_core.kernels import Array, kernel
from teleop_core.robots.robot import Robot
from teleop_core.slave.controllers import Controller, drives_and_poles, fields


@dataclass(frozen=True, kw_only=True)
class PdParameters:
    """Double closed-loop pole; empty lists are filled from the robot's drive table."""

    bandwidth: tuple[float, ...] = fields.bandwidth("double")


# Columns of the table of gains.
_KP, _KD = range(2)
# Columns of the memory.
_LAST, _SPEED = range(2)


@kernel
def pd_control(
    gains: Array,
    memory: Array,
    setpoint: Array,
    measured: Array,
    feedforward: Array,
    limit: Array,
    dt: float,
    effort: Array,
) -> None:
    """Write ``Kp (setpoint - measured) - Kd speed + feedforward`` of each joint.

    The speed is that of the measured position, through a first-order filter of two ticks; the memory contains the last
    position and the filtered speed.
    """
    for i in range(effort.shape[0]):
        row = memory[i]
        row[_SPEED] += ((measured[i] - row[_LAST]) / dt - row[_SPEED]) / 2.0
        row[_LAST] = measured[i]
        pull = gains[i, _KP] * (setpoint[i] - measured[i]) - gains[i, _KD] * row[_SPEED]
        effort[i] = min(max(pull + feedforward[i], -limit[i]), limit[i])


def pd_gains(parameters: PdParameters, robot: Robot, viscous: Array) -> Array:
    """Kp, Kd of each joint, (n, 2), for the characteristic polynomial ``inertia (s + bandwidth)²``.

    Raises:
        ParameterError: The length of the list is not the robot's number of joints.
    """
    drives, bandwidth = drives_and_poles(robot, "pd", parameters.bandwidth)
    kd = (2.0 * bandwidth * drives.inertia - viscous).clip(min=0.0)
    return np.stack((bandwidth**2 * drives.inertia, kd), axis=1)


def begin(memory: Array, measured: Array, effort: Array) -> None:
    """Start at rest; without an integrator nothing balances uncompensated gravity."""
    memory[:, _LAST] = measured


PD = Controller("pd", PdParameters, pd_gains, pd_control, 2, begin)
