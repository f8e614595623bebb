"""Constant: every packet takes the least time."""

from teleop_core.base import NoParameters
from teleop_core.coupling.network import Network
from teleop_core.kernels import Array, kernel


@kernel
def constant_draw(numbers: Array, memory: Array, chances: Array, now: float) -> float:
    """No time beside the least one [s]."""
    return 0.0


CONSTANT = Network("constant", NoParameters, constant_draw)
