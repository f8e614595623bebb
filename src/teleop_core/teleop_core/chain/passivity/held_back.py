"""Held back: a command that goes against the force on the tip no further than it may.

What it loses is *drift*, from what is given to what was commanded. It is made up for where that is
allowed, and met by a hand that comes back.
"""

import math

from teleop_core.chain.passivity.port import DRIFT, WITHHELD
from teleop_core.kernels import inner
from teleop_core.kernels.geometry import Array


@inner
def hold_back(
    force: Array, size: float, last: Array, left: float, least: float, port: Array, command: Array
) -> float:
    """Let the command (7,) go against the force as far as work is left for it; the rest is drift.

    Args:
        force: On the tip (6,), with a size [N]; none if that is no more than ``least``.
        size: See ``force``.
        last: Command before, as it was given.
        left: Work that the command may do against the force [J]; negative: it must go back.
        least: See ``force``.
        port: Drift and the work that was withheld; written.
        command: Written.

    Returns:
        Work that the command does [J].
    """
    inwards = 0.0
    for i in range(3):
        inwards -= force[i] * (command[i] - last[i])
    if inwards > left and size > least:
        for i in range(3):
            back = force[i] * (inwards - left) / (size * size)
            command[i] += back
            port[DRIFT + i] -= back
        port[WITHHELD] += max(inwards, 0.0) - max(left, 0.0)
        inwards = left
    return inwards


@inner
def norm(force: Array) -> float:
    """Size of a force, of its first three numbers."""
    return math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])


@inner
def met_way(command: Array, last: Array, drift: Array) -> float:
    """Way [m] on which the command (7,), as it came, went back towards the one given before.

    Drift that goes away by it moves nothing: the command that is given waits until it is met.
    """
    size, way = norm(drift), 0.0
    if size == 0.0:
        return 0.0
    for i in range(3):
        way -= drift[i] * (command[i] - last[i] - drift[i]) / size
    return max(way, 0.0)


@inner
def make_up(numbers: Array, drift: Array, met: float, period: float) -> None:
    """Let drift (3,) [m] fade, no faster than it may, and by the way ``met`` [m] besides."""
    square = 0.0
    for i in range(3):
        square += drift[i] * drift[i]
    size = math.sqrt(square)
    if size == 0.0:
        return
    step = min(met + min(size * period / (numbers[0] + period), numbers[1] * period), size)
    for i in range(3):
        drift[i] *= 1.0 - step / size
