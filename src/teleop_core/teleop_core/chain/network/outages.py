"""Outages: at times nothing passes."""

from dataclasses import dataclass

from teleop_core.base.parameters import parameter
from teleop_core.chain.network import LOST, Network
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array

_LEVEL = "published: UVA-DSA telesurgery QoS analysis 2026, the first level of outages"


@dataclass(frozen=True, kw_only=True)
class OutagesParameters:
    """How often nothing passes, and for how long at most."""

    period: float = parameter(
        8.5, unit="s", lower=1e-3, upper=3600.0, doc="from one outage to the next", source=_LEVEL
    )
    longest: float = parameter(
        3.0, unit="s", lower=0.0, upper=3600.0, source=_LEVEL,
        doc="longest outage; each lasts for any time up to it",
    )  # fmt: skip


@kernel
def outages_draw(numbers: Array, memory: Array, chances: Array, now: float) -> float:
    """Nothing beside the least time, or lost.

    ``memory`` holds when the next outage begins [s], and when the present one ends.
    """
    if memory[0] == 0.0:
        memory[0] = now + numbers[0]
    if now >= memory[0]:
        memory[0] += numbers[0]
        memory[1] = now + chances[0] * numbers[1]
    return LOST if now < memory[1] else 0.0


OUTAGES = Network("outages", OutagesParameters, outages_draw)
