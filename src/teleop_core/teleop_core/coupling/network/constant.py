"""Constant: every packet has the least delay."""

from teleop_core.base import NoParameters
from teleop_core.coupling.network import Network
from teleop_core.kernels import Array, kernel


@kernel
def constant_draw(numbers: Array, memory: Array, chances: Array, now: float) -> float:
    """Return 0: no delay beyond the least delay [s]."""
    return 0.0


CONSTANT = Network("constant", NoParameters, constant_draw)
