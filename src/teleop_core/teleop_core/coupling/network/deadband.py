"""Deadband: a packet is sent when its values differ enough from those of the last packet.

The hand does not feel a force change smaller than a share of the force (Weber's law), so such a change need not be
sent. The receiver keeps the values of the last packet. After ``longest_pause`` a packet is sent in any case. So a
receiver that gets no packets knows that the other side is gone.

Source:
    Perception-based deadband coding, Hinterseer, Hirche, Chaudhuri, Steinbach and Buss 2008; the idea of the codec of
    IEEE 1918.1.1. Here positions have an absolute deadband.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from teleop_core.base import Within, parameter
from teleop_core.coupling.network.link import LinkState
from teleop_core.kernels import Array, Fields, inner


class DeadbandState(LinkState):
    """Fields of a state record with the values of the last packets."""

    told_pose: Annotated[Array, 2, 7]  # last sent poses of both directions
    told_force: Annotated[Array, 2, 3]  # [N]


@dataclass(frozen=True, kw_only=True)
class DeadbandParameters:
    """Changes of position, rotation and force after which a packet is sent; a single one of these changes is enough."""

    is_on: bool = parameter(False, doc="whether a packet is sent only if its content has changed")
    place: float = parameter(2e-4, Within(0.0, 0.1, "m"), "distance that the tip must move before a packet is sent")
    turn: float = parameter(0.01, Within(0.0, 1.0, "rad"), "angle that the tip must turn before a packet is sent")
    force: float = parameter(
        0.1,
        Within(0.0, 1.0),
        "change of the force, as a share of the last sent force, after which a packet is sent",
        source="assumed: about the smallest change that people feel",
    )
    least_force: float = parameter(
        0.02, Within(0.0, 10.0, "N"), "a smaller change of the force is never sent, even if the force itself is small"
    )
    longest_pause: float = parameter(
        0.02,
        Within(1e-3, 1.0, "s"),
        "time after which a packet is sent even without a change; must be less than command_timeout "
        "and feedback_timeout",
    )


class DeadbandRecord(Fields):
    """Fields of a parameter record with the deadband."""

    deadband: DeadbandParameters
    chord: float  # chord between quaternions
    longest_ticks: int


def derive(p: DeadbandRecord, parameters: DeadbandParameters, dt: float) -> None:
    """Write what follows from the parameters and the tick [s]."""
    p.chord = 2.0 * math.sin(0.25 * parameters.turn)
    p.longest_ticks = max(1, math.floor(parameters.longest_pause / dt + 0.5))


@inner
def is_worth_telling(p: DeadbandRecord, s: DeadbandState, k: int, pose: Array, force: Array) -> bool:
    """Whether a packet of direction ``k`` with this pose (7,) and force (3,) must be sent.

    Args:
        p: Parameters.
        s: State.
        k: Direction.
        pose: Position [m], then quaternion w, x, y, z.
        force: Force [N].
    """
    if p.deadband.is_on == 0 or s.sent[k] == 0 or s.tick - s.sent_tick[k] >= p.longest_ticks:
        return True
    return _has_moved(p, s.told_pose[k], pose) or _has_changed(p, s.told_force[k], force)


@inner
def remember_told(s: DeadbandState, k: int, pose: Array, force: Array) -> None:
    """Store the values of the packet that is sent."""
    for i in range(7):
        s.told_pose[k, i] = pose[i]
    for i in range(force.shape[0]):
        s.told_force[k, i] = force[i]


@inner
def _has_moved(p: DeadbandRecord, told: Array, pose: Array) -> bool:
    """Whether a pose (7,) is outside the deadband around the last sent pose."""
    way = turn = other = 0.0
    for i in range(3):
        way += (pose[i] - told[i]) * (pose[i] - told[i])
    for i in range(3, 7):
        turn += (pose[i] - told[i]) * (pose[i] - told[i])
        other += (pose[i] + told[i]) * (pose[i] + told[i])
    # Squares of the distances to the sent quaternion and to its negative, which describes the same attitude. A distance
    # is twice the sine of a quarter of the rotation angle.
    chord = min(turn, other)
    place = p.deadband.place
    return bool(way > place * place or chord > p.chord * p.chord)


@inner
def _has_changed(p: DeadbandRecord, told: Array, force: Array) -> bool:
    """Whether a force (3,) is outside the deadband around the last sent force."""
    change = before = 0.0
    for i in range(force.shape[0]):
        change += (force[i] - told[i]) * (force[i] - told[i])
        before += told[i] * told[i]
    least = max(p.deadband.force * math.sqrt(before), p.deadband.least_force)
    return bool(change > least * least)
