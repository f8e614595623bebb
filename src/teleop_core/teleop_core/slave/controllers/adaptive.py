"""Adaptive control: each joint learns its inertia, friction and load while it follows.

The effort has two parts. The first part is the effort that a joint with the parameters learned so far needs for a
reference motion back to the setpoint. The second part is a feedback that pulls the joint to the reference motion. The
error from the reference motion changes the parameters, each within bounds around its value in the drive table.

Source:
    Slotine and Li 1987, eqs. 5-9, on each joint by itself; bounds and dead zone as in Slotine and Li 1991, section 8.7.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.kernels import Array, kernel
from teleop_core.robots.robot import Robot
from teleop_core.slave.controllers import Controller, drives_and_poles, fields, motion_estimates

# Columns of the table of gains.
_INERTIA, _POLE, _VISCOUS, _FADING, _FRICTION, _TRAVEL, _DEAD_BAND, _RANGE = range(8)
_RATE, _SPEED_SCALE, _ACCELERATION_SCALE, _SPAN = range(8, 12)
# Learned parameters, as differences from their initial values: columns of the memory.
_MORE_INERTIA, _MORE_VISCOUS, _MORE_FRICTION, _LOAD = range(motion_estimates.MEMORY, motion_estimates.MEMORY + 4)


@dataclass(frozen=True, kw_only=True)
class AdaptiveParameters:
    """Poles, rates and bounds; empty lists are filled from the robot's drive table."""

    bandwidth: tuple[float, ...] = fields.bandwidth("triple")
    filter_ratio: float = fields.ratio("filters of motion")
    rate: float = parameter(
        1.0,
        Within(0.0, 10.0),
        "adaptation gain, divided by the gain that gives the load estimate and the loop three equal poles",
        source="derived: if only the load is adapted, 1 gives the poles of pid",
    )
    span: float = parameter(
        0.5,
        Within(0.0, 0.9),
        "largest deviation of the adapted inertia from that of the table, as a share of it",
        source="assumed: the inertia of a joint changes less between postures",
    )
    friction_share: float = fields.friction_share("with which the adaptation begins")
    friction_counts: float = fields.friction_counts()
    dead_band: float = fields.dead_band("up to which nothing is learned")


@kernel
def learn(value: float, change: float, bound: float) -> float:
    """The value plus ``change``, clipped to ±bound."""
    return min(max(value + change, -bound), bound)


@kernel
def adaptive_control(
    gains: Array,
    memory: Array,
    setpoint: Array,
    measured: Array,
    feedforward: Array,
    limit: Array,
    dt: float,
    effort: Array,
) -> None:
    """Write ``J a_r + viscous v_r + friction + load + 2 w J s + feedforward`` and learn.

    With the error e and its rate: ``v_r = v + w e``, ``a_r = a + w e'``, ``s = e' + w e``; each parameter changes by
    ``rate w² J s`` times the signal that it multiplies, divided by the square of that signal's scale. The law does not
    learn while the drive is saturated or the setpoint is too far away for the drive.
    """
    for i in range(effort.shape[0]):
        gain, row = gains[i], memory[i]
        inertia, pole, viscous = gain[_INERTIA], gain[_POLE], gain[_VISCOUS]
        motion_estimates.follow_motion(row, setpoint[i], measured[i], gain[_FADING], dt)
        direction = motion_estimates.friction_of_setpoint(row, setpoint[i], 1.0, gain[_TRAVEL])
        off = setpoint[i] - measured[i]
        error, share = motion_estimates.approach(off, gain[_RANGE]), motion_estimates.closeness(off, gain[_RANGE])
        wanted = share * row[motion_estimates.SET_SPEED]
        rate = wanted - row[motion_estimates.SPEED]
        speed, acceleration = wanted + pole * error, share * row[motion_estimates.SET_ACCELERATION] + pole * rate
        slip = rate + pole * error
        friction = (gain[_FRICTION] + row[_MORE_FRICTION]) * direction
        held = friction + row[_LOAD] + feedforward[i]
        moving = (inertia + row[_MORE_INERTIA]) * acceleration
        moving += (viscous + row[_MORE_VISCOUS]) * speed
        asked = moving + held + 2.0 * pole * inertia * slip
        effort[i] = min(max(asked, -limit[i]), limit[i])
        row[motion_estimates.EXPECTED] = (effort[i] - held - viscous * row[motion_estimates.SPEED]) / inertia
        if effort[i] == asked and share == 1.0:
            change = gain[_RATE] * motion_estimates.beyond(slip, pole * gain[_DEAD_BAND]) * dt
            more = change * acceleration / gain[_ACCELERATION_SCALE] ** 2
            row[_MORE_INERTIA] = learn(row[_MORE_INERTIA], more, gain[_SPAN])
            more = change * speed / gain[_SPEED_SCALE] ** 2
            row[_MORE_VISCOUS] = learn(row[_MORE_VISCOUS], more, viscous)
            row[_MORE_FRICTION] = learn(row[_MORE_FRICTION], change * direction, gain[_FRICTION])
            row[_LOAD] = learn(row[_LOAD], change, limit[i])


def adaptive_gains(parameters: AdaptiveParameters, robot: Robot, viscous: Array) -> Array:
    """Table (n, 12) of the known parameters of each joint, and of its learning rates and bounds.

    Raises:
        ParameterError: The length of the list is not the robot's number of joints.
    """
    p = parameters
    drives, pole = drives_and_poles(robot, "adaptive", p.bandwidth)
    fading = motion_estimates.fading_of(robot, pole, p.filter_ratio, stiffness=3.0, damping=3.0)
    friction, count = p.friction_share * motion_estimates.known_friction(robot), drives.encoder_step
    table = np.empty((robot.n, 12))
    table[:, _INERTIA], table[:, _POLE], table[:, _VISCOUS] = drives.inertia, pole, viscous
    table[:, _FADING], table[:, _FRICTION] = fading, friction
    table[:, _TRAVEL], table[:, _DEAD_BAND] = p.friction_counts * count, p.dead_band * count
    table[:, _RANGE] = motion_estimates.linear_range(robot, pole, 3.0)
    table[:, _RATE], table[:, _SPAN] = p.rate * pole**2 * drives.inertia, p.span * drives.inertia
    table[:, _SPEED_SCALE] = drives.speed_limit
    table[:, _ACCELERATION_SCALE] = drives.effort_limit / drives.inertia
    return table


ADAPTIVE = Controller(
    "adaptive",
    AdaptiveParameters,
    adaptive_gains,
    adaptive_control,
    motion_estimates.MEMORY + 4,
    *motion_estimates.holding(_LOAD),
)
