"""Palpation: sessions of the scenario that presses a block, and forces of the hand along the slave's axes."""

import numpy as np
from numpy.typing import NDArray

from teleop_core.kernels.geometry import Array
from teleop_core.session import configuration, virtual


def pressed(*texts: str, ticks: int = 12_000) -> NDArray[np.void]:
    """Signals of the scenario ``palpation`` with settings."""
    return virtual.VirtualTime(configuration.configure("palpation", settings=[*texts])).run(ticks)


def on_the_slave(force: Array) -> Array:
    """Forces (N, 3) of the hand along the slave's base."""
    return np.column_stack((-force[:, 2], -force[:, 0], force[:, 1]))
