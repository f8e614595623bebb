"""Assumed drives for robots whose sources publish none."""

import numpy as np

from teleop_core.robots.drives import ENTRIES, Drives


def _alike(
    count: int,
    inertia: float,
    viscous: float,
    coulomb: float,
    friction_speed: float,
    effort_limit: float,
    speed_limit: float,
    encoder_step: float,
    bandwidth: float,
) -> Drives:
    return Drives(
        inertia=np.full(count, inertia),
        viscous=np.full(count, viscous),
        coulomb=np.full(count, coulomb),
        friction_speed=np.full(count, friction_speed),
        effort_limit=np.full(count, effort_limit),
        speed_limit=np.full(count, speed_limit),
        encoder_step=np.full(count, encoder_step),
        bandwidth=np.full(count, bandwidth),
        assumed=ENTRIES,
    )


def electric_cylinders(count: int, speed_limit: float = 0.3) -> Drives:
    """Drives of the legs of a parallel robot; each moves 2 kg of motor and load [N, m, s]."""
    return _alike(count, 2.0, 20.0, 0.8, 5e-4, 80.0, speed_limit, 1e-6, 80.0)


def geared_motors(count: int) -> Drives:
    """Drives of the cranks of a bench mechanism of a few hundred millimetres [N·m, rad, s]."""
    return _alike(count, 0.02, 0.05, 0.01, 2e-3, 2.0, 3.0, 1e-5, 60.0)


def finger_motors(count: int) -> Drives:
    """Drives of the nine joints of a small hand [N·m, rad, s]."""
    return _alike(count, 2e-4, 1e-3, 5e-4, 1e-2, 0.05, 6.0, 1e-4, 80.0)
