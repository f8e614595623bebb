"""Four channels: positions and forces are sent in both directions; the slave yields to the difference of the forces."""

from dataclasses import dataclass

from teleop_core.base.parameters import Within, parameter
from teleop_core.coupling.architectures import Architecture
from teleop_core.coupling.architectures.position_force import force_scale
from teleop_core.coupling.architectures.three_channel import ThreeChannelParameters, channels_push


@dataclass(frozen=True, kw_only=True)
class FourChannelParameters(ThreeChannelParameters):
    """Gains of the channels between hand and slave."""

    hand_gain: float = parameter(
        1.0,
        Within(0.0, 10.0, "N/N"),
        "force that moves the slave, divided by the hand's force; with 1/force_gain a constant press "
        "does not move the tip away from its command",
    )


def _lead(parameters: FourChannelParameters) -> float:
    return parameters.hand_gain


FOUR_CHANNEL = Architecture(
    "four_channel", FourChannelParameters, channels_push, force_scale=force_scale, lead_gain=_lead, needs_impedance=True
)
