"""Follow: keep the tip near a point with unpredictable motion, as in tests of pilots."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.hand.tasks import Task, attempts
from teleop_core.kernels import Array, kernel

# Cycles per period, three for each of y and z: prime numbers, so that the motion does not repeat within a period.
_ROUNDS = (2, 5, 11, 3, 7, 13)


@dataclass(frozen=True, kw_only=True)
class FollowParameters(attempts.LedParameters):
    """A point that moves in the slave's y-z plane, around the start of the task.

    Source:
        Sums of sines as targets: McRuer and Jex 1967, IEEE Trans. Human Factors in Electronics 8.
    """

    size: float = parameter(
        0.02, Within(1e-3, 0.5, "m"), "largest distance of the goal from the start of the task, along each axis"
    )
    period: float = parameter(60.0, Within(1.0, 3600.0, "s"), "period after which the path of the goal repeats itself")


@kernel
def follow_judge(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Move the goal, and count at each step whether the tip is near the goal.

    Of the three sines of an axis, the faster ones have smaller amplitudes.
    """
    angle, y, z = 2.0 * math.pi * scene[0] / numbers[3], 0.0, 0.0
    for i in range(3):
        share = numbers[2] * (0.5, 0.3, 0.2)[i]
        y += share * math.sin(_ROUNDS[i] * angle)
        z += share * math.sin(_ROUNDS[3 + i] * angle)
    attempts.lead_on(numbers, memory, scene, state, y, z)


FOLLOW = Task("follow", FollowParameters, follow_judge)
