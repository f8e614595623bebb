"""Box: a cuboid along the axes, as the RCRT-1 source uses it to limit the hand."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.kernels import Array, kernel
from teleop_core.shapes import Shape
from teleop_core.shapes.basis.drawing import edges_of


@dataclass(frozen=True, kw_only=True)
class BoxParameters:
    """A cuboid."""

    size: tuple[float, ...] = parameter(
        (0.03, 0.03, 0.03),
        Within(1e-4, 2.0, "m"),
        "distance between opposite walls along x, y, z",
        length=3,
        source="published: Vongbunyong 2008, section 6.3: 30 mm on the slave at gain 1",
    )


@kernel
def box_distance(offset: Array, size: Array, out: Array) -> float:
    """Write the outward direction of a box (3,); return the distance [m] of a point (3,) outside it.

    For a point outside, the direction is the one from the nearest point of the box, so it rotates smoothly around
    edges. For a point inside, it is the normal of the nearest face. Of equally near faces, x comes before y, and y
    before z.
    """
    square, face, depth = 0.0, 0, -math.inf
    for i in range(3):
        half = 0.5 * size[i]
        out[i] = offset[i] - min(max(offset[i], -half), half)
        square += out[i] * out[i]
        over = abs(offset[i]) - half
        if over > depth:
            face, depth = i, over
    if square > 0.0:
        return math.sqrt(square)
    for i in range(3):
        out[i] = math.copysign(1.0, offset[i]) if i == face else 0.0
    return depth


def box_outline(parameters: BoxParameters) -> Array:
    """All edges of the box, (16, 3) [m] relative to its middle."""
    return edges_of(parameters.size)


BOX = Shape("box", BoxParameters, box_distance, box_outline)
