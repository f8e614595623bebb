"""Presets of the network, some of them measured, and its parameters: two directions, each with a kind of network."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from teleop_core.base.parameters import Choice, Within, build, choice, fixed, parameter
from teleop_core.base.ranges import LONGEST_DELAY
from teleop_core.coupling.network import NETWORKS, link
from teleop_core.coupling.network.deadband import DeadbandParameters

_QOS = "UVA-DSA telesurgery QoS analysis 2026"


def _bursts(good: tuple[float, float], bad: tuple[float, float]) -> dict[str, Any]:
    lost = {"kind": "gilbert_elliott", "gilbert_elliott.good": good, "gilbert_elliott.bad": bad}
    return {"there": lost, "back": {}}


def _delays(least: float, mean: float, slow_mean: float, slow_share: float) -> dict[str, Any]:
    late = {
        "kind": "jitter",
        "least_delay": least,
        "jitter.mean": mean,
        "jitter.slow_mean": slow_mean,
        "jitter.slow_share": slow_share,
    }
    return {"there": late, "back": {}}


def _outages(pause: float, longest: float, packet_rate: float = 0.0) -> dict[str, Any]:
    """Parameters of outages, in seconds, or in packets if a ``packet_rate`` is given."""
    gone = {"kind": "outages", "outages.pause": pause, "outages.longest": longest}
    if packet_rate > 0.0:
        gone |= {"outages.in_packets": True, "packet_rate": packet_rate}
    return {"there": gone, "back": {}}


def _far(least: float, mean: float) -> dict[str, Any]:
    far = {"kind": "jitter", "least_delay": least, "jitter.mean": mean, "jitter.hold": 1.0}
    return {"there": far, "back": far}


PRESETS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "loss_10": _bursts((4.428, 1.638), (4.966, 0.271)),
    "loss_30": _bursts((4.604, 3.552), (3.901, 1.466)),
    "loss_50": _bursts((3.859, 3.324), (3.797, 6.049)),
    "delay_100": _delays(0.070, 1e-3 / 0.0271, 1e-3 / 0.0853, 0.274),
    "delay_300": _delays(0.210, 1e-3 / 0.0108, 1e-3 / 0.0162, 0.107),
    "delay_500": _delays(0.406, 1e-3 / 0.0102, 1e-3 / 0.0155, 0.104),
    "outages_3_of_8": _outages(8.5, 3.0),
    "outages_1_of_1": _outages(1.0, 1.0),
    "outages_2_of_1": _outages(1.0, 2.0),
    "outages_3_of_8_packets": _outages(8500.0, 3000.0, 517.0),
    "outages_1_of_1_packets": _outages(1000.0, 1000.0, 517.0),
    "outages_2_of_1_packets": _outages(1000.0, 2000.0, 517.0),
    "iss": _far(0.4, 0.05),
    "ets7": _far(3.4, 0.1),
}
"""Networks by name. Levels of loss, delay and outages are the nine levels of the UVA-DSA telesurgery QoS analysis 2026;
they affect only packets to the slave. The table of that analysis gives outages in milliseconds, but its program counts
packets (``_packets``); its recording has 517 packets a second. ``iss`` has a round trip of 0.8 to 1 s, ``ets7`` of 7 s
(ETS-VII 1999); the variation of these two delays is assumed."""


@dataclass(frozen=True, kw_only=True)
class WayParameters:
    """One direction of the network."""

    kind: Choice = choice(NETWORKS, "constant", doc="law by which packets are delayed and lost")
    least_delay: float = parameter(0.0, Within(0.0, LONGEST_DELAY, "s"), "smallest delay of a packet")
    loss: float = parameter(0.0, Within(0.0, 1.0), "share of packets that are lost, each independently of the others")
    packet_order: str = parameter(
        "newest",
        choices=("newest", "kept"),
        doc="newest: a packet that a newer packet has overtaken is dropped; kept: packets behind a "
        "late packet wait for it",
    )
    packet_rate: float = parameter(1000.0, Within(1.0, 1e6, "Hz"), "largest number of packets sent per second")
    bandwidth: float = parameter(
        0.0, Within(0.0, 1e12, "bit/s"), "bandwidth of the line; packets wait while the line is busy; 0: no limit"
    )
    queue: int = parameter(
        100,
        Within(1, link.QUEUE),
        "largest number of packets that wait for the line; one packet more drops the oldest of them, "
        "or is dropped itself if packet_order is kept",
        source="assumed",
    )


@dataclass(frozen=True, kw_only=True)
class NetworkParameters:
    """Parameters of :class:`~teleop_core.coupling.network.network.NetworkLink`."""

    seed: int = fixed(1, Within(0), "seed of everything random in the session")
    preset: str = parameter(
        "own",
        choices=("own", *PRESETS),
        doc="measured network whose values replace the parameters of both directions; own: the parameters are used",
        source=f"published: {_QOS} for all but iss and ets7, which are assumed",
    )
    commands: str = parameter(
        "absolute",
        choices=("absolute", "incremental"),
        doc="content of a packet to the slave: absolute: the pose of the tip; incremental: its "
        "motion since the last packet, so that a lost packet is lost motion",
    )
    clock_offset: float = parameter(
        0.0, Within(-3600.0, 3600.0, "s"), "time of the slave's clock minus that of the master's clock, at the start"
    )
    clock_drift: float = parameter(
        0.0, Within(-1000.0, 1000.0, "ppm"), "rate of the slave's clock relative to the master's clock"
    )
    deadband: DeadbandParameters = field(default_factory=DeadbandParameters)
    there: WayParameters = field(default_factory=WayParameters)
    back: WayParameters = field(default_factory=WayParameters)

    @property
    def ways(self) -> tuple[WayParameters, WayParameters]:
        """Parameters of the directions to and from the slave: from the preset, or else the given ones."""
        if self.preset == "own":
            return self.there, self.back
        named = PRESETS[self.preset]
        return build(WayParameters, named["there"]), build(WayParameters, named["back"])
