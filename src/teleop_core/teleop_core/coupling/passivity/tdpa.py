"""TDPA: observers and controllers at both ports, by energies that only grow.

Each side tells the other how much of what came in at its port the other one may give. The hand's
push is no larger than what was heard pays for until the next sample; the slave's command is ahead
of the tip only as far as what was heard pays for. What the command loses so is made up for where
that can be paid. While the slave has little, the hand pays by a drag.
"""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.coupling.passivity import Passivity, held_back
from teleop_core.coupling.passivity.port import DRIFT, HEARD, IN, LAW, MARGIN, ROUND, TOLD
from teleop_core.kernels import Array, inner, kernel

READING = 0.06e-3
"""A step of the device's reading [m]."""
SPARE = 0.005
"""Push that is given without any energy to pay for it [N]."""
SPEED_TIME = 0.01
"""Time constant of the speed that a drag answers, above the steps of the reading [s]."""
_SPEED = 1
"""Place of the hand's speed in its memory."""


@dataclass(frozen=True, kw_only=True)
class StoreParameters:
    """Energy that the hand's side keeps for itself, and the least that it leaves to the slave."""

    kept_way: float = parameter(
        3e-4,
        Within(0.0, 0.01, "m"),
        "what the hand gave is told to the slave but for the present push over this way, which "
        "is kept so that the push outlasts a step of the reading outwards",
        source="assumed: five steps of the device's reading, 0.055 mm",
    )
    store: float = parameter(
        6e-3,
        Within(0.0, 1.0, "J"),
        "energy that the slave shall have before it touches anything; while it has less the hand feels a drag",
        source="derived: half of approach_stiffness times the square of the 3 mm by which the arm "
        "lags behind a command of 60 mm/s",
    )
    drag: float = parameter(
        10.0,
        Within(0.0, 100.0, "N·s/m"),
        "that drag, where the slave has nothing or less",
        source="assumed: that of a wave",
    )


@inner
def tell(port: Array, kept: float) -> None:
    """Credit the other side with the energy that came in here, less ``kept`` [J] and what is owed."""
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

    What is left is what was heard and what came in, less what was told and what went out. A touch that is over leaves
    nothing, but what is owed stays owed. Where a slave's port is heard of, it is told what came in; while it has less
    than its store, or energy is owed here, a drag on the hand brings some in.

    Source:
        Ryu, Artigas and Preusche 2010 for the law. Theirs is a damper by a measured speed; the
        bound for the next sample, which needs none, is that of the tank here. The drag is the
        tank level controller of Franken, Stramigioli, Misra, Secchi and Macchelli 2011.
    """
    way = square = 0.0
    for i in range(3):
        way += abs(moved[i])
        square += push[i] * push[i]
        memory[_SPEED + i] += (moved[i] - memory[_SPEED + i] * period) / (SPEED_TIME + period)
    port[MARGIN] += flow[0] + flow[1] - flow[2]
    size, lacks = math.sqrt(square), max(-port[MARGIN], 0.0)
    if heard[LAW] == port[LAW] and heard[ROUND] == port[ROUND]:
        tell(port, numbers[0] * size / scale)
        # What was told and is on its way counts as there.
        lacks += max(numbers[1] - heard[MARGIN] - (port[TOLD] - heard[HEARD]), 0.0)
    if square == 0.0:
        port[MARGIN] = min(port[MARGIN], 0.0)
    pay_push(port, push, size, way, scale)
    drag = numbers[2] * min(lacks / max(numbers[1], 1e-9), 1.0)
    for i in range(3):
        push[i] -= drag * memory[_SPEED + i]


@inner
def pay_push(port: Array, push: Array, size: float, way: float, scale: float) -> None:
    """Make a push (3,) of some size [N] no larger than the margin pays for until the next sample.

    The hand went ``way`` [m], the sum over its axes, since the sample before.
    """
    most = SPARE + scale * max(port[MARGIN], 0.0) / (READING + 2.0 * way)
    if size > most:
        for i in range(3):
            push[i] *= most / size


@inner
def keep_account(numbers: Array, flow: Array, force: Array, port: Array) -> float:
    """Count what is left at the slave's port, tell of it, and return it with the credit [J].

    Nothing that is owed is ever forgiven, so what the arm lends in all is bounded.
    """
    port[MARGIN] += flow[0] + flow[1] - flow[2]
    tell(port, 0.0)
    return port[MARGIN] + numbers[3]


@inner
def lead_slave(
    numbers: Array, memory: Array, flow: Array, force: Array, tip: Array, last: Array, port: Array,
    command: Array, stop: float, period: float,
) -> None:  # fmt: skip
    """Turn the command (7,) that came into the one that is given to the slave; see :func:`tdpa_slave`."""
    left, drift = keep_account(numbers, flow, force, port), port[DRIFT : DRIFT + 3]
    met = held_back.met_way(command, last, drift) if held_back.norm(force) <= numbers[2] else 0.0
    held_back.make_up(numbers, drift, met, period)
    for i in range(3):
        command[i] -= drift[i]
    held_back.hold_lead(numbers, memory, left, stop, force, tip, port, command)


@kernel
def tdpa_slave(
    numbers: Array, memory: Array, flow: Array, force: Array, tip: Array, last: Array,
    heard: Array, port: Array, command: Array, period: float,
) -> None:  # fmt: skip
    """Let the command (7,) be ahead of the tip as far as the remaining energy pays for.

    What is left is counted at the tip, by its force and its way on all six axes: what was heard and
    what came in, less what was told and what went out, and the credit, once for all. The last
    numbers of ``port`` are the drift, from what is given to what was commanded [m].

    Args:
        numbers: Time constant [s] and largest speed [m/s] with which drift goes away; a force below
            which nothing is touched [N]; what the arm may lend [J]; two that are not used; and the
            stiffness against which a lead is paid for [N/m].
        memory: Direction of the last force; written.
        flow: Heard, in, out [J].
        force: On the tip (6,).
        tip: Its pose (7,).
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
    lead_slave(numbers, memory, flow, force, tip, last, port, command, 1e9, period)


TDPA = Passivity("tdpa", StoreParameters, tdpa_hand, tdpa_slave)
