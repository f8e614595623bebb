"""Chains: joint axes from a Jacobian, the start and end points of links, and the bodies of links."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from teleop_core.kernels import Array, dot, length
from teleop_core.robots.bodies.frames import inverse, moved, product, seen_from
from teleop_core.robots.body import HERE, Body, Joint
from teleop_core.robots.solids import Role, Solid, along, ball, capsule, cylinder

# Two axes with a smaller sine of the angle between them count as parallel.
_PARALLEL = 1e-4
_UNIT = 1e-6  # tolerance of the length of an axis, and of the pitch of a pure rotation


@dataclass(frozen=True, eq=False)
class Axis:
    """Axis of a joint in the base: a point on it (3,) [m] and its direction (3,)."""

    kind: Joint
    point: Array
    direction: Array


@dataclass(frozen=True, eq=False)
class Place:
    """Points of a joint and of the link after the joint, in the base at the reference posture [m].

    Attributes:
        axis: The joint's axis.
        seat: Point on the axis at which the previous link ends.
        arrive: Point at which the link after the joint begins: the seat, or the end of the extended rod.
        leave: Point at which the link after the joint leaves the axis.
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
        The axes; None if the motion of a joint is neither a pure rotation nor a pure translation.

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
    """Start and end points of links: the feet of the common normals of neighbouring axes.

    Args:
        axes: Axes of a chain in their order.
        out: Extension of the rod of each joint from its seat (m,) [m].
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
    """The axes; a sliding axis passes through the tip if it is last, through the next if parallel, else nowhere."""
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
    """Point of an axis nearest to ``point`` (3,); ``point`` itself if the axis has no position."""
    if np.isnan(axis.point).any():
        return point
    return np.asarray(axis.point + dot(point - axis.point, axis.direction) * axis.direction)


def _normal(before: Axis | None, end: Array, axis: Axis) -> tuple[Array, Array]:
    """Two end points (3,) of the common normal, on the previous axis and on this axis.

    Parallel axes have many common normals; the normal through ``end``, the point where the link arrives, is taken.
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


_THICK = 0.03  # radius of links at the base, divided by the reach of the robot
_THIN = 0.014  # radius of links at the tip, divided by the reach of the robot


def chain(
    chained: Sequence[Place],
    names: Sequence[str],
    coordinates: Sequence[int],
    reference: Array,
    strokes: Array,
    tip: Array,
) -> tuple[list[Body], float]:
    """Bodies of a chain, the base first, without the tip; and the length of the chain's skeleton [m].

    Args:
        chained: Joints of the chain at the reference posture.
        names: Names of the links after these joints.
        coordinates: Index of the coordinate that moves each joint.
        reference: Values of these coordinates at the reference posture [rad, m].
        strokes: Length of the rod of each sliding joint [m].
        tip: Pose of the tip (7,) at the reference posture.
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
    """Body of the tip, fixed to the last link; ``tip`` and ``frame`` (7,) are the poses of tip and last link.

    These poses are those at the reference posture.
    """
    # A tip in the middle of the last joint, as in a wrist without a tool, is drawn larger, so that it is visible.
    is_hidden = float(length(tip[:3] - frame[:3])) < 3.0 * _THIN * reach
    solids = (ball(np.zeros(3), (2.2 if is_hidden else 1.3) * _THIN * reach, "tool"),)
    return Body("tip", solids, len(bodies) - 1, Joint.FIXED, product(inverse(frame), tip))


def _base(chained: Sequence[Place], reach: float, radius: float) -> tuple[Solid, ...]:
    up = np.array([0.0, 0.0, 1.0])
    plate = cylinder(-0.5 * radius * up, up, 0.09 * reach, radius, "base")
    seat = chained[0].seat if chained else np.zeros(3)
    return (plate, *_run((np.zeros(3), seat), radius, "base"))


def _link(place: Place, end: Array, stroke: float, radius: float, frame: Array) -> tuple[Solid, ...]:
    """Solids of the link after a joint, in the link's frame: joint, connection to the next joint, and rod."""
    up = np.array([0.0, 0.0, 1.0])
    points = [seen_from(frame, point) for point in (place.arrive, place.leave, end)]
    run = _run(points, radius, "link")
    if place.axis.kind is Joint.PRISMATIC:
        rod = _run((np.zeros(3), -stroke * up), 0.8 * radius, "link")
        return (*rod, *run)
    return (cylinder(np.zeros(3), up, 1.5 * radius, 3.2 * radius, "joint"), *run)


def _run(points: Sequence[Array], radius: float, role: Role) -> tuple[Solid, ...]:
    return tuple(capsule(a, b, radius, role) for a, b in pairwise(points) if length(b - a) > 1e-6 * radius)
