"""Axes of a chain: joint axes from a Jacobian, and the points between which its links run."""

from dataclasses import dataclass

import numpy as np

from teleop_core.bodies.body import Joint
from teleop_core.geometry import Array
from teleop_core.portable import dot, length

# Sine between two axes under which they count as parallel.
_PARALLEL = 1e-4
_UNIT = 1e-6  # how far an axis may be from a unit one, and a turn from a pure one


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
        seat: Where the link before it ends, on the axis.
        arrive: Where its own link begins: the seat, or the end of the rod that is pushed out.
        leave: Where its own link leaves the axis.
    """

    axis: Axis
    seat: Array
    arrive: Array
    leave: Array


def axes_of(jacobian: Array, tip: Array) -> list[Axis] | None:
    """Axes of joints whose geometric Jacobian (6, m) moves the tip (3,) [m].

    A turn ω with the tip's velocity v has its axis through (ω x v0)/|ω|², v0 the velocity of the
    point that is in the base's origin.

    Returns:
        The axes; None if some joint is neither a turn nor a push.

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
    """Points between which links run: the feet of the common normals of axes beside each other.

    Args:
        axes: Axes of a chain in their order.
        out: How far each rod is pushed out of its seat (m,) [m].
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
    """Ends (3,) of the common normal, on the axis before and on this one.

    Parallel axes have many: the one through ``end``, where the link arrived.
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
