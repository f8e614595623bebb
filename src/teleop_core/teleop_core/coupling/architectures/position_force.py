"""Position-force: the slave gets the hand's position, the hand gets the force on the slave's tip."""

from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.coupling.architectures import Architecture
from teleop_core.kernels import Array, kernel


@dataclass(frozen=True, kw_only=True)
class PositionForceParameters:
    """Gain of the force at the hand."""

    force_gain: float = parameter(1.0, Within(0.0, 10.0, "N/N"), "force at the hand, divided by slave/measured_cf")


@kernel
def position_force_push(numbers: Array, memory: Array, felt: Array, away: Array, period: float, out: Array) -> None:
    """Write the push (3,) [N]: the force on the tip times the gain.

    Source:
        Lawrence 1993, position-force.
    """
    for i in range(3):
        out[i] = numbers[0] * felt[i]


def force_scale(parameters: PositionForceParameters) -> float:
    """Force at the hand, divided by the force on the tip; > 0."""
    return max(parameters.force_gain, 1e-3)


POSITION_FORCE = Architecture("position_force", PositionForceParameters, position_force_push, force_scale=force_scale)
