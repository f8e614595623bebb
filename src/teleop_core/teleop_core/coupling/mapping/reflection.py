"""Reflection: the force that the hand feels from the slave, as limited by passivity."""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from teleop_core.coupling.architectures import MEMORY, Architecture
from teleop_core.coupling.mapping.following import FollowingRecord, FollowingState, is_felt, is_seen
from teleop_core.coupling.mapping.gains import ReflectionParameters
from teleop_core.coupling.passivity import MEMORY as PASSIVE_MEMORY
from teleop_core.coupling.passivity import Passivity
from teleop_core.coupling.passivity.port import (
    IMPEDANCE,
    IN,
    LAW,
    MARGIN,
    ROUND,
    WAVE,
    WITHHELD,
    begin_round,
    count,
    hear_energy,
    port_work,
)
from teleop_core.coupling.passivity.tdpa import pay_push
from teleop_core.graph import Row, copy, topics
from teleop_core.kernels import Array, Integers, PoseRow, Vector3, inner


class ReflectionRecord(FollowingRecord):
    """Fields of a parameter record with the force reflection."""

    reflection: ReflectionParameters
    is_reflected: int
    law: float  # kind of passivity
    force_scale: float  # force at the hand, divided by that on the tip
    lead_gain: float  # force that moves the slave, divided by that of the hand
    gain: Annotated[Array, 2]  # motion of the slave, divided by the hand's motion, in the coarse and the fine mode
    axis: Annotated[Integers, 3]  # axes of master and slave
    sign: Vector3


class ReflectionState(FollowingState):
    """Fields of a state record with the forces on the hand."""

    heard: float  # share of the slave's force that is reflected, 0 to 1
    seen: float  # share of the slave's position error that is reflected, 0 to 1
    push: Vector3  # last push [N]
    pushed_at: Vector3  # position at which the push began [m]
    scale: float  # the hand's energy, divided by the slave's energy
    command: PoseRow  # position to which the hand moves the slave
    led_from: PoseRow  # the previous value of ``command``
    is_fine: int


# Time [s] over which the slave's force fades in, or fades out when no values arrive.
_FADE = 0.1
_ROUNDING = 1.0 + 1e-12


class Law(NamedTuple):
    """Architecture and passivity: kernels, numbers, memory, inputs and outputs."""

    push: Any
    numbers: Array
    memory: Array
    felt: Array
    away: Array
    out: Array
    hand: Any
    kept: Array  # numbers of the kind of passivity
    left: Array  # memory of the kind of passivity
    last: Array
    moved: Array
    led: Array
    asked: Array
    flow: Array
    heard: Array  # energies of the slave, its wave along the master's base
    port: Array
    wall: Array  # force of fixture and limits since the last sample [N]
    walls: Array  # energies of the force ``wall``

    def clear(self) -> None:
        """Set memory, forces and energies to zero."""
        for array in (
            self.memory, self.felt, self.away, self.out, self.left, self.last, self.moved,
            self.led, self.asked, self.flow, self.heard, self.port, self.wall, self.walls,
        ):  # fmt: skip
            array[:] = 0.0


def make_law(part: Architecture, numbers: Array, passivity: Passivity, kept: Array) -> Law:
    """The law of an architecture and a kind of passivity, with zero memory."""
    return Law(
        part.push_pointer, numbers, np.zeros(MEMORY), np.zeros(3), np.zeros(3), np.zeros(3),
        passivity.hand_pointer, kept, np.zeros(PASSIVE_MEMORY), np.zeros(3), np.zeros(3),
        np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(len(topics.ENERGY)), np.zeros(len(topics.ENERGY)),
        np.zeros(3), np.zeros(len(topics.ENERGY)),
    )  # fmt: skip


@inner
def reflect(
    p: ReflectionRecord, s: ReflectionState, law: Law, is_following: bool, period: float, stylus: Array, row: Row
) -> None:
    """Add the reflected force of the slave (3,) [N] to the hand's force; it fades out if the slave's values stop.

    Args:
        p: Parameters.
        s: State; written.
        law: Architecture and passivity; written.
        is_following: Whether the slave follows the hand; motions that the slave makes by itself are not felt.
        period: Time since the last sample [s].
        stylus: Position of the tip of the stylus (3,) [m].
        row: Signals.
    """
    if p.is_reflected == 0:
        if row.master_energy[LAW] != 0.0:  # 0 ends the requests to the slave's side
            begin_round(row.master_energy, 0.0, 1e-9 * row.master_measured_cp_ns)
        return
    _count(p, s, law, is_following, stylus, row)
    step = period / _FADE
    s.heard = min(max(s.heard + (step if is_felt(p, s, row) else -step), 0.0), 1.0)
    is_led = is_following and is_seen(p, s, row)
    s.seen = min(max(s.seen + (step if is_led else -step), 0.0), 1.0)
    for i in range(3):
        law.felt[i] = s.heard * row.slave_measured_cf[i]
        law.away[i] = s.seen * (row.slave_measured_cp[i] - s.command[i])
    law.push(law.numbers, law.memory, law.felt, law.away, period, law.out)
    _bound(law.out, p.reflection.max_force, 1.0)
    for i in range(3):
        law.asked[p.axis[i]] = p.sign[i] * law.out[i]
    _make_passive(p, s, law, period, row)
    if p.law != 0.0:
        _hold_wall(law, row.master_servo_cf)
    for i in range(3):
        row.master_servo_cf[i] += s.push[i]


