"""Three channels: the hand gets force and position of the slave, which yields to its own force.

The slave gets the hand's position, and its stage ``impedance`` gets the force on the slave's tip.
"""

from dataclasses import dataclass

from teleop_core.coupling.architectures import Architecture
from teleop_core.coupling.architectures.position_force import PositionForceParameters, force_scale
from teleop_core.coupling.architectures.position_position import PositionPositionParameters
from teleop_core.kernels import Array, kernel


@dataclass(frozen=True, kw_only=True)
class ThreeChannelParameters(PositionPositionParameters, PositionForceParameters):
    """Gains of the slave's force and position to the hand."""


@kernel
def channels_push(numbers: Array, memory: Array, felt: Array, away: Array, period: float, out: Array) -> None:
    """Write the push (3,) [N]: the force on the tip times its gain, and a spring towards the tip.

    Source:
        Lawrence 1993, channels of force and position back to the hand, without a damper.
    """
    for i in range(3):
        out[i] = numbers[0] * felt[i] + numbers[1] * away[i]


THREE_CHANNEL = Architecture(
    "three_channel", ThreeChannelParameters, channels_push, force_scale=force_scale, needs_impedance=True
)
