"""Friction compensation: a PID that feeds forward the effort needed for the setpoint's motion.

That effort is inertia times the setpoint's acceleration, viscous friction times its speed, and dry friction in the
direction of its motion. Dry friction changes smoothly over a few encoder counts of travel. The feedforward depends on
the setpoint alone, so it closes no loop that could oscillate. The integral stays constant while the error is within a
dead band, so that dry friction and encoder counts together cause no limit cycle.

Source:
    Armstrong-Hélouvry, Dupont and Canudas de Wit 1994, sections 5.2 and 5.3 (compensation by the
    desired motion; dead band in the integral).
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.kernels import Array, kernel
from teleop_core.robots.robot import Robot
from teleop_core.slave.controllers import Controller, drives_and_poles, fields, motion_estimates
from teleop_core.slave.controllers.pid import critically_damped_gains

# Columns of the table of gains.
_KP, _KI, _KD, _INERTIA, _VISCOUS, _FADING, _FRICTION, _TRAVEL, _DEAD_BAND, _RANGE = range(10)
_INTEGRAL = motion_estimates.MEMORY


@dataclass(frozen=True, kw_only=True)
class FrictionCompensationParameters:
    """Poles and known friction; empty lists are filled from the robot's drive table."""

    bandwidth: tuple[float, ...] = fields.bandwidth("triple")
    filter_ratio: float = fields.ratio("filters of motion")
    friction_share: float = fields.friction_share("that is fed forward")
    friction_counts: float = fields.friction_counts()
    dead_band: float = fields.dead_band("up to which the integral does not change")


@kernel
def friction_compensation_control(
    gains: Array,
    memory: Array,
    setpoint: Array,
    measured: Array,
    feedforward: Array,
    limit: Array,
    dt: float,
    effort: Array,
) -> None:
    """Write ``Kp e + Ki ∫e + Kd (v - v̂) + J a + viscous v + friction + feedforward``.

    The integral stays constant while the setpoint is too far away for the drive. It also stays constant while the
    drive is saturated and the error would increase the effort further.
    """
    for i in range(effort.shape[0]):
        gain, row = gains[i], memory[i]
        inertia, viscous = gain[_INERTIA], gain[_VISCOUS]
        motion_estimates.follow_motion(row, setpoint[i], measured[i], gain[_FADING], dt)
        friction = motion_estimates.friction_of_setpoint(row, setpoint[i], gain[_FRICTION], gain[_TRAVEL])
        off = setpoint[i] - measured[i]
        error, share = motion_estimates.approach(off, gain[_RANGE]), motion_estimates.closeness(off, gain[_RANGE])
        speed = share * row[motion_estimates.SET_SPEED]
        free = gain[_KP] * error + gain[_KD] * (speed - row[motion_estimates.SPEED])
        free += inertia * share * row[motion_estimates.SET_ACCELERATION] + viscous * speed + friction + feedforward[i]
        integral = row[_INTEGRAL] + gain[_KI] * motion_estimates.beyond(error, gain[_DEAD_BAND]) * dt
        is_inside = abs(free + integral) <= limit[i] or (free + integral) * error < 0.0
        if share == 1.0 and is_inside:
            row[_INTEGRAL] = integral
        effort[i] = min(max(free + row[_INTEGRAL], -limit[i]), limit[i])
        # The effort of the integral balances a load, so it does not accelerate the joint.
        known = friction + feedforward[i] + row[_INTEGRAL]
        row[motion_estimates.EXPECTED] = (effort[i] - known - viscous * row[motion_estimates.SPEED]) / inertia


def friction_compensation_gains(parameters: FrictionCompensationParameters, robot: Robot, viscous: Array) -> Array:
    """Table (n, 10): PID gains, inertia, friction, dead band and linear range of each joint.

    Raises:
        ParameterError: The length of the list is not the robot's number of joints.
    """
    p = parameters
    drives, pole = drives_and_poles(robot, "friction_compensation", p.bandwidth)
    kp, ki, kd = critically_damped_gains(drives.inertia, viscous, pole)
    fading = motion_estimates.fading_of(robot, pole, p.filter_ratio, stiffness=3.0, damping=3.0)
    friction, count = p.friction_share * motion_estimates.known_friction(robot), drives.encoder_step
    table = np.empty((robot.n, 10))
    table[:, _KP], table[:, _KI], table[:, _KD] = kp, ki, kd
    table[:, _INERTIA], table[:, _VISCOUS], table[:, _FADING] = drives.inertia, viscous, fading
    table[:, _FRICTION], table[:, _TRAVEL] = friction, p.friction_counts * count
    table[:, _DEAD_BAND], table[:, _RANGE] = p.dead_band * count, motion_estimates.linear_range(robot, pole, 3.0)
    return table


FRICTION_COMPENSATION = Controller(
    "friction_compensation",
    FrictionCompensationParameters,
    friction_compensation_gains,
    friction_compensation_control,
    motion_estimates.MEMORY + 1,
    *motion_estimates.holding(_INTEGRAL),
)
