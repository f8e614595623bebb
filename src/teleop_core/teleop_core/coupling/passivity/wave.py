"""Wave: hand and slave exchange waves, each a mix of force and speed.

A wave carries energy: the energy in the two-port is the energy of the waves in transit. Packets contain the sums of the
wave's integral and of its energy. So a lost, late or doubled packet does not make the next packet wrong, and adds no
energy.
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
    """Parameters of the wave variables."""

    impedance: float = parameter(
        10.0,
        Within(0.1, 100.0, "N·s/m"),
        "wave impedance: force divided by speed of a wave at the hand; the hand feels a drag of 1.5 times this damping",
        source="assumed: stiffness of tissue, 200 N/m, times the arm's lag of 50 ms; with less, an arm "
        "that yields to a delayed force oscillates",
    )


DRAG = 1.5
"""Drag on the hand, divided by the power that its wave takes; the part above 1 supplies energy that the wave lacks."""
HASTE = 0.01
"""Time in which the energy is spent if a wave lags behind its wanted integral [s]."""
KEPT_WAY = 3e-4
"""Distance over which the hand's side reserves energy for the push, as in TDPA [m]."""
RESERVE, TAKEN, OWED, SPEED = 1, 2, 5, 8
"""Indices in the memory of either side.

RESERVE: received energy that is not yet given [J]. TAKEN: integral of the received wave that was already given [√W s].
OWED: integral of the own wave that is not yet sent [√W s]. SPEED: the hand's speed [m/s]. Index 0 is the round at the
hand; at the slave it is the energy that the command did not use.
"""


@kernel
def draw(owed: Array, energy: float, period: float, haste: float, wave: Array) -> float:
    """Take the part of a wave's integral that is due now; return its energy [J].

    The integral of a constant wave is given in the time in which it arrived. The energy of any wave suffices for its
    whole integral, because a constant wave needs the least energy for a given integral.

    Args:
        owed: Remaining integral of the wave (3,) [√W s]; written.
        energy: Available energy [J].
        period: Time for which the wave is constant [s].
        haste: Time in which all of the energy may be spent [s]; infinite to save energy.
        wave: Wave during that time (3,) [√W]; written.

    Source:
        Niemeyer and Slotine 1998, where integral and energy of a wave are transmitted.
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
    """Return the received wave (3,) [√W] for the next ``period``; add its energy to the margin."""
    owed, wave = np.zeros(3), np.zeros(3)
    memory[RESERVE] += gained
    if heard[ROUND] == port[ROUND] and heard[TOLD] == port[HEARD]:  # the newest values of this round
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
    """Send the part of the own wave whose energy the margin, minus ``kept`` [J], pays for."""
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
    """Write the push (3,) [N] that results from the slave's wave and the hand's speed.

    With impedance b, speed v and received wave w, the push is ``sqrt(2 b) w - b v`` and the sent wave is
    ``sqrt(2 b) v - w``; push and wave are in the slave's scale of energy. The first term of the push is limited so that
    the margin pays for its energy until the next sample, as in TDPA.

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
    """Let the command (7,) move against the force as far as the remaining energy allows; the rest is drift.

    Arguments are those of :func:`wave_slave`.
    """
    size = held_back.norm(force)
    lent = numbers[3] * min(max(2.0 - size / numbers[4], 0.0), 1.0)
    # An overdrawn margin is repaid by moving back, no faster than drift decays.
    left = max(min(port[MARGIN], memory[0]) + lent, -size * numbers[1] * period)
    inwards = held_back.hold_back(force, size, last, left, numbers[2], port, command)
    memory[0] -= max(inwards, 0.0)


@kernel
def wave_slave(
    numbers: Array, memory: Array, flow: Array, force: Array, tip: Array, last: Array,
    heard: Array, port: Array, command: Array, period: float,
) -> None:  # fmt: skip
    """Write the command (7,) that results from the hand's wave and the force on the tip.

    A damper of the impedance b matches the port. With force f and received wave u, the speed of the command is
    ``u / sqrt(2 b) + f / (2 b)``, and the sent wave is ``f / sqrt(2 b)``. So waves from the hand are not reflected, and
    without contact the command equals the hand's command. Against the force the command moves only as far as the
    remaining energy allows, as in TDPA; without contact drift decays.

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
    if is_free:  # a part of the damper's energy is reserved for a debt that the arm's lag may cause
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
