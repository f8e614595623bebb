"""Wave: hand and slave exchange waves, each a mix of force and speed.

A wave carries energy: what the two-port holds is what is on its way. Its integral and its energy travel, which are both
sums, so a packet that is lost, late or doubled takes nothing away from the next one and adds no energy.
"""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.coupling.passivity import Passivity, held_back
from teleop_core.coupling.passivity.port import DRIFT, HEARD, IMPEDANCE, MARGIN, ROUND, TOLD, WAVE
from teleop_core.coupling.passivity.tdpa import SPEED_TIME, pay_push
from teleop_core.kernels import Array, inner, kernel


@dataclass(frozen=True, kw_only=True)
class WaveParameters:
    """What waves travel through."""

    impedance: float = parameter(
        10.0,
        Within(0.1, 100.0, "N·s/m"),
        "force over speed of a wave, at the hand; the hand feels 1.5 times as much as a drag",
        source="assumed: tissue of 200 N/m times the arm's lag of 50 ms, below which an arm that "
        "yields to a force that it reads late swings",
    )


DRAG = 1.5
"""Drag that the hand feels over what its wave takes: what is more pays for what the wave lacks."""
HASTE = 0.01
"""Time in which energy is spent on a wave that lags behind what it is to say [s]."""
KEPT_WAY = 3e-4
"""Way over which the hand's side keeps what the push needs, as that of TDPA [m]."""
RESERVE, TAKEN, OWED, SPEED = 1, 2, 5, 8
"""Places in the memory of either side: energy that was heard and not yet given [J], integral of the
wave that was given, integral of the own wave that is not yet told [√W s]; the hand's speed [m/s].
The first place is the round at the hand, and what is left by the command at the slave."""


@kernel
def draw(owed: Array, energy: float, period: float, haste: float, wave: Array) -> float:
    """Take the part of a wave's integral that is due now; returns its energy [J].

    What a wave of constant size brought in some time is given in the same time. Whatever the wave
    was, its energy suffices for all of it: no wave gets as far with less than one of constant size.

    Args:
        owed: Integral of the wave that is still to be given (3,) [√W s]; written.
        energy: What there is for it [J].
        period: Time for which the wave holds [s].
        haste: Time in which all of the energy may be spent [s]; infinite to be frugal.
        wave: Its size over that time (3,) [√W]; written.

    Source:
        Niemeyer and Slotine 1998, integral and energy of a wave as what travels.
    """
    square = 0.0
    for i in range(3):
        square += owed[i] * owed[i]
        wave[i] = 0.0
    if square == 0.0 or energy <= 0.0:
        return 0.0
    rate = max(2.0 * energy / square, math.sqrt(2.0 * energy / (square * haste)))
    share = min(rate * period, math.sqrt(2.0 * energy * period / square), 1.0)
    for i in range(3):
        wave[i] = owed[i] * share / period
        owed[i] -= owed[i] * share
    return 0.5 * square * share * share / period


@inner
def _take(memory: Array, gained: float, heard: Array, port: Array, period: float) -> Array:
    """The wave (3,) [√W] that comes out for the next ``period``; the margin gets its energy."""
    owed, wave = np.zeros(3), np.zeros(3)
    memory[RESERVE] += gained
    if heard[ROUND] == port[ROUND] and heard[TOLD] == port[HEARD]:  # the newest of this round
        for i in range(3):
            owed[i] = heard[WAVE + i] - memory[TAKEN + i]
    spent = draw(owed, memory[RESERVE], period, math.inf, wave)
    memory[RESERVE] -= spent
    port[MARGIN] += spent
    for i in range(3):
        memory[TAKEN + i] += wave[i] * period
    return wave


@inner
def _tell(memory: Array, port: Array, kept: float, period: float) -> None:
    """Send as much of the own wave as the margin, less ``kept`` [J], pays for."""
    wave = np.zeros(3)
    spent = draw(memory[OWED : OWED + 3], port[MARGIN] - kept, period, HASTE, wave)
    port[TOLD] += spent
    port[MARGIN] -= spent
    for i in range(3):
        port[WAVE + i] += wave[i] * period


