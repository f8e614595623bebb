"""Hand: the operator's hand as a mass; a spring and a damper pull it along the wanted path."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.hand.master.device import DeviceParameters
from teleop_core.kernels import Array, Fields, Vector3, inner
from teleop_core.kernels.portable import matrix_exponential
from teleop_core.kernels.room import room

_FASTEST = 1.5
"""Largest phase [rad] of the oscillation of hand against device in one step of constant friction."""
_PLACE, _SPEED, _HAND, _HAND_SPEED = range(4)  # indices of the results of a step
_PUSH = 5  # index of the last input of a step


@dataclass(frozen=True, kw_only=True)
class HandParameters:
    """The operator's hand: a mass that a spring and a damper pull along the wanted path."""

    mass: float = parameter(
        0.15,
        Within(0.01, 5.0, "kg"),
        "mass of the hand that moves with the tip",
        source="assumed: fingers and a part of the hand of some 0.4 kg; a fingertip alone "
        "has some grams (Hajian and Howe 1997)",
    )
    stiffness: float = parameter(
        300.0,
        Within(1.0, 5000.0, "N/m"),
        "stiffness with which the hand holds the tip on its path",
        source="assumed: some 100 to 1000 N/m by grip, as of fingertips (Hajian and Howe 1997) and "
        "wrists that hold a stylus (Kuchenbecker, Park and Niemeyer 2003)",
    )
    damping: float = parameter(
        12.0,
        Within(0.1, 200.0, "N·s/m"),
        "damping with which the hand holds the tip on its path",
        source="assumed: 0.8 of critical with the masses and the stiffness here; fingertips have "
        "some 5 N·s/m (Hajian and Howe 1997), a firm grip more",
    )


class HandRecord(Fields):
    """Fields of a parameter record with the mechanics of hand and device."""

    device: DeviceParameters
    steps: int  # number of equal steps in a tick
    flow: Annotated[Array, 2, 3, 4, 6]  # matrices of join()
    center: Vector3  # centre of the workspace [m]
    half: Vector3  # half of the workspace's sides [m]


class HandState(Fields):
    """Fields of a state record with position and speed of hand and device."""

    position: Vector3  # position of the device [m]
    speed: Vector3  # [m/s]
    hand: Vector3  # position of the hand [m]
    hand_speed: Vector3
    wanted: Vector3  # wanted position of the hand [m]


@inner
def move_hand(p: HandRecord, s: HandState, wanted: Array, force: Array, dt: float) -> None:
    """Advance hand and device by one tick under the motors' force (3,) [N].

    The model has two masses on each axis. A spring and a damper pull the hand along its path. The device has motors,
    encoders and dry friction. The device's structure, a spring and a damper, connects hand and device. Within a tick
    the motor force is constant and the path is straight, so each step is exact. Friction is a force of any direction up
    to its bound, constant during a step. It reduces the speed as much as possible. So the device sticks, without creep,
    until the pulling force exceeds the bound.

    Source:
        Exact step of a linear system under held input, as in any book on sampled control (Astrom and Wittenmark 1997,
        section 2.3). Friction as a set of forces: Kikuuwe, Takesue, Sano, Mochiyama and Fujimoto 2006; Moreau 1988.
    """
    h, aim_speed = dt / p.steps, room(3)
    for i in range(3):
        aim_speed[i] = (wanted[i] - s.wanted[i]) / dt
    for step in range(p.steps):
        _push_on(p, s, aim_speed, force, h * step)
    for i in range(3):
        s.wanted[i] = wanted[i]
        low, high = p.center[i] - p.half[i], p.center[i] + p.half[i]
        if s.position[i] < low or s.position[i] > high:  # the device is at a stop
            s.position[i] = min(max(s.position[i], low), high)
            s.speed[i] = 0.0
            # The stops are in the device's joints, so a hand that pushes against a stop must not bend the structure.
            s.hand[i], s.hand_speed[i] = s.position[i], 0.0


@inner
def _push_on(p: HandRecord, s: HandState, aim_speed: Array, force: Array, time: float) -> None:
    """Make one step that begins ``time`` [s] after the start of the tick."""
    given, needed = room(3, 6), room(3)
    square, rests = 0.0, True
    for i in range(3):
        given[i, 0], given[i, 1] = s.speed[i], s.hand_speed[i]
        given[i, 2] = s.hand[i] - s.position[i]
        given[i, 3] = s.wanted[i] + time * aim_speed[i] - s.hand[i]
        given[i, 4], given[i, _PUSH] = aim_speed[i], force[i]
        # Force with which the device would be at rest at the end of the step.
        needed[i] = _flows(p.flow[0, i, _SPEED], given[i]) / p.flow[0, i, _SPEED, _PUSH]
        square += needed[i] * needed[i]
        rests = rests and s.speed[i] == 0.0
    sticks = square <= p.device.friction * p.device.friction
    share = 1.0 if sticks else p.device.friction / math.sqrt(square)
    held = 1 if sticks and rests else 0
    for i in range(3):
        s.speed[i] = (1.0 - share) * needed[i] * p.flow[0, i, _SPEED, _PUSH]
        given[i, _PUSH] -= share * needed[i]
        s.position[i] += _flows(p.flow[held, i, _PLACE], given[i])
        s.hand[i] += _flows(p.flow[held, i, _HAND], given[i])
        s.hand_speed[i] = _flows(p.flow[held, i, _HAND_SPEED], given[i])


@inner
def _flows(row: Array, given: Array) -> float:
    total = 0.0
    for k in range(6):
        total += row[k] * given[k]
    return total


def join(p: HandRecord, hand: HandParameters, device: DeviceParameters, dt: float) -> None:
    """Write the exact step of hand and device, and the number of steps in a tick.

    ``flow[0]`` (3, 4, 6) contains a matrix for each axis. The matrix gives four results after a step: displacement and
    speed of the device, displacement and speed of the hand. It is multiplied by six inputs: speeds of device and hand,
    position of the hand relative to the device, position of the aim relative to the hand, speed of the aim, force on
    the device. ``flow[1]`` contains the matrices for a device that friction holds.

    Args:
        p: Parameter record; ``flow`` and ``steps`` are written.
        hand: The hand.
        device: The device.
        dt: Tick [s].
    """
    lightness = 1.0 / hand.mass + 1.0 / device.apparent_mass
    fastest = math.sqrt(max(device.stiffness) * lightness)
    p.steps = max(1, math.ceil(fastest * dt / _FASTEST))
    for i, stiffness in enumerate(device.stiffness):
        bend = np.array([0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]) * device.structure_damping
        bend[4] = stiffness
        pull = np.array([0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0]) * hand.damping
        pull[5] = hand.stiffness
        # Rates of displacement and speed of the device, of displacement and speed of the hand, and of the other inputs
        # of a step: hand relative to device, aim relative to hand, speed of the aim, force.
        rates = np.zeros((8, 8))
        rates[0, 1] = rates[2, 3] = rates[4, 3] = rates[5, 6] = 1.0
        rates[4, 1] = rates[5, 3] = -1.0
        rates[3] = (pull - bend) / hand.mass
        p.flow[1, i] = _step(rates, dt / p.steps)
        rates[1], rates[1, 7] = bend / device.apparent_mass, 1.0 / device.apparent_mass
        p.flow[0, i] = _step(rates, dt / p.steps)


def _step(rates: Array, h: float) -> Array:
    return matrix_exponential(rates * h)[:4, [1, 3, 4, 5, 6, 7]]
