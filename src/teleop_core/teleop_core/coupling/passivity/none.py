"""None: no passivity; the hand gets the wanted push, and the slave gets the original command."""

from teleop_core.base import NoParameters
from teleop_core.coupling.passivity import Passivity
from teleop_core.kernels import Array, kernel


@kernel
def leave_push(
    numbers: Array, memory: Array, last: Array, moved: Array, led: Array, flow: Array,
    heard: Array, port: Array, push: Array, scale: float, period: float,
) -> None:  # fmt: skip
    """Leave the wanted push of the hand unchanged."""


NONE = Passivity("none", NoParameters, leave_push)
