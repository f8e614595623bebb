"""Walls: how a fixture pushes back on the hand that is beyond it."""

from teleop_core.geometry import Array
from teleop_core.kernels import kernel


@kernel
def wall_force(depth: Array, length: float, stiffness: float, largest: float, force: Array) -> None:
    """Write the wall's push (3,) [N] back into the fixture; zero inside.

    A soft wall is a spring of ``stiffness`` [N/m] until it reaches the ``largest`` force [N],
    which stays constant deeper in; a hard wall has infinite stiffness.

    Source:
        Vongbunyong 2008, eqs. 6.3.1-6.3.2, with the interval and the sign put right and the
        per-axis force replaced by one along the penetration, which is right at edges too.
    """
    push = min(stiffness * length, largest) if length > 0.0 else 0.0
    for i in range(3):
        force[i] = -push * depth[i] / length if length > 0.0 else 0.0
