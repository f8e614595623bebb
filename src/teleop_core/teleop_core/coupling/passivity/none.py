"""None: the hand gets what is asked for, and the slave what is commanded."""

from teleop_core.base import NoParameters
from teleop_core.coupling.passivity import Passivity
from teleop_core.kernels import Array, kernel


@kernel
def leave_push(
    numbers: Array, memory: Array, last: Array, moved: Array, led: Array, flow: Array,
    heard: Array, port: Array, push: Array, scale: float, period: float,
) -> None:  # fmt: skip
    """Let the hand have the push that is asked for."""


NONE = Passivity("none", NoParameters, leave_push)
