"""Ideal plant: smooth friction, and drives and links as drawn; it shows the best that a control law can do."""

import numpy as np

from teleop_core.base.parameters import NoParameters
from teleop_core.robots.robot import Robot
from teleop_core.slave.plants import Physics, Plant


def ideal_physics(parameters: NoParameters, robot: Robot) -> Physics:
    """Numbers of the drive table alone."""
    drives, zero = robot.drives, np.zeros(robot.n)
    assert drives is not None
    return Physics(
        viscous=drives.viscous,
        coulomb=drives.coulomb,
        friction_speed=drives.friction_speed,
        bristle=zero,
        wander=zero,
        wander_travel=np.ones(robot.n),
        bias=zero,
        effort_step=zero,
        encoder_step=drives.encoder_step,
        play=zero,
        coupling=np.zeros((robot.n, robot.n)),
        tip_geometry=np.zeros(0),
        dynamics=np.zeros(0),
    )


IDEAL = Plant("ideal", NoParameters, ideal_physics)
