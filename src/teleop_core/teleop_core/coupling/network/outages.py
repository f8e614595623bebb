"""Outages: periods in which all packets are lost."""

from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.coupling.network import LOST, Network
from teleop_core.kernels import Array, kernel

_LEVEL = "published: UVA-DSA telesurgery QoS analysis 2026, the first level of outages"


@dataclass(frozen=True, kw_only=True)
class OutagesParameters:
    """Length of the pauses between outages, and largest length of an outage.

    In the long run the share ``longest / (longest + 2 pause)`` of the packets is lost.
    """

    pause: float = parameter(
        8.5,
        Within(1e-3, 1e6, "s"),
        "time from the end of an outage to the beginning of the next; with in_packets, a number of packets",
        source=_LEVEL,
    )
    longest: float = parameter(
        3.0,
        Within(0.0, 1e6, "s"),
        "longest outage; each outage has a random duration up to it; with in_packets, a number of packets",
        source=_LEVEL,
    )
    in_packets: bool = parameter(False, doc="whether pause and longest are numbers of sent packets instead of seconds")


@kernel
def outages_draw(numbers: Array, memory: Array, chances: Array, now: float) -> float:
    """Return 0, no delay beyond the least delay, or :data:`LOST`.

    The first packet begins an outage. The packet that begins an outage is lost. The first packet at or after the end of
    the outage arrives, and begins the pause (NetFI's communication loss).

    ``memory`` contains the end of the outage or pause [s or packets], whether it is an outage, and the number of
    earlier packets.
    """
    at = memory[2] if numbers[2] > 0.0 else now
    memory[2] += 1.0
    if memory[2] == 1.0 or at >= memory[0]:
        memory[1] = 1.0 - memory[1]
        memory[0] = at + (chances[0] * numbers[1] if memory[1] > 0.0 else numbers[0])
    return LOST if memory[1] > 0.0 else 0.0


OUTAGES = Network("outages", OutagesParameters, outages_draw)
