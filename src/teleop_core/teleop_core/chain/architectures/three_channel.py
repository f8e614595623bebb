"""Three channels: the hand gets force and place of the slave, which yields to its own force.

The slave gets the hand's place, and its stage ``impedance`` the force on its own tip.
"""

from dataclasses import dataclass

from teleop_core.base import parameter
from teleop_core.chain.architectures import Architecture
from teleop_core.kernels import Array, kernel


@dataclass(frozen=True, kw_only=True)
class ThreeChannelParameters:
    """What comes back of the slave's force, and of its place."""

    force_gain: float = parameter(
        1.0, unit="N/N", lower=0.0, upper=10.0, doc="force at the hand over slave/measured_cf"
    )
    stiffness: float = parameter(
        150.0,
        unit="N/m",
        lower=0.0,
        upper=5000.0,
        doc="force at the hand over the way from its command to slave/measured_cp",
        source="assumed: that of position_position",
    )


@kernel
def channels_push(numbers: Array, memory: Array, felt: Array, away: Array, period: float, out: Array) -> None:
    """Write the push (3,) [N]: the force on the tip times its gain, and a spring towards the tip.

    Source:
        Lawrence 1993, channels of force and place back to the hand, without a damper.
    """
    for i in range(3):
        out[i] = numbers[0] * felt[i] + numbers[1] * away[i]


def force_gain(parameters: ThreeChannelParameters) -> float:
    """Force at the hand over the one on the tip, above 0."""
    return max(parameters.force_gain, 1e-3)


THREE_CHANNEL = Architecture(
    "three_channel", ThreeChannelParameters, channels_push, force_scale=force_gain, needs_impedance=True
)
