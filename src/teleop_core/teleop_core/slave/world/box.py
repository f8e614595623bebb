"""Box: a cuboid along the axes of the slave's base."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base.parameters import parameter
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array
from teleop_core.slave.world import WorldObject

# One line along all edges of a unit cube, corner by corner.
_CORNERS = np.array(
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0),
     (1, 0, 1), (1, 1, 1), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 1, 0), (0, 1, 1), (0, 0, 1)],
    dtype=np.float64,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class BoxParameters:
    """A cuboid."""

    edges: tuple[float, ...] = parameter(
        (0.06, 0.06, 0.03), unit="m", lower=1e-3, upper=2.0, length=3, doc="along x, y, z"
    )


@kernel
def box_distance(offset: Array, shape: Array, normal: Array) -> float:
    """Write the way out of a box (3,); returns how far a point (3,) [m] is outside.

    Outside it looks away from the nearest point, so around an edge the normal turns; inside it is
    that of the nearest face.
    """
    beyond, face, depth = 0.0, 0, -math.inf
    for i in range(3):
        over = abs(offset[i]) - 0.5 * shape[i]
        normal[i] = math.copysign(max(over, 0.0), offset[i])
        beyond += normal[i] * normal[i]
        if over > depth:
            face, depth = i, over
    if beyond > 0.0:
        length = math.sqrt(beyond)
        for i in range(3):
            normal[i] /= length
        return length
    for i in range(3):
        normal[i] = math.copysign(1.0, offset[i]) if i == face else 0.0
    return depth


def edges_of(size: tuple[float, ...]) -> Array:
    """All edges of a box of a size (3,) [m], (16, 3) [m] around its middle, as one line."""
    edges: Array = (_CORNERS - 0.5) * np.array(size)
    return edges


def box_outline(parameters: BoxParameters) -> Array:
    """All edges of the box, (16, 3) [m] around its middle."""
    return edges_of(parameters.edges)


BOX = WorldObject("box", BoxParameters, box_distance, box_outline)
