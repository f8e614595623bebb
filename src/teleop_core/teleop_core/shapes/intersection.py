"""Intersection: the points that are inside every one of several shapes, such as a box without a ball."""

from dataclasses import dataclass

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_core.shapes import Shape
from teleop_core.shapes.basis import combined, directions

_ROUNDS = 200  # largest number of rounds
_STILL = 1e-12  # a smaller move counts as no move [m]
_INSIDE = 1e-8  # a smaller distance counts as zero [m]


@dataclass(frozen=True, kw_only=True)
class IntersectionParameters:
    """Shapes whose common part is the intersection."""

    parts: tuple[str, ...] = combined.parts_parameter(
        ("box size=[0.03, 0.03, 0.03]", "not sphere radius=0.01 at=[0.0, 0.02, 0.0]"),
        "parts whose common volume is the shape",
    )

    def __post_init__(self) -> None:
        combined.parts_of(self.parts, "intersection.parts")


@inner
def _project(numbers: Array, place: Array) -> None:
    """Move a point (3,) [m] to the nearest point inside all parts, if the parts are convex.

    The point is projected onto the parts in turn. Before each projection onto a part, the move by the projection onto
    the same part in the previous round is undone.

    Source:
        Boyle and Dykstra 1986.
    """
    kept, here, way = np.zeros((combined.MOST, 3)), np.empty(3), np.empty(3)
    for _ in range(_ROUNDS):
        moved, first = 0.0, 1
        for part in range(int(numbers[0])):
            for i in range(3):
                here[i] = place[i] + kept[part, i]
            directions.scale_to(way, max(combined.part_distance(here, numbers, first, way), 0.0))
            for i in range(3):
                moved = max(moved, abs(way[i] - kept[part, i]))
                kept[part, i] = way[i]
                place[i] = here[i] - way[i]
            first = combined.next_part(numbers, first)
        if moved <= _STILL:
            return


@kernel
def intersection_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the outward direction (3,); return the distance [m] of a point (3,) outside the intersection.

    For a point outside, the direction comes from the nearest point inside if all parts are convex. Next to parts that
    are not convex (paths, the outside of a shape), the direction comes from a near point inside, perhaps not the
    nearest. If no such point is found, and for points inside, it is the outward direction of the part with the largest
    distance.
    """
    farthest = combined.extreme_part(offset, numbers, 1.0, out)
    if farthest <= 0.0:
        return farthest
    place, way = np.empty(3), np.empty(3)
    for i in range(3):
        place[i] = offset[i]
    _project(numbers, place)
    is_inside = combined.extreme_part(place, numbers, 1.0, way) <= _INSIDE
    for i in range(3):
        way[i] = offset[i] - place[i]
    distance = directions.length_of(way)
    if not is_inside or distance <= directions.MIDDLE:
        return farthest
    for i in range(3):
        out[i] = way[i]
    return distance


INTERSECTION = Shape(
    "intersection", IntersectionParameters, intersection_distance, combined.outline_of_parts, combined.numbers_of_parts
)
