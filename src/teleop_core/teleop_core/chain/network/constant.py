"""Constant: every packet takes the least time."""

from teleop_core.base.parameters import NoParameters
from teleop_core.chain.network import Network
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array


@kernel
def constant_draw(numbers: Array, memory: Array, chances: Array, now: float) -> float:
    """No time beside the least one [s]."""
    return 0.0


CONSTANT = Network("constant", NoParameters, constant_draw)
