"""Unilateral: the slave gets the hand's position, and the hand gets no force."""

from teleop_core.base import NoParameters
from teleop_core.coupling.architectures import Architecture
from teleop_core.kernels import Array, kernel


@kernel
def unilateral_push(numbers: Array, memory: Array, felt: Array, away: Array, period: float, out: Array) -> None:
    """Write a zero push (3,) [N]."""
    for i in range(3):
        out[i] = 0.0


UNILATERAL = Architecture("unilateral", NoParameters, unilateral_push)
