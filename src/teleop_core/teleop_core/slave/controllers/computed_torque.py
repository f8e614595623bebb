"""Computed torque: the robot's model turns wanted accelerations into efforts, all joints together.

The wanted acceleration is that of the setpoint plus a feedback of the error with three equal poles. The model gives
inertia and coupling at the arm's position, Coriolis and centrifugal effort, and the whole gravity, whatever the value
of ``gravity_compensation``. The model contains neither dry friction nor weights that are missing in the drawing; the
integral must balance these.

Source:
    Luh, Walker and Paul 1980; Craig 2005, eqs. 10.15-10.19, with integral action.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.kernels import Array, kernel
from teleop_core.robots.robot import Robot
from teleop_core.slave.controllers import Controller, drives_and_poles, fields, motion_estimates

# Columns of the table of gains.
_POLE, _FADING, _VISCOUS, _DEAD_BAND, _RANGE = range(5)
_INTEGRAL, _WANTED = motion_estimates.MEMORY, motion_estimates.MEMORY + 1  # columns of the memory


@dataclass(frozen=True, kw_only=True)
class ComputedTorqueParameters:
    """Poles; an empty list is filled from the robot's drive table."""

    bandwidth: tuple[float, ...] = fields.bandwidth("triple")
    filter_ratio: float = fields.ratio("filters of motion")
    dead_band: float = fields.dead_band("up to which the integral does not change")


@kernel
def computed_torque_control(
    gains: Array,
    memory: Array,
    setpoint: Array,
    measured: Array,
    feedforward: Array,
    limit: Array,
    dt: float,
    effort: Array,
) -> None:
    """Write ``D (a + 3 w (v - v̂) + 3 w² e + w³ ∫e) + viscous v + bias``.

    The integral of a joint stays constant while its setpoint is too far away for the drive. It also stays constant
    while the drive is saturated and the error would increase the effort further.
    """
    n = effort.shape[0]
    for i in range(n):
        row, pole = memory[i], gains[i, _POLE]
        motion_estimates.follow_motion(row, setpoint[i], measured[i], gains[i, _FADING], dt)
        off = setpoint[i] - measured[i]
        error, share = (
            motion_estimates.approach(off, gains[i, _RANGE]),
            motion_estimates.closeness(off, gains[i, _RANGE]),
        )
        rate = share * row[motion_estimates.SET_SPEED] - row[motion_estimates.SPEED]
        wanted = 3.0 * pole * (rate + pole * error) + share * row[motion_estimates.SET_ACCELERATION]
        row[_WANTED] = wanted + row[_INTEGRAL]
        row[motion_estimates.EXPECTED] = wanted
    for i in range(n):
        row, pole, error = memory[i], gains[i, _POLE], setpoint[i] - measured[i]
        share = motion_estimates.closeness(error, gains[i, _RANGE])
        asked = feedforward[n + i] + gains[i, _VISCOUS] * share * row[motion_estimates.SET_SPEED]
        for j in range(n):
            asked += feedforward[2 * n + n * i + j] * memory[j, _WANTED]
        effort[i] = min(max(asked, -limit[i]), limit[i])
        if share == 1.0 and (effort[i] == asked or asked * error < 0.0):
            row[_INTEGRAL] += pole * pole * pole * motion_estimates.beyond(error, gains[i, _DEAD_BAND]) * dt
        # A saturated joint accelerates less than the law demands.
        row[motion_estimates.EXPECTED] += (effort[i] - asked) / feedforward[2 * n + n * i + i]


def computed_torque_gains(parameters: ComputedTorqueParameters, robot: Robot, viscous: Array) -> Array:
    """Table (n, 5): pole, friction, dead band and linear range of each joint.

    Raises:
        ParameterError: The length of the list is not the robot's number of joints.
    """
    p = parameters
    drives, pole = drives_and_poles(robot, "computed_torque", p.bandwidth)
    fading = motion_estimates.fading_of(robot, pole, p.filter_ratio, stiffness=3.0, damping=3.0)
    table = np.empty((robot.n, 5))
    table[:, _POLE], table[:, _FADING], table[:, _VISCOUS] = pole, fading, viscous
    table[:, _DEAD_BAND] = p.dead_band * drives.encoder_step
    table[:, _RANGE] = motion_estimates.linear_range(robot, pole, 3.0)
    return table


COMPUTED_TORQUE = Controller(
    "computed_torque",
    ComputedTorqueParameters,
    computed_torque_gains,
    computed_torque_control,
    motion_estimates.MEMORY + 2,
    motion_estimates.begin_motion,
    uses_model=True,
)
