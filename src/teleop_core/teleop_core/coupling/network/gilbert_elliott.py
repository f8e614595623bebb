"""Gilbert-Elliott: packets are lost in bursts; the bursts are longer in bad periods."""

from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.coupling.network import LOST, Network
from teleop_core.kernels import Array, kernel

_LEVEL = "published: UVA-DSA telesurgery QoS analysis 2026, loss of 10 %"


@dataclass(frozen=True, kw_only=True)
class GilbertElliottParameters:
    """Good and bad periods, which differ in the lengths of bursts of lost packets."""

    to_bad: float = parameter(
        0.05, Within(0.0, 1.0), "probability, at each packet, that a bad period begins", source=_LEVEL
    )
    stay_bad: float = parameter(
        0.9, Within(0.0, 1.0), "probability, at each packet, that a bad period continues", source=_LEVEL
    )
    good: tuple[float, ...] = parameter(
        (4.428, 1.638),
        Within(1e-3, 100.0),
        "shape and scale of the burst length in good periods, a Pareto II distribution, rounded down [packets]",
        length=2,
        source=_LEVEL,
    )
    bad: tuple[float, ...] = parameter(
        (4.966, 0.271),
        Within(1e-3, 100.0),
        "shape and scale of the burst length in bad periods, a Pareto II distribution, rounded down [packets]",
        length=2,
        source=_LEVEL,
    )


@kernel
def gilbert_elliott_draw(numbers: Array, memory: Array, chances: Array, now: float) -> float:
    """Return 0, no delay beyond the least delay, or :data:`LOST`.

    A good or bad period can end at every packet, within bursts too. The packet after a burst is not lost.

    ``memory`` contains the number of packets of the burst that will still be lost, and whether the period is bad.
    """
    border = numbers[1] if memory[1] > 0.0 else numbers[0]
    memory[1] = 1.0 if chances[0] < border else 0.0
    if memory[0] < 1.0:
        at = 4 if memory[1] > 0.0 else 2
        length = numbers[at + 1] * ((1.0 - chances[1]) ** (-1.0 / numbers[at]) - 1.0)
        memory[0] = float(int(min(length, 1e9))) + 1.0  # the burst, and one packet that is not lost
    memory[0] -= 1.0
    return LOST if memory[0] >= 1.0 else 0.0


GILBERT_ELLIOTT = Network("gilbert_elliott", GilbertElliottParameters, gilbert_elliott_draw)
