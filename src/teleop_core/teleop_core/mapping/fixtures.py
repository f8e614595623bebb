"""Virtual fixtures: a box around the hand whose walls push back."""

import math

from teleop_core.geometry import Array
from teleop_core.kernels import kernel


@kernel
def box_penetration(position: Array, center: Array, size: Array, depth: Array) -> float:
    """Write how far a point (3,) [m] is outside a box, as a vector (3,); returns its length.

    The vector runs from the nearest point of the box to the position, so beyond an edge or a
    corner it points away from that edge or corner. Inside it is zero.
    """
    for i in range(3):
        offset = position[i] - center[i]
        depth[i] = offset - min(max(offset, -0.5 * size[i]), 0.5 * size[i])
    return math.sqrt(depth[0] ** 2 + depth[1] ** 2 + depth[2] ** 2)


@kernel
def wall_force(depth: Array, length: float, stiffness: float, largest: float, force: Array) -> None:
    """Write the wall's push (3,) [N] back into the box; zero inside.

    A soft wall is a spring of ``stiffness`` [N/m] until it reaches the ``largest`` force [N],
    which stays constant deeper in; a hard wall has infinite stiffness.

    Source:
        Vongbunyong 2008, eqs. 6.3.1-6.3.2, with the interval and the sign put right and the
        per-axis force replaced by one along the penetration, which is right at edges too.
    """
    push = min(stiffness * length, largest) if length > 0.0 else 0.0
    for i in range(3):
        force[i] = -push * depth[i] / length if length > 0.0 else 0.0
