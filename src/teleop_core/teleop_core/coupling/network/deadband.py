"""Deadband: a packet is sent when what it says differs enough from what the last one said.

The hand does not feel a force that changes by less than a share of itself (Weber's law), so such a
change need not travel. The reader keeps the last packet. A packet goes after ``longest_pause`` all
the same, so that who hears nothing may know that the other side is gone.

Source:
    Perception-based deadband coding, Hinterseer, Hirche, Chaudhuri, Steinbach and Buss 2008; the
    idea of the codec of IEEE 1918.1.1. The places have an absolute deadband here.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from teleop_core.base import Within, parameter
from teleop_core.coupling.network.link import LinkState
from teleop_core.kernels import Array, Fields, inner


class DeadbandNumbers(Fields):
    """Fields of a parameter record with the deadband."""

    has_deadband: int
    place: float  # [m]
    chord: float  # between quaternions
    force_share: float
    least_force: float  # [N]
    longest_ticks: int


class DeadbandState(LinkState):
    """Fields of a state record with what the last packets told."""

    told_pose: Annotated[Array, 2, 7]  # of each direction
    told_force: Annotated[Array, 2, 3]  # [N]


@dataclass(frozen=True, kw_only=True)
class DeadbandParameters:
    """What must change before a packet is sent: place, turn or force, whichever does first."""

    is_on: bool = parameter(False, doc="whether packets wait for a change")
    place: float = parameter(2e-4, Within(0.0, 0.1, "m"), "way of the tip before a packet is sent")
    turn: float = parameter(0.01, Within(0.0, 1.0, "rad"), "turn of the tip before a packet is sent")
    force: float = parameter(
        0.1,
        Within(0.0, 1.0),
        "share of the force that was sent last by which it must change",
        source="assumed: about what people feel",
    )
    least_force: float = parameter(
        0.02, Within(0.0, 10.0, "N"), "change of a force that is not sent, however small the force is"
    )
    longest_pause: float = parameter(
        0.02,
        Within(1e-3, 1.0, "s"),
        "time after which a packet is sent though nothing changed; below command_timeout and feedback_timeout",
    )


def take_deadband(p: DeadbandNumbers, parameters: DeadbandParameters, dt: float) -> None:
    """Write the fields of the deadband in a parameter record.

    Args:
        p: Record; written.
        parameters: What they say.
        dt: Tick [s].
    """
    p["has_deadband"] = parameters.is_on
    p["place"], p["force_share"] = parameters.place, parameters.force
    p["chord"] = 2.0 * math.sin(0.25 * parameters.turn)
    p["least_force"] = parameters.least_force
    p["longest_ticks"] = max(1, math.floor(parameters.longest_pause / dt + 0.5))


@inner
def is_worth_telling(p: DeadbandNumbers, s: DeadbandState, k: int, pose: Array, force: Array) -> bool:
    """Whether a packet of direction ``k`` with this pose (7,) and force (3,) is to be sent.

    Args:
        p: Parameters.
        s: State.
        k: Direction.
        pose: Quaternion w, x, y, z behind the place [m].
        force: [N].
    """
    if p.has_deadband == 0 or s.sent[k] == 0 or s.tick - s.sent_tick[k] >= p.longest_ticks:
        return True
    return _has_moved(p, s.told_pose[k], pose) or _has_changed(p, s.told_force[k], force)


@inner
def remember_told(s: DeadbandState, k: int, pose: Array, force: Array) -> None:
    """Keep what the packet says that is sent."""
    for i in range(7):
        s.told_pose[k, i] = pose[i]
    for i in range(force.shape[0]):
        s.told_force[k, i] = force[i]


@inner
def _has_moved(p: DeadbandNumbers, told: Array, pose: Array) -> bool:
    """Whether a pose (7,) is beyond the deadband around the one that was told."""
    way = turn = other = 0.0
    for i in range(3):
        way += (pose[i] - told[i]) * (pose[i] - told[i])
    for i in range(3, 7):
        turn += (pose[i] - told[i]) * (pose[i] - told[i])
        other += (pose[i] + told[i]) * (pose[i] + told[i])
    # Squares of the distance to the told quaternion or its opposite, which is the same attitude:
    # twice the sine of a quarter of the turn.
    chord = min(turn, other)
    return bool(way > p.place * p.place or chord > p.chord * p.chord)


@inner
def _has_changed(p: DeadbandNumbers, told: Array, force: Array) -> bool:
    """Whether a force (3,) is beyond the deadband around the one that was told."""
    change = before = 0.0
    for i in range(force.shape[0]):
        change += (force[i] - told[i]) * (force[i] - told[i])
        before += told[i] * told[i]
    least = max(p.force_share * math.sqrt(before), p.least_force)
    return bool(change > least * least)
