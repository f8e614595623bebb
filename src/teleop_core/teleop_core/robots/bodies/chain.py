"""Chains: joint axes from a Jacobian, the points between which links run, and their bodies."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from teleop_core.kernels import Array, dot, length
from teleop_core.robots.bodies.frames import inverse, moved, product, seen_from
from teleop_core.robots.body import HERE, Body, Joint
from teleop_core.robots.solids import Role, Solid, along, ball, capsule, cylinder

# Sine between two axes under which they count as parallel.
_PARALLEL = 1e-4
_UNIT = 1e-6  # tolerances: of an axis from unit length, and of a motion from a pure rotation


@dataclass(frozen=True, eq=False)
class Axis:
    """Axis of a joint in the base: a point on it (3,) [m] and its direction (3,)."""

    kind: Joint
    point: Array
    direction: Array


@dataclass(frozen=True, eq=False)
class Place:
    """Points of a joint and of the link after it, in the base at the posture of reference [m].

    Attributes:
        axis: The joint's axis.
        seat: Point on the axis at which the previous link ends.
        arrive: Point at which its own link begins: the seat, or the end of the extended rod.
        leave: Point at which its own link leaves the axis.
    """

    axis: Axis
    seat: Array
    arrive: Array
    leave: Array


def axes_of(jacobian: Array, tip: Array) -> list[Axis] | None:
    """Axes of joints whose geometric Jacobian (6, m) moves the tip (3,) [m].

    For a rotation ω the axis passes through (ω x v0)/|ω|², where v0 is the velocity of the body point at the base's
    origin.

    Returns:
        The axes; None if some joint is neither a pure rotation nor a slide.

    Source:
        Lynch and Park 2017, section 3.3.2.
    """
    axes = []
    for column in jacobian.T:
        speed, turn = column[:3], column[3:]
        rate = float(length(turn))
        if rate < _UNIT:
            if abs(length(speed) - 1.0) > _UNIT:
                return None
            axes.append(Axis(Joint.PRISMATIC, np.zeros(3), speed))
            continue
        at_origin = speed + np.cross(tip, turn)
        if abs(rate - 1.0) > _UNIT or abs(dot(turn, at_origin)) > _UNIT:
            return None
        axes.append(Axis(Joint.REVOLUTE, np.cross(turn, at_origin) / rate**2, turn / rate))
    return axes


def places(axes: list[Axis], out: Array, tip: Array) -> list[Place]:
    """Points between which links run: the feet of the common normals of neighbouring axes.

    Args:
        axes: Axes of a chain in their order.
        out: Extension of each rod from its seat (m,) [m].
        tip: The tip (3,) [m].
    """
    found: list[Place] = []
    before, end = None, np.zeros(3)
    for i, axis in enumerate(_laid(axes, tip)):
        leave, seat = _normal(before, end, axis)
        if found:
            found[-1] = Place(found[-1].axis, found[-1].seat, found[-1].arrive, leave)
        end = seat + (out[i] * axis.direction if axis.kind is Joint.PRISMATIC else 0.0)
        found.append(Place(axis, seat, end, end))
        before = axis
    if before is not None:
        last = found[-1]
        found[-1] = Place(last.axis, last.seat, last.arrive, _foot(last.axis, tip))
    return found


def _laid(axes: list[Axis], tip: Array) -> list[Axis]:
    """The axes, pushes laid through what comes after them: a parallel turn, or the tip."""
    laid: list[Axis] = []
    beyond: Array | None = tip
    for axis, after in zip(reversed(axes), [None, *reversed(axes[1:])], strict=True):
        line = axis
        if axis.kind is Joint.PRISMATIC:
            is_beside = after is not None and _are_parallel(axis, after)
            if is_beside and laid:
                beyond = laid[-1].point
            elif after is not None:
                beyond = None
            line = Axis(axis.kind, np.full(3, np.nan) if beyond is None else beyond, axis.direction)
        laid.append(line)
    return laid[::-1]


def _are_parallel(a: Axis, b: Axis) -> bool:
    return float(length(np.cross(a.direction, b.direction))) < _PARALLEL


def _foot(axis: Axis, point: Array) -> Array:
    """Point of an axis nearest to a point (3,); the point itself if the axis is laid nowhere."""
    if np.isnan(axis.point).any():
        return point
    return np.asarray(axis.point + dot(point - axis.point, axis.direction) * axis.direction)


def _normal(before: Axis | None, end: Array, axis: Axis) -> tuple[Array, Array]:
    """Ends (3,) of the common normal, on the previous axis and on this axis.

    Parallel axes have many common normals: the one through ``end``, where the link arrived, is taken.
    """
    if before is None or np.isnan(axis.point).any() or _are_parallel(before, axis):
        return end, _foot(axis, end)
    start = end if np.isnan(before.point).any() else before.point
    cosine = float(dot(before.direction, axis.direction))
    way = axis.point - start
    ahead = dot(way, before.direction) - cosine * dot(way, axis.direction)
    along = ahead / (1.0 - cosine**2)
    leave = start + along * before.direction
    return leave, _foot(axis, leave)


# Radius of links, divided by the reach of the robot, at the base and at the tip.
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
        chained: Its joints at the reference posture.
        names: Names of the links after these joints.
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
        origin = moved(product(inverse(frames[-1]), frame), int(place.axis.kind), -float(reference[i]))
        solids = _link(place, ends[i], strokes[i], radii[i + 1], frame)
        bodies.append(Body(names[i], solids, i, place.axis.kind, origin, coordinates[i]))
        frames.append(frame)
    return bodies, reach


def length_of(chained: Sequence[Place], tip: Array) -> float:
    """Length [m] of the path along a chain and its rods, from the base to the tip (7,)."""
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


def _link(place: Place, end: Array, stroke: float, radius: float, frame: Array) -> tuple[Solid, ...]:
    """Solids of the link after a joint, in its frame: the joint, the connection to the next joint, and the rod."""
    up = np.array([0.0, 0.0, 1.0])
    points = [seen_from(frame, point) for point in (place.arrive, place.leave, end)]
    run = _run(points, radius, "link")
    if place.axis.kind is Joint.PRISMATIC:
        rod = _run((np.zeros(3), -stroke * up), 0.8 * radius, "link")
        return (*rod, *run)
    return (cylinder(np.zeros(3), up, 1.5 * radius, 3.2 * radius, "joint"), *run)


def _run(points: Sequence[Array], radius: float, role: Role) -> tuple[Solid, ...]:
    return tuple(capsule(a, b, radius, role) for a, b in pairwise(points) if length(b - a) > 1e-6 * radius)
