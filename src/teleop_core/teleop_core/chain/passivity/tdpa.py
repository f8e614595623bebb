"""TDPA: observers and controllers at both ports, by energies that only grow.

Each side tells the other how much of what came in at its port the other one may give. The hand's
push is no larger than what was heard pays for until the next sample; the slave's command goes
against the force on its tip only as far as what was heard pays for. What the command loses so is
made up for where that costs nothing, or can be paid.
"""

import math
from dataclasses import dataclass

from teleop_core.base.parameters import parameter
from teleop_core.chain.passivity import Passivity
from teleop_core.chain.passivity.held_back import hold_back, make_up, met_way, norm
from teleop_core.chain.passivity.port import DRIFT, IN, MARGIN, TOLD
from teleop_core.chain.passivity.tank import READING, SPARE
from teleop_core.kernels import inner, kernel
from teleop_core.kernels.geometry import Array


@dataclass(frozen=True, kw_only=True)
class TdpaParameters:
    """How much the hand's side keeps for itself."""

    kept_way: float = parameter(
        3e-4, unit="m", lower=0.0, upper=0.01,
        doc="what the hand gave is told to the slave but for the present push over this way, which "
        "is kept so that the push outlasts a step of the reading outwards",
        source="assumed: five steps of the device's reading, 0.055 mm",
    )  # fmt: skip


@inner
def tell(port: Array, kept: float) -> None:
    """Let the other side give what came in here, but for ``kept`` [J] and what is owed."""
    told = min(port[IN] - port[TOLD], port[MARGIN] - kept)
    if told > 0.0:
        port[TOLD] += told
        port[MARGIN] -= told


@kernel
def tdpa_hand(
    numbers: Array, memory: Array, last: Array, moved: Array, led: Array, flow: Array,
    heard: Array, port: Array, push: Array, scale: float, period: float,
) -> None:  # fmt: skip
    """Make the push (3,) [N] no larger than what is left can pay for until the next sample.

    What is left is what was heard and what came in, less what was told and what went out; a touch
    that is over leaves nothing.

    Source:
        Ryu, Artigas and Preusche 2010 for the law. Theirs is a damper by a measured speed; the
        bound for the next sample, which needs none, is that of the tank here.
    """
    way = square = 0.0
    for i in range(3):
        way += abs(moved[i])
        square += push[i] * push[i]
    port[MARGIN] += flow[0] + flow[1] - flow[2]
    size = math.sqrt(square)
    tell(port, numbers[0] * size / scale)
    if square == 0.0:
        port[MARGIN] = 0.0
    pay_push(port, push, size, way, scale)


@inner
def pay_push(port: Array, push: Array, size: float, way: float, scale: float) -> None:
    """Make a push (3,) of some size [N] no larger than the margin pays for until the next sample.

    The hand went ``way`` [m], the sum over its axes, since the sample before.
    """
    most = SPARE + scale * max(port[MARGIN], 0.0) / (READING + 2.0 * way)
    if size > most:
        for i in range(3):
            push[i] *= most / size


@kernel
def tdpa_slave(
    numbers: Array, memory: Array, flow: Array, force: Array, last: Array, heard: Array,
    port: Array, command: Array, period: float,
) -> None:  # fmt: skip
    """Let the command (7,) go against the force as far as what is left pays for.

    What went out counts as the larger one of what the command spent, and of what the tip really
    gave: the arm comes behind its command. ``memory`` holds what is left by the command [J]; the
    last three numbers of ``port`` are the drift, from what is given to what was commanded [m].

    Args:
        numbers: Time constant [s] and largest speed [m/s] with which drift goes away, a force below
            which nothing is touched [N], what the arm may lend in a touch [J], and up to which
            force all of it; none from twice that force on [N]; the last is not used.
        memory: Written.
        flow: Heard, in, out [J].
        force: On the tip (6,).
        last: Command before, as it was given.
        heard: Not used.
        port: Written.
        command: Written.
        period: Since the command before [s].

    Source:
        Ryu, Artigas and Preusche 2010, an admittance that takes from the command; Coelho, Ott,
        Singh, Lizarralde and Kondak 2019 for drift that is made up for while energy is left. That
        drift goes away in the air by the way on which the command comes back is ours.
    """
    drift = port[DRIFT : DRIFT + 3]
    port[MARGIN] += flow[0] + flow[1] - flow[2]
    memory[0] += flow[0] + flow[1]
    met = 0.0
    if norm(force) <= numbers[2]:
        port[MARGIN] = memory[0] = 0.0
        met = met_way(command, last, drift)
    told = port[TOLD]
    tell(port, 0.0)
    memory[0] -= port[TOLD] - told
    make_up(numbers, drift, met, period)
    for i in range(3):
        command[i] -= drift[i]
    pay_command(numbers, memory, force, last, port, command, period)


@inner
def pay_command(
    numbers: Array, memory: Array, force: Array, last: Array, port: Array, command: Array,
    period: float,
) -> None:  # fmt: skip
    """Let the command (7,) go against the force as far as what is left pays for; the rest is drift.

    Arguments are those of :func:`tdpa_slave`.
    """
    size = norm(force)
    lent = numbers[3] * min(max(2.0 - size / numbers[4], 0.0), 1.0)
    # What is overdrawn is given back by going back, no faster than drift goes away.
    left = max(min(port[MARGIN], memory[0]) + lent, -size * numbers[1] * period)
    inwards = hold_back(force, size, last, left, numbers[2], port, command)
    memory[0] -= max(inwards, 0.0)


TDPA = Passivity("tdpa", TdpaParameters, tdpa_hand, tdpa_slave)
