"""Chains: bodies and solids of links between joint axes."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from teleop_core.bodies.axes import Place
from teleop_core.bodies.body import HERE, Body, Joint
from teleop_core.bodies.frames import inverse, moved, product, seen_from
from teleop_core.bodies.solids import Role, Solid, along, ball, capsule, cylinder
from teleop_core.geometry import Array
from teleop_core.portable import length

# Radius of links over the reach of the robot, at the base and at the tip.
_THICK, _THIN = 0.03, 0.014


def chain(
    chained: Sequence[Place],
    names: Sequence[str],
    coordinates: Sequence[int],
    reference: Array,
    strokes: Array,
    tip: Array,
) -> tuple[list[Body], float]:
    """Bodies of a chain, the base first, without the tip; and the length of its skeleton [m].

    Args:
        chained: Where its joints are at the posture of reference.
        names: Names of the links after them.
        coordinates: Index of the coordinate that moves each.
        reference: Values of these coordinates at the posture of reference [rad, m].
        strokes: Length of the rod of each joint that pushes [m].
        tip: Pose of the tip (7,) at the posture of reference.
    """
    ends = [*(place.seat for place in chained[1:]), tip[:3]]
    reach = length_of(chained, tip)
    radii = reach * np.linspace(_THICK, _THIN, len(chained) + 1)
    bodies = [Body("base", _base(chained, reach, radii[0]), -1)]
    frames = [HERE]
    for i, place in enumerate(chained):
        frame = np.concatenate((place.arrive, along(place.axis.direction[None])[0]))
        origin = moved(
            product(inverse(frames[-1]), frame), int(place.axis.kind), -float(reference[i])
        )
        solids = _link(place, ends[i], strokes[i], radii[i + 1], frame)
        bodies.append(Body(names[i], solids, i, place.axis.kind, origin, coordinates[i]))
        frames.append(frame)
    return bodies, reach


def length_of(chained: Sequence[Place], tip: Array) -> float:
    """Length [m] of the way along a chain from the base to the tip (7,), with its rods."""
    points = [np.zeros(3)]
    for place in chained:
        points += [place.seat, place.arrive, place.leave]
    steps = np.diff(np.array([*points, tip[:3]]), axis=0)
    return max(float(length(steps).sum()), 1e-3)


def tip_of(bodies: Sequence[Body], frame: Array, tip: Array, reach: float) -> Body:
    """Body of the tip (7,), fixed to the last link, whose frame (7,) is known.

    Both are those at the posture of reference.
    """
    # A tip in the middle of the last joint, as of a wrist without a tool, shows around it.
    is_hidden = float(length(tip[:3] - frame[:3])) < 3.0 * _THIN * reach
    solids = (ball(np.zeros(3), (2.2 if is_hidden else 1.3) * _THIN * reach, "tool"),)
    return Body("tip", solids, len(bodies) - 1, Joint.FIXED, product(inverse(frame), tip))


def _base(chained: Sequence[Place], reach: float, radius: float) -> tuple[Solid, ...]:
    up = np.array([0.0, 0.0, 1.0])
    plate = cylinder(-0.5 * radius * up, up, 0.09 * reach, radius, "base")
    seat = chained[0].seat if chained else np.zeros(3)
    return (plate, *_run((np.zeros(3), seat), radius, "base"))


def _link(
    place: Place, end: Array, stroke: float, radius: float, frame: Array
) -> tuple[Solid, ...]:
    """Solids of the link after a joint, in its frame: joint, way to the next one, rod."""
    up = np.array([0.0, 0.0, 1.0])
    points = [seen_from(frame, point) for point in (place.arrive, place.leave, end)]
    run = _run(points, radius, "link")
    if place.axis.kind is Joint.PRISMATIC:
        rod = _run((np.zeros(3), -stroke * up), 0.8 * radius, "link")
        return (*rod, *run)
    return (cylinder(np.zeros(3), up, 1.5 * radius, 3.2 * radius, "joint"), *run)


def _run(points: Sequence[Array], radius: float, role: Role) -> tuple[Solid, ...]:
    return tuple(
        capsule(a, b, radius, role) for a, b in pairwise(points) if length(b - a) > 1e-6 * radius
    )