@kernel
def wave_hand(
    numbers: Array, memory: Array, last: Array, moved: Array, led: Array, flow: Array,
    heard: Array, port: Array, push: Array, scale: float, period: float,
) -> None:  # fmt: skip
    """Write the push (3,) [N] that the wave from the slave and the hand's speed ask for.

    With impedance b, speed v and wave w that came, the push is ``sqrt(2 b) w - b v``, and the wave
    that goes is ``sqrt(2 b) v - w``; both are of the slave's scale of energy. The first part of the
    push is no larger than the margin pays for until the next sample, as that of TDPA.

    Source:
        Niemeyer and Slotine 1991.
    """
    if memory[0] != port[ROUND]:
        for i in range(memory.shape[0]):
            memory[i] = 0.0
        memory[0] = port[ROUND]
    b, way = numbers[0], 0.0
    at_hand, at_slave = math.sqrt(2.0 * b * scale), math.sqrt(2.0 * b / scale)
    port[IMPEDANCE] = b
    port[MARGIN] += flow[1] - flow[2]
    wave = _take(memory, flow[0], heard, port, period)
    for i in range(3):
        memory[SPEED + i] += (led[i] - memory[SPEED + i] * period) / (SPEED_TIME + period)
        memory[OWED + i] += at_slave * led[i] - wave[i] * period
        push[i] = at_hand * wave[i]
        way += abs(moved[i])
    size = held_back.norm(push)
    _tell(memory, port, KEPT_WAY * size / scale, period)
    pay_push(port, push, size, way, scale)
    for i in range(3):
        push[i] -= DRAG * b * memory[SPEED + i]


@inner
def pay_command(
    numbers: Array, memory: Array, force: Array, last: Array, port: Array, command: Array, period: float
) -> None:
    """Let the command (7,) go against the force as far as the remaining energy pays for; the rest is drift.

    Arguments are those of :func:`wave_slave`.
    """
    size = held_back.norm(force)
    lent = numbers[3] * min(max(2.0 - size / numbers[4], 0.0), 1.0)
    # What is overdrawn is given back by going back, no faster than drift goes away.
    left = max(min(port[MARGIN], memory[0]) + lent, -size * numbers[1] * period)
    inwards = held_back.hold_back(force, size, last, left, numbers[2], port, command)
    memory[0] -= max(inwards, 0.0)


@kernel
def wave_slave(
    numbers: Array, memory: Array, flow: Array, force: Array, tip: Array, last: Array,
    heard: Array, port: Array, command: Array, period: float,
) -> None:  # fmt: skip
    """Write the command (7,) that the wave from the hand and the force on the tip ask for.

    The port is matched by a damper of the impedance b: with force f and wave u that came, the
    command goes at ``u / sqrt(2 b) + f / (2 b)``, and the wave that goes is ``f / sqrt(2 b)``. So
    no wave from the hand comes back by itself, and a command in the air is the hand's. Against the
    force it goes as far as is paid for, as that of TDPA; in the air drift goes away.

    Source:
        Niemeyer and Slotine 1991, with their matching of impedance at the slave.
    """
    b = heard[IMPEDANCE]
    if b <= 0.0:
        return
    port[IMPEDANCE] = b
    is_free, root, before = held_back.norm(force) <= numbers[2], math.sqrt(2.0 * b), port[MARGIN]
    wave = _take(memory, flow[0], heard, port, period)
    memory[0] += port[MARGIN] - before + flow[1]
    port[MARGIN] += flow[1] - flow[2]
    if is_free:  # of what the damper took, what may be owed for the arm's lag is kept
        port[MARGIN] *= numbers[0] / (numbers[0] + period)
        memory[0] = port[MARGIN]
    for i in range(3):
        felt = 0.0 if is_free else force[i]
        memory[OWED + i] += felt / root * period
        way = (wave[i] / root + 0.5 * felt / b) * period
        port[DRIFT + i] = command[i] - last[i] - way
    told = port[TOLD]
    _tell(memory, port, 0.0, period)
    memory[0] -= port[TOLD] - told
    if is_free:
        held_back.make_up(numbers, port[DRIFT : DRIFT + 3], 0.0, period)
    for i in range(3):
        command[i] -= port[DRIFT + i]
    pay_command(numbers, memory, force, last, port, command, period)


WAVES = Passivity("wave", WaveParameters, wave_hand, wave_slave, needs_slave=True)
