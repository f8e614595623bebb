"""Tank: the push gives the hand no more than it took from it in this touch, by its own port."""

import math

from teleop_core.base.parameters import NoParameters
from teleop_core.chain.passivity import Passivity
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array

READING = 0.06e-3
"""A step of the device's reading [m]."""
SPARE = 0.005
"""Push that is given without any energy to pay for it [N]."""


@kernel
def tank_hand(
    numbers: Array, memory: Array, last: Array, moved: Array, led: Array, flow: Array,
    heard: Array, port: Array, push: Array, scale: float, period: float,
) -> None:  # fmt: skip
    """Make the push (3,) [N] no larger than the tank can pay for until the next sample.

    ``memory`` holds the energy in the tank [J].

    Source:
        The energy tank of Franken, Stramigioli, Misra, Secchi and Macchelli 2011, at the hand
        alone: what is in it came from the hand in this touch.
    """
    way = square = 0.0
    for i in range(3):
        memory[0] -= last[i] * moved[i]
        way += abs(moved[i])
        square += push[i] * push[i]
    if square == 0.0:  # the touch is over
        memory[0] = 0.0
    size, most = math.sqrt(square), SPARE + max(memory[0], 0.0) / (READING + 2.0 * way)
    if size > most:
        for i in range(3):
            push[i] *= most / size


TANK = Passivity("tank", NoParameters, tank_hand)
