"""Held back: a command that moves against the force on the tip only as far as the energy allows.

The difference between the original and the given command is *drift*. Drift is removed when the energy allows it, or
when the hand moves back.
"""

import math

from teleop_core.coupling.passivity.port import DRIFT, WITHHELD
from teleop_core.kernels import inner
from teleop_core.kernels.geometry import Array, multiply_quaternions, turn_between
from teleop_core.kernels.room import room


@inner
def hold_back(force: Array, size: float, last: Array, left: float, least: float, port: Array, command: Array) -> float:
    """Let the command (7,) move against the force as far as the remaining work allows; the rest is drift.

    Args:
        force: Wrench on the tip (6,).
        size: Size of its force [N].
        last: Last command given to the slave.
        left: Work that the command may do against the force [J]; if negative, the command must go back.
        least: A force of at most this size counts as no contact [N].
        port: Drift and the work that was withheld; written.
        command: Pose (7,) of the original command; overwritten with the command to give.

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
    """Size of a force: the norm of its first three numbers."""
    return math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])


@inner
def met_way(command: Array, last: Array, drift: Array) -> float:
    """Distance [m] by which the original command (7,) moved back towards the last given command.

    Drift that shrinks by this distance does not move the slave: the given command waits for the hand.
    """
    size, way = norm(drift), 0.0
    if size == 0.0:
        return 0.0
    for i in range(3):
        way -= drift[i] * (command[i] - last[i] - drift[i]) / size
    return max(way, 0.0)


@inner
def make_up(numbers: Array, drift: Array, met: float, period: float) -> None:
    """Reduce drift (3,) [m] within its largest speed, and additionally by the distance ``met`` [m]."""
    square = 0.0
    for i in range(3):
        square += drift[i] * drift[i]
    size = math.sqrt(square)
    if size == 0.0:
        return
    step = min(met + min(size * period / (numbers[0] + period), numbers[1] * period), size)
    for i in range(3):
        drift[i] *= 1.0 - step / size


@inner
def hold_lead(
    numbers: Array, memory: Array, left: float, stop: float, force: Array, tip: Array, port: Array, command: Array
) -> None:
    """Let the command (7,) be ahead of the tip only as far as the remaining energy pays for the distance.

    The arm moves to its command even against a contact. So the energy for the distance from tip to command is reserved
    before the motion begins. It is computed for a spring that already has the present force, plus friction of equal
    size. Rotations against the torque use energy too. The command may always move back from the last contact. If no
    energy is left, this is the only allowed motion.

    Args:
        numbers: Numbers of :func:`teleop_core.coupling.passivity.tdpa.tdpa_slave`.
        memory: Memory; its second to fourth number are the direction of the last force; written.
        left: Remaining energy [J].
        stop: Force at which the command may no longer be ahead of the tip, against this force [N].
        force: Wrench on the tip (6,).
        tip: Pose of the tip (7,).
        port: Drift and the work that was withheld; written.
        command: Pose (7,) of the original command; overwritten with the command to give.
    """
    size, away, spring = norm(force), memory[1:4], numbers[6]
    left, lead, inwards = max(left, 0.0), room(3), 0.0
    if size <= numbers[2]:
        size = 0.0
    _hold_turn(left, force[3:6], numbers[2], tip[3:7], command[3:7])
    most = (math.sqrt(size * size + 2.0 * spring * left) - size) / spring
    for i in range(3):
        if size > 0.0:
            away[i] = force[i] / size
        lead[i] = command[i] - tip[i]
        inwards -= away[i] * lead[i]
    if size > 0.0 and inwards > max(stop - size, 0.0) / spring:
        _take_back(away, inwards - max(stop - size, 0.0) / spring, size, port, command)
        inwards = max(stop - size, 0.0) / spring
    for i in range(3):
        lead[i] = command[i] - tip[i] + min(inwards, 0.0) * away[i]
    length = norm(lead)
    if length > most:
        for i in range(3):
            lead[i] /= -length
        _take_back(lead, length - most, size, port, command)


@inner
def _take_back(along: Array, way: float, force: float, port: Array, command: Array) -> None:
    """Move a command back by a distance [m] along a direction (3,); this distance becomes drift."""
    port[WITHHELD] += force * way
    for i in range(3):
        command[i] += along[i] * way
        port[DRIFT + i] -= along[i] * way


@inner
def _hold_turn(left: float, torque: Array, least: float, tip: Array, command: Array) -> None:
    """Let an attitude (4,) rotate against the torque (3,) as far as the remaining energy ``left`` [J] pays for.

    A torque smaller than that of the least force on a lever of 1 cm counts as zero.
    """
    size, lead, back = norm(torque), room(3), room(4)
    if size <= 0.01 * least:
        return
    turn_between(tip, command, lead)
    excess = -left / size
    for i in range(3):
        excess -= torque[i] / size * lead[i]
    if excess > 0.0:
        share = math.sin(0.5 * excess) / size
        back[0] = math.cos(0.5 * excess)
        for i in range(3):
            back[1 + i] = share * torque[i]
        multiply_quaternions(back, command, command)
