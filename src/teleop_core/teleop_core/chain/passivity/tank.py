"""Tank: the push gives the hand no more than it took from it in this touch, by its own port.

An empty tank pushes no hand back, so that one before something hard goes on until a drive gives all
it has. With a stage ``passivity`` the slave's command stops there by the force on the tip.
"""

import math

from teleop_core.base.parameters import NoParameters
from teleop_core.chain.passivity import Passivity
from teleop_core.chain.passivity.held_back import hold_back, make_up, met_way, norm
from teleop_core.chain.passivity.port import DRIFT
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array

READING = 0.06e-3
"""A step of the device's reading [m]."""
SPARE = 0.005
"""Push that is given without any energy to pay for it [N]."""
_APPROACH = 0.05
"""Speed of the command against half the force that stops it [m/s]; assumed: that of a hand."""


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


@kernel
def tank_slave(
    numbers: Array, memory: Array, flow: Array, force: Array, last: Array, heard: Array,
    port: Array, command: Array, period: float,
) -> None:  # fmt: skip
    """Let the command (7,) go against the force the slower, the larger that is, and stop.

    The arm comes behind its command, so it presses harder in the end. A command that went back by
    itself would meet an arm that is still on its way to where it was before, and bounce.

    Args:
        numbers: Time constant [s] and largest speed [m/s] with which drift goes away, a force below
            which nothing is touched [N], two that are not used, the force that stops
            it [N].
        memory: Not used.
        flow: Not used.
        force: On the tip (6,).
        last: Command before, as it was given.
        heard: Not used.
        port: Drift; written.
        command: Written.
        period: Since the command before [s].
    """
    size, drift = norm(force), port[DRIFT : DRIFT + 3]
    is_free = size <= numbers[2]
    make_up(numbers, drift, met_way(command, last, drift) if is_free else 0.0, period)
    for i in range(3):
        command[i] -= drift[i]
    left = _APPROACH * period * max(numbers[5] - size, 0.0)
    hold_back(force, size, last, left, numbers[2], port, command)


TANK = Passivity("tank", NoParameters, tank_hand, tank_slave)
