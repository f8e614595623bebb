"""Adaptive control: each joint learns its inertia, friction and load while it follows.

The effort is what a joint with the parameters learned so far needs for a reference motion that
leads back to the setpoint, and a pull to that motion. What is left of the pull's error changes the
parameters, each within bounds around what the drive table says.

Source:
    Slotine and Li 1987, eqs. 5-9, on each joint by itself; bounds and dead zone as in Slotine and
    Li 1991, section 8.7.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.base.parameters import parameter
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot
from teleop_core.slave.controllers import Controller, drives_and_poles, fields
from teleop_core.slave.controllers.motion_estimates import (
    MEMORY,
    approach,
    beyond,
    closeness,
    fading_of,
    follow_motion,
    friction_of_setpoint,
    holding,
    known_friction,
    linear_range,
)

# What was learned, as differences from what is known at the start.
_INERTIA, _VISCOUS, _FRICTION, _LOAD = range(MEMORY, MEMORY + 4)


@dataclass(frozen=True, kw_only=True)
class AdaptiveParameters:
    """Poles, rates and bounds; an empty list means: from the robot's drive table."""

    bandwidth: tuple[float, ...] = fields.bandwidth("triple")
    filter_ratio: float = fields.ratio("filters of motion")
    rate: float = parameter(
        1.0, lower=0.0, upper=10.0,
        doc="how fast it learns, over what gives load and loop three equal poles",
        source="derived: of load alone, 1 gives the poles of pid",
    )  # fmt: skip
    span: float = parameter(
        0.5, lower=0.0, upper=0.9, doc="how far inertia may be from the table, share of it",
        source="assumed: inertias of links change less than that between postures",
    )  # fmt: skip
    friction_share: float = fields.friction_share("from which it begins")
    friction_counts: float = fields.friction_counts()
    dead_band: float = fields.dead_band("from which nothing is learned")


@kernel
def learn(value: float, change: float, bound: float) -> float:
    """Changed value, held within ±bound."""
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

    With the error e and its rate: ``v_r = v + w e``, ``a_r = a + w e'``, ``s = e' + w e``; each
    parameter changes by ``rate w² J s`` times what it acts on, over the square of that's scale.
    Nothing is learned while the drive is saturated or the setpoint too far for it.
    """
    for i in range(effort.shape[0]):
        inertia, pole, viscous = gains[i, 0], gains[i, 1], gains[i, 2]
        row = memory[i]
        follow_motion(row, setpoint[i], measured[i], gains[i, 3], dt)
        direction = friction_of_setpoint(row, setpoint[i], 1.0, gains[i, 5])
        off = setpoint[i] - measured[i]
        error, share = approach(off, gains[i, 11]), closeness(off, gains[i, 11])
        rate = share * row[4] - row[1]
        speed, acceleration = share * row[4] + pole * error, share * row[5] + pole * rate
        slip = rate + pole * error
        friction = (gains[i, 4] + row[_FRICTION]) * direction
        held = friction + row[_LOAD] + feedforward[i]
        moving = (inertia + row[_INERTIA]) * acceleration + (viscous + row[_VISCOUS]) * speed
        asked = moving + held + 2.0 * pole * inertia * slip
        effort[i] = min(max(asked, -limit[i]), limit[i])
        row[6] = (effort[i] - held - viscous * row[1]) / inertia
        if effort[i] == asked and share == 1.0:
            change = gains[i, 7] * beyond(slip, pole * gains[i, 6]) * dt
            row[_INERTIA] = learn(
                row[_INERTIA], change * acceleration / gains[i, 9] ** 2, gains[i, 10]
            )
            row[_VISCOUS] = learn(row[_VISCOUS], change * speed / gains[i, 8] ** 2, viscous)
            row[_FRICTION] = learn(row[_FRICTION], change * direction, gains[i, 4])
            row[_LOAD] = learn(row[_LOAD], change, limit[i])


def adaptive_gains(parameters: AdaptiveParameters, robot: Robot, viscous: Array) -> Array:
    """Table (n, 12) of what is known of each joint, and of how it learns.

    Columns: inertia, pole, viscous friction, fading, dry friction, its travel, dead band, rate of
    load, scales of speed and acceleration (limits of the drive), bound of the inertia,
    linear range.

    Raises:
        ParameterError: The list has another length than the robot has joints.
    """
    p = parameters
    drives, pole = drives_and_poles(robot, "adaptive", p.bandwidth)
    fading = fading_of(robot, pole, p.filter_ratio, stiffness=3.0, damping=3.0)
    friction, count = p.friction_share * known_friction(robot), drives.encoder_step
    columns = (
        drives.inertia, pole, viscous, fading, friction, p.friction_counts * count,
        p.dead_band * count, p.rate * pole**2 * drives.inertia, drives.speed_limit,
        drives.effort_limit / drives.inertia, p.span * drives.inertia,
        linear_range(robot, pole, 3.0),
    )  # fmt: skip
    return np.stack(columns, axis=1)


ADAPTIVE = Controller(
    "adaptive", AdaptiveParameters, adaptive_gains, adaptive_control, MEMORY + 4, *holding(_LOAD)
)
