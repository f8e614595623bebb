"""Disturbance observer: estimates and cancels all forces on a joint except its drive effort.

The nominal joint is a pure inertia with viscous friction. Everything else that acts on the joint is one disturbance:
dry friction, unknown weights, coupling, gravity that is not compensated. The disturbance passes a third-order filter Q
with the observer's pole and is then subtracted from the effort. Tracking has a pair of real poles, with the setpoint's
speed and acceleration fed forward.

Source:
    Ohnishi 1987; Umeno and Hori 1991, eqs. 6-14 (Q-filters of order three); here as an observer
    with three equal poles, which has the same Q, ``1 / (1 + s / pole)³``.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.kernels import Array, kernel
from teleop_core.robots.robot import Robot
from teleop_core.slave.controllers import Controller, drives_and_poles, fields, motion_estimates

# Columns of the table of gains.
_INERTIA, _POLE, _VISCOUS, _FADING, _FRICTION, _TRAVEL, _DEAD_BAND, _RANGE = range(8)
_HELD = motion_estimates.MEMORY  # column of the memory: uncompensated gravity effort at the start


@dataclass(frozen=True, kw_only=True)
class DisturbanceObserverParameters:
    """Poles and known friction; empty lists are filled from the robot's drive table."""

    bandwidth: tuple[float, ...] = fields.bandwidth("double")
    observer_ratio: float = fields.ratio("observer")
    friction_share: float = fields.friction_share("that is fed forward")
    friction_counts: float = fields.friction_counts()
    dead_band: float = fields.dead_band("up to which nothing is corrected")


@kernel
def disturbance_observer_control(
    gains: Array,
    memory: Array,
    setpoint: Array,
    measured: Array,
    feedforward: Array,
    limit: Array,
    dt: float,
    effort: Array,
) -> None:
    """Write ``J (a + 2 w (v - v̂) + w² e - d̂) + viscous v + friction + feedforward``.

    d̂ is the acceleration of the joint that the model does not explain. While the effort is at its limit, the observer
    expects the acceleration of the limited effort, so it does not wind up.
    """
    for i in range(effort.shape[0]):
        gain, row = gains[i], memory[i]
        inertia, pole, viscous = gain[_INERTIA], gain[_POLE], gain[_VISCOUS]
        motion_estimates.follow_motion(row, setpoint[i], measured[i], gain[_FADING], dt)
        friction = motion_estimates.friction_of_setpoint(row, setpoint[i], gain[_FRICTION], gain[_TRAVEL])
        off = motion_estimates.beyond(setpoint[i] - measured[i], gain[_DEAD_BAND])
        error, share = (motion_estimates.approach(off, gain[_RANGE]), motion_estimates.closeness(off, gain[_RANGE]))
        speed = share * row[motion_estimates.SET_SPEED]
        wanted = (
            share * row[motion_estimates.SET_ACCELERATION]
            + 2.0 * pole * (speed - row[motion_estimates.SPEED])
            + pole * pole * error
            - row[motion_estimates.UNEXPLAINED]
        )
        known = feedforward[i] + friction + row[_HELD]
        effort[i] = min(max(inertia * wanted + viscous * speed + known, -limit[i]), limit[i])
        row[motion_estimates.EXPECTED] = (effort[i] - known - viscous * row[motion_estimates.SPEED]) / inertia


def disturbance_observer_gains(parameters: DisturbanceObserverParameters, robot: Robot, viscous: Array) -> Array:
    """Table (n, 8): inertia, pole, friction, dead band and linear range of each joint.

    Raises:
        ParameterError: The length of the list is not the robot's number of joints.
    """
    p = parameters
    drives, pole = drives_and_poles(robot, "disturbance_observer", p.bandwidth)
    fading = motion_estimates.fading_of(robot, pole, p.observer_ratio, stiffness=1.0, damping=2.0, rejection=1.0)
    friction = p.friction_share * motion_estimates.known_friction(robot)
    count = drives.encoder_step
    table = np.empty((robot.n, 8))
    table[:, _INERTIA], table[:, _POLE], table[:, _VISCOUS] = drives.inertia, pole, viscous
    table[:, _FADING], table[:, _FRICTION] = fading, friction
    table[:, _TRAVEL], table[:, _DEAD_BAND] = p.friction_counts * count, p.dead_band * count
    table[:, _RANGE] = motion_estimates.linear_range(robot, pole, 1.0)
    return table


DISTURBANCE_OBSERVER = Controller(
    "disturbance_observer",
    DisturbanceObserverParameters,
    disturbance_observer_gains,
    disturbance_observer_control,
    motion_estimates.MEMORY + 1,
    *motion_estimates.holding(_HELD),
)
