"""Drives of the SCARA + Stewart hybrid: nine actuators, all *assumed*; none are published."""

import numpy as np

from teleop_core.robots.drives import ENTRIES, Drives

# Two joints of a small SCARA with their links, a vertical slide, and six electric cylinders. The weight of the slide
# and of the tool is balanced.
DRIVES = Drives(
    inertia=np.array([1.5, 0.6, 10.0, *[2.0] * 6]),
    viscous=np.array([2.0, 1.0, 40.0, *[20.0] * 6]),
    coulomb=np.array([0.5, 0.3, 2.0, *[0.8] * 6]),
    friction_speed=np.array([2e-3, 2e-3, 5e-4, *[5e-4] * 6]),
    effort_limit=np.array([90.0, 45.0, 250.0, *[80.0] * 6]),
    speed_limit=np.array([3.0, 4.0, 0.4, *[0.3] * 6]),
    encoder_step=np.array([1e-5, 1e-5, 1e-6, *[1e-6] * 6]),
    bandwidth=np.array([60.0, 60.0, 60.0, *[80.0] * 6]),
    assumed=ENTRIES,
)
