"""Jitter: packets have random delays, drawn for each packet or for many successive packets."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.coupling.network import Network
from teleop_core.kernels import Array, kernel


@dataclass(frozen=True, kw_only=True)
class JitterParameters:
    """Delay beyond the least delay: its mean for most packets, and another mean for slow packets."""

    mean: float = parameter(
        0.02, Within(0.0, 5.0, "s"), "mean delay of most packets; delays are exponentially distributed"
    )
    slow_mean: float = parameter(0.05, Within(0.0, 5.0, "s"), "mean delay of slow packets")
    slow_share: float = parameter(0.0, Within(0.0, 1.0), "share of packets that are slow")
    hold: float = parameter(
        0.0,
        Within(0.0, 60.0, "s"),
        "mean time for which the delay stays constant; 0: every packet has its own delay, so that "
        "packets can overtake each other",
    )


@kernel
def jitter_draw(numbers: Array, memory: Array, chances: Array, now: float) -> float:
    """Delay beyond the least delay [s]: a new random delay, or the delay of the last packet.

    ``memory`` contains the delay, the time at which the last packet was sent, and whether there was a packet.
    """
    held = memory[2] > 0.0 and numbers[3] > 0.0
    if held and chances[0] < math.exp(-(now - memory[1]) / numbers[3]):
        memory[1] = now
        return memory[0]
    mean = numbers[1] if chances[1] < numbers[2] else numbers[0]
    memory[0], memory[1], memory[2] = -mean * math.log(1.0 - chances[2]), now, 1.0
    return memory[0]


JITTER = Network("jitter", JitterParameters, jitter_draw)
