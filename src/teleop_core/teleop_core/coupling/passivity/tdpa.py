"""TDPA: passivity observers and controllers at both ports, with energies that only increase.

Each side credits the other side with energy that came in at its own port. The hand's push is so small that its energy
until the next sample does not exceed the received credit. The slave's command is ahead of the tip only as far as the
received credit pays for. The drift that results is removed later, when energy is left. While the slave has little
energy, a drag on the hand supplies it.
"""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.coupling.passivity import Passivity, held_back
from teleop_core.coupling.passivity.port import DRIFT, HEARD, IN, LAW, MARGIN, ROUND, TOLD
from teleop_core.kernels import Array, inner, kernel

READING = 0.06e-3
"""An encoder step of the device [m]."""
SPARE = 0.005
"""Push that is allowed even without energy [N]."""
SPEED_TIME = 0.01
"""Time constant of the speed used for the drag [s]; long enough to smooth encoder steps."""
_SPEED = 1
"""Index of the hand's speed in its memory."""


@dataclass(frozen=True, kw_only=True)
class StoreParameters:
    """Energy that the hand's side stores, and the least energy that it leaves to the slave."""

    kept_way: float = parameter(
        3e-4,
        Within(0.0, 0.01, "m"),
        "distance; the hand's side keeps the energy of the present push over this distance and "
        "credits the rest to the slave, so that the push outlasts an outward step of the position "
        "reading",
        source="assumed: five steps of the device's reading, 0.055 mm",
    )
    store: float = parameter(
        6e-3,
        Within(0.0, 1.0, "J"),
        "energy that the slave should have before a contact; while it has less, the hand feels a drag",
        source="derived: half of approach_stiffness times the square of the 3 mm by which the arm "
        "lags behind a command of 60 mm/s",
    )
    drag: float = parameter(
        10.0,
        Within(0.0, 100.0, "N·s/m"),
        "damping of the drag on the hand while the slave has no energy",
        source="assumed: the same as the impedance of a wave",
    )


@inner
def tell(port: Array, kept: float) -> None:
    """Credit the other side with the energy that came in at this port, minus ``kept`` [J] and minus debts."""
    told = min(port[IN] - port[TOLD], port[MARGIN] - kept)
    if told > 0.0:
        port[TOLD] += told
        port[MARGIN] -= told


@kernel
def tdpa_hand(
    numbers: Array, memory: Array, last: Array, moved: Array, led: Array, flow: Array,
    heard: Array, port: Array, push: Array, scale: float, period: float,
) -> None:  # fmt: skip
    """Make the push (3,) [N] no larger than the remaining energy can pay for until the next sample.

    The remaining energy is the received credit plus the energy in, minus the sent credit and the energy out. After a
    contact it is set to zero, but a debt stays. If values of a slave's port arrive, the slave is credited with the
    energy in. While the slave has less than its store, or while there is a debt at this port, a drag on the hand
    supplies energy.

    Source:
        Ryu, Artigas and Preusche 2010 for the law. Their law is a damper that uses a measured speed. Here the push is
        bounded for the next sample as in the tank, which needs no speed. The drag is the tank level controller of
        Franken, Stramigioli, Misra, Secchi and Macchelli 2011.
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
        # Credits still in transit count as arrived.
        lacks += max(numbers[1] - heard[MARGIN] - (port[TOLD] - heard[HEARD]), 0.0)
    if square == 0.0:
        port[MARGIN] = min(port[MARGIN], 0.0)
    pay_push(port, push, size, way, scale)
    drag = numbers[2] * min(lacks / max(numbers[1], 1e-9), 1.0)
    for i in range(3):
        push[i] -= drag * memory[_SPEED + i]


@inner
def pay_push(port: Array, push: Array, size: float, way: float, scale: float) -> None:
    """Reduce a push (3,) of the given size [N] so that the margin pays for its energy until the next sample.

    ``way`` [m] is the motion of the hand since the last sample, summed over its axes.
    """
    most = SPARE + scale * max(port[MARGIN], 0.0) / (READING + 2.0 * way)
    if size > most:
        for i in range(3):
            push[i] *= most / size


@inner
def keep_account(numbers: Array, flow: Array, force: Array, port: Array) -> float:
    """Update the energy left at the slave's port, report it, and return it plus the arm's credit [J].

    Debts are never cancelled, so the total credit of the arm is bounded.
    """
    port[MARGIN] += flow[0] + flow[1] - flow[2]
    tell(port, 0.0)
    return port[MARGIN] + numbers[3]


@inner
def lead_slave(
    numbers: Array, memory: Array, flow: Array, force: Array, tip: Array, last: Array, port: Array,
    command: Array, stop: float, period: float,
) -> None:  # fmt: skip
    """Replace the command (7,) that arrived by the command to give to the slave; see :func:`tdpa_slave`."""
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

    The remaining energy is counted at the tip, from its wrench and its motion on all six axes. It is the received
    credit plus the energy in, minus the sent credit and the energy out, plus the arm's credit, which is given only
    once. The last numbers of ``port`` are the drift, from the given to the original command [m].

    Args:
        numbers: Time constant [s] and largest speed [m/s] with which drift decays; the force below which there is no
            contact [N]; the largest credit of the arm [J]; two unused numbers; and the stiffness for which a lead is
            paid [N/m].
        memory: Direction of the last force; written.
        flow: Received credit, energy in, energy out [J].
        force: Wrench on the tip (6,).
        tip: Pose of the tip (7,).
        last: Last command given to the slave.
        heard: Not used.
        port: Energies of this port; written.
        command: Command that arrived; overwritten with the command to give.
        period: Time since the last command [s].

    Source:
        Ryu, Artigas and Preusche 2010, an admittance that reduces the command; Coelho, Ott, Singh, Lizarralde and
        Kondak 2019 for the removal of drift while energy is left. Our addition: without contact, drift also
        decays by the distance by which the command moves back.
    """
    lead_slave(numbers, memory, flow, force, tip, last, port, command, 1e9, period)


TDPA = Passivity("tdpa", StoreParameters, tdpa_hand, tdpa_slave)
