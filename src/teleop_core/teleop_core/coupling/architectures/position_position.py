"""Position-position: a spring between the commanded and the measured position of the slave's tip."""

from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.coupling.architectures import Architecture
from teleop_core.kernels import Array, kernel


@dataclass(frozen=True, kw_only=True)
class PositionPositionParameters:
    """Stiffness of the spring that the hand feels."""

    stiffness: float = parameter(
        150.0,
        Within(0.0, 5000.0, "N/m"),
        "force at the hand, divided by the distance from its command to slave/measured_cp",
        source="assumed: half of the stiffness of a medium grip, so that no delay makes the force throw the hand",
    )


@kernel
def position_position_push(numbers: Array, memory: Array, felt: Array, away: Array, period: float, out: Array) -> None:
    """Write the push (3,) [N]: a spring towards the measured tip position.

    Source:
        Lawrence 1993, position-position, without its damper.
    """
    for i in range(3):
        out[i] = numbers[0] * away[i]


POSITION_POSITION = Architecture("position_position", PositionPositionParameters, position_position_push)
