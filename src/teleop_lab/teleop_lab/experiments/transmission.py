"""Transmission: both ports of the whole chain in virtual time, and what theory says of them."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from teleop_core.chain.architectures.position_position import PositionPositionParameters
from teleop_core.graph.signals import DT
from teleop_core.kernels.geometry import Array
from teleop_lab.experiments.bench import Bench, Settings
from teleop_lab.experiments.two_port import Complex, Ports, S, excitation, hybrid_matrix

AIR = "air"
WORLDS = (AIR, "tissue", "silicone")
"""Nothing to touch, and two of the chain's materials."""
_BACK = 2.0 * DT  # a force waits for a tick before the network and for one before the mapping
_SECONDS = 24.0  # the arm gets ready, the hand approaches, one period swings in
_MIDDLE = (0.0, -0.014, 0.02)  # of the hand's way [m], 3 mm within the object of palpation
_STIFFNESS = PositionPositionParameters().stiffness

Way = tuple[str, str]
"""Architecture and passivity."""
Job = tuple[Way, float, str]
"""Way, round trip [s] and world."""


class Cell(NamedTuple):
    """What was measured of an architecture with a passivity over a round trip.

    Attributes:
        ports: By world.
        hybrid: Hybrid matrix (L, 2, 2) of all worlds together.
        stray: Largest share of a force that is off the lines.
    """

    ports: Mapping[str, Ports]
    hybrid: Complex
    stray: float

    @classmethod
    def of(cls, ports: Mapping[str, Ports]) -> "Cell":
        """The cell of at least two worlds."""
        found = ports.values()
        return cls(ports, hybrid_matrix(list(found)), max(each.stray for each in found))


def _motion(times: Array) -> Array:
    share, way = excitation(times)
    place = np.multiply.outer(share, np.array(_MIDDLE))
    place[:, 1] += way
    return place


def settings(way: Way, round_trip: float, world: str) -> Settings:
    """Parameters of a session in which hand and device are firm and without faults.

    Args:
        way: Architecture and passivity.
        round_trip: Half of it each way [s].
        world: One of :data:`WORLDS`, or another material.
    """
    architecture, passivity = way
    touched = {"world": "empty"} if world == AIR else {"world.material": world}
    return {
        "stages": ("network", "passivity"), **touched, "coarse_gain": 1.0,
        "reflection.architecture": architecture, "reflection.passivity": passivity,
        "network.there.least_delay": 0.5 * round_trip,
        "network.back.least_delay": 0.5 * round_trip,
        "reflection.max_force": 10.0, "feedback_timeout": 1.0, "reach_force.is_on": False,
        "tremor_amplitude": 0.0, "gimbal_noise": 0.0, "device.friction": 0.0,
        "device.position_resolution": 0.0, "device.stiffness": (1e6,) * 3,
        "device.peak_force": 50.0, "device.continuous_force": 50.0, "device.apparent_mass": 0.01,
        "hand.mass": 0.01, "hand.stiffness": 5000.0, "hand.damping": 40.0,
    }  # fmt: skip


def measure_ports(bench: Bench, job: Job) -> Ports:
    """Both ports in a session of the whole chain, along the normal of the object.

    Args:
        bench: Where it runs.
        job: Way, round trip [s] and world.
    """
    rows = bench.signals("palpation", _SECONDS, settings(*job), _motion)
    return Ports.of(
        rows["master_measured_cp"][:, 1], rows["master_servo_cf"][:, 1],
        rows["slave_measured_cp"][:, 2], rows["slave_measured_cf"][:, 2],
    )  # fmt: skip


def measure_cells(
    bench: Bench, cells: Iterable[tuple[Way, float]], worlds: Iterable[str] = WORLDS
) -> dict[tuple[Way, float], Cell]:
    """Cells by way and round trip [s], each in all worlds."""
    wanted, every = list(cells), tuple(worlds)
    found = iter(bench.map(measure_ports, [(*cell, world) for cell in wanted for world in every]))
    return {cell: Cell.of({world: next(found) for world in every}) for cell in wanted}


def predicted_hybrid(arm: Complex, architecture: str, round_trip: float) -> Complex:
    """Hybrid matrix (L, 2, 2) of an architecture without passivity, of how the arm moves alone.

    Args:
        arm: Hybrid matrix without a round trip, of which the arm's row is taken.
        architecture: ``position_force``, or ``position_position`` with its default spring.
        round_trip: Half of it each way [s].

    Source:
        Lawrence 1993, both architectures; position-position without its damper.
    """
    there, back = np.exp(-0.5 * round_trip * S), np.exp(-(0.5 * round_trip + _BACK) * S)
    matrix = np.zeros_like(arm)
    matrix[:, 1, 0], matrix[:, 1, 1] = arm[:, 1, 0] * there, arm[:, 1, 1]
    if architecture == "position_force":
        matrix[:, 0, 1] = back
    else:
        matrix[:, 0, 0] = _STIFFNESS / S * (1.0 + matrix[:, 1, 0] * back)
        matrix[:, 0, 1] = _STIFFNESS / S * back * matrix[:, 1, 1]
    return matrix