@inner
def _hold_wall(law: Law, force: Array) -> None:
    """Limit the force (3,) of fixture and limits so that they return no more energy than they absorbed.

    If a kind of passivity is active, this limit is applied to walls of any stiffness. The energy of the wall is counted
    separately, so that reflection cannot use it.
    """
    square = way = 0.0
    for i in range(3):
        law.walls[MARGIN] -= law.wall[i] * law.moved[i]
        way += abs(law.moved[i])
        square += force[i] * force[i]
    if square == 0.0:
        law.walls[MARGIN] = min(law.walls[MARGIN], 0.0)
    pay_push(law.walls, force, math.sqrt(square), way, 1.0)
    for i in range(3):
        law.wall[i] = force[i]


@inner
def lead_by_force(p: ReflectionRecord, s: ReflectionState, row: Row) -> None:
    """Write slave_servo_cf: the force with which the hand resists the slave's push.

    A freely movable device has no force sensor. So the hand's force is taken as the opposite of the push.
    """
    for i in range(3):
        row.slave_servo_cf[i] = -p.lead_gain * p.sign[i] * s.push[p.axis[i]]


@inner
def _bound(push: Array, most: float, rounding: float) -> None:
    """Shorten a push (3,) to ``most`` [N]; a push that is longer only by rounding stays unchanged."""
    square = 0.0
    for i in range(3):
        square += push[i] * push[i]
    if square > most * most * rounding:
        share = most / math.sqrt(square)
        for i in range(3):
            push[i] *= share


@inner
def _count(p: ReflectionRecord, s: ReflectionState, law: Law, is_following: bool, stylus: Array, row: Row) -> None:
    """Add the work of the last push on the hand; a restarted law has zero energy.

    Energies are reset to zero when law or scale changes, and while the slave does not follow the hand.
    """
    scale = p.force_scale / p.gain[s.is_fine]
    is_other = law.port[LAW] != p.law or s.scale != scale or law.port[ROUND] == 0.0
    if is_other or not is_following:
        s.scale = scale
        begin_round(law.port, p.law, 1e-9 * row.master_measured_cp_ns)
        copy(s.command, s.led_from)
        copy(stylus, s.pushed_at)  # the last position may be older than a release of the stylus, or may not exist
    for i in range(3):
        law.moved[i] = stylus[i] - s.pushed_at[i]
        s.pushed_at[i] = stylus[i]
        law.led[p.axis[i]] = p.sign[i] * (s.command[i] - s.led_from[i]) / p.gain[s.is_fine]
        s.led_from[i] = s.command[i]
    came = -port_work(s.push, law.moved) / scale
    count(law.port, IN, came)
    for i in range(law.heard.shape[0]):
        law.heard[i] = row.slave_energy[i]
    for i in range(3):
        law.heard[WAVE + p.axis[i]] = p.sign[i] * row.slave_energy[WAVE + i]
    law.flow[0] = hear_energy(law.port, law.heard)
    law.flow[1], law.flow[2] = max(came, 0.0), max(-came, 0.0)


@inner
def _make_passive(p: ReflectionRecord, s: ReflectionState, law: Law, period: float, row: Row) -> None:
    """Limit the wanted push to a passive one, and report the energies."""
    for i in range(3):
        law.last[i], s.push[i] = s.push[i], law.asked[i]
    law.hand(law.kept, law.left, law.last, law.moved, law.led, law.flow, law.heard, law.port, s.push, s.scale, period)
    _bound(s.push, p.reflection.max_force, _ROUNDING)
    for i in range(3):
        lost = (s.push[i] - law.asked[i]) * law.moved[i] / s.scale
        if lost > 0.0:
            law.port[WITHHELD] += lost
    for i in range(law.port.shape[0]):
        row.master_energy[i] = law.port[i]
    row.master_energy[IMPEDANCE] /= p.force_scale * p.gain[s.is_fine]
    for i in range(3):
        row.master_energy[WAVE + i] = p.sign[i] * law.port[WAVE + p.axis[i]]
