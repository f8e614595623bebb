"""Transmission: both ports of the whole chain in virtual time, and the values from theory."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from teleop_core.coupling.architectures.four_channel import FourChannelParameters
from teleop_core.coupling.architectures.impedance import ImpedanceParameters
from teleop_core.coupling.architectures.position_position import PositionPositionParameters
from teleop_core.coupling.architectures.three_channel import ThreeChannelParameters
from teleop_core.graph.signals import DT
from teleop_core.kernels.geometry import Array
from teleop_lab.experiments.bench import Bench, Settings
from teleop_lab.experiments.two_port import Complex, Ports, S, excitation, hybrid_matrix

AIR = "air"
WORLDS = (AIR, "tissue", "silicone")
"""Names of the worlds: no object, and two materials of the chain."""
_BACK = 2.0 * DT  # delay of a force by the stages [s]: one tick before the network, and one tick before the mapping
# The arm gets ready, the hand approaches, transients decay for one period, and one period is measured.
_SECONDS = 24.0  # [s]
_MIDDLE = (0.0, -0.014, 0.02)  # middle of the hand's motion [m], 3 mm inside the object of palpation
_TICK: Complex = np.exp(-DT * S)

Way = tuple[str, str]
"""Name of the architecture (or ``impedance``), and name of the passivity."""
Job = tuple[Way, float, str]
"""Architecture with passivity, round-trip delay [s] and world."""


class Channels(NamedTuple):
    """Signals that a chain transmits, in addition to the hand's position.

    Attributes:
        force: Force at the hand divided by the force on the tip.
        stiffness: Force at the hand divided by the lag of the tip [N/m].
        hand: Force that commands the slave, divided by the hand's force.
        yields: Whether the slave has its stage ``impedance``.
        architecture: Name of the architecture in a session; empty if it is equal to the key of :data:`CHANNELS`.
    """

    force: float = 0.0
    stiffness: float = 0.0
    hand: float = 0.0
    yields: bool = False
    architecture: str = ""

    @property
    def stages(self) -> tuple[str, ...]:
        """Stages of a session in addition to those that every chain contains."""
        return ("impedance",) if self.yields else ()


_THREE, _FOUR = ThreeChannelParameters(), FourChannelParameters()
CHANNELS = {
    "unilateral": Channels(),
    "position_force": Channels(1.0),
    "position_position": Channels(0.0, PositionPositionParameters().stiffness),
    "impedance": Channels(1.0, yields=True, architecture="position_force"),
    "three_channel": Channels(_THREE.force_gain, _THREE.stiffness, yields=True),
    "four_channel": Channels(_FOUR.force_gain, _FOUR.stiffness, _FOUR.hand_gain, yields=True),
}
"""Channels of each architecture with default parameters. ``impedance`` is position-force with a slave that yields."""


class Cell(NamedTuple):
    """Measurement of an architecture with a passivity and a round trip.

    Attributes:
        ports: Measured ports by world.
        hybrid: Hybrid matrix (L, 2, 2) that fits the ports of all worlds.
        stray: Largest share of a force that lies outside of the spectral lines.
    """

    ports: Mapping[str, Ports]
    hybrid: Complex
    stray: float

    @classmethod
    def of(cls, ports: Mapping[str, Ports]) -> "Cell":
        """Return the cell of the ports of at least two worlds."""
        found = ports.values()
        return cls(ports, hybrid_matrix(list(found)), max(each.stray for each in found))


def _motion(times: Array) -> Array:
    share, way = excitation(times)
    place = np.multiply.outer(share, np.array(_MIDDLE))
    place[:, 1] += way
    return place


def far_settings(round_trip: float) -> Settings:
    """Parameters of a network with a round-trip delay [s], half in each direction, without gimbal noise."""
    return {
        "network.there.least_delay": 0.5 * round_trip,
        "network.back.least_delay": 0.5 * round_trip,
        "feedback_timeout": 1.0,
        "reach_force.is_on": False,
        "gimbal_noise": 0.0,
    }


def settings(way: Way, round_trip: float, world: str) -> Settings:
    """Parameters of a session with a stiff hand and an ideal device.

    Args:
        way: Architecture and passivity.
        round_trip: Round-trip delay [s], half in each direction.
        world: One of :data:`WORLDS`, or another material.
    """
    architecture, passivity = way
    channels = CHANNELS[architecture]
    touched = {"world": "empty"} if world == AIR else {"world.material": world}
    return {
        "stages": ("network", *channels.stages, "passivity"),
        **far_settings(round_trip), **touched, "coarse_gain": 1.0,
        "reflection.architecture": channels.architecture or architecture,
        "reflection.passivity": passivity,
        "reflection.max_force": 10.0, "tremor_amplitude": 0.0, "device.friction": 0.0,
        "device.position_resolution": 0.0, "device.stiffness": (1e6,) * 3,
        "device.peak_force": 50.0, "device.continuous_force": 50.0, "device.apparent_mass": 0.01,
        "hand.mass": 0.01, "hand.stiffness": 5000.0, "hand.damping": 40.0,
    }  # fmt: skip


def measure_ports(bench: Bench, job: Job) -> Ports:
    """Measure both ports in a session of the whole chain, along the normal of the object.

    Args:
        bench: Bench on which the sessions run.
        job: Architecture with passivity, round-trip delay [s] and world.
    """
    rows = bench.signals("palpation", _SECONDS, settings(*job), _motion)
    return Ports.of(
        rows["master_measured_cp"][:, 1],
        rows["master_servo_cf"][:, 1],
        rows["slave_measured_cp"][:, 2],
        rows["slave_measured_cf"][:, 2],
    )


def measure_cells(
    bench: Bench, cells: Iterable[tuple[Way, float]], worlds: Iterable[str] = WORLDS
) -> dict[tuple[Way, float], Cell]:
    """Measure all worlds; the results are by architecture with passivity and by round-trip delay [s]."""
    wanted, every = list(cells), tuple(worlds)
    found = iter(bench.map(measure_ports, [(*cell, world) for cell in wanted for world in every]))
    return {cell: Cell.of({world: next(found) for world in every}) for cell in wanted}


def predicted_hybrid(arm: Complex, architecture: str, round_trip: float) -> Complex:
    """Predict the hybrid matrix (L, 2, 2) of an architecture without passivity from the motion of the arm alone.

    The arm follows its command with T and yields with Y. Its command is the hand's position plus the stage's
    admittance A times (hand's force minus force on the tip). Both exchanges contain the delays::

        v_tip  = T (v_hand + s A (g f_hand - f_tip)) - Y f_tip
        f_hand = k f_tip + K/s (v_hand - v_tip)

    Args:
        arm: Hybrid matrix of position-force without delay; only the row of the arm's motion is used.
        architecture: One of :data:`CHANNELS`.
        round_trip: Round-trip delay [s], half in each direction.

    Source:
        Lawrence 1993, general four-channel architecture, for a slave that is an admittance as in
        Hashtrudi-Zaad and Salcudean 2001; without the dampers of position channels.
    """
    there, back = np.exp(-0.5 * round_trip * S), np.exp(-(0.5 * round_trip + _BACK) * S)
    channels, follows = CHANNELS[architecture], -arm[:, 1, 0]
    spring = channels.stiffness / S
    yields = follows * S * _admittance() if channels.yields else 0.0 * S
    by_hand = there * yields * channels.hand
    loop = 1.0 + by_hand * spring * back
    matrix = np.empty_like(arm)
    matrix[:, 1, 0] = -(follows * there + by_hand * spring) / loop
    matrix[:, 1, 1] = (arm[:, 1, 1] + yields * _TICK - by_hand * channels.force * back) / loop
    matrix[:, 0, 0] = spring * (1.0 + matrix[:, 1, 0] * back)
    matrix[:, 0, 1] = back * (channels.force + spring * matrix[:, 1, 1])
    return matrix


def _admittance() -> Complex:
    """Displacement divided by force (L,) [m/N] of the stage ``impedance``, discretized by backward differences."""
    own, rate = ImpedanceParameters(), (1.0 - _TICK) / DT
    return 1.0 / ((own.mass * rate + own.damping) * rate + own.stiffness)
