"""Reflection: what the hand feels of the slave, and the tank that pays for it."""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from teleop_core.chain.architectures import MEMORY, Architecture
from teleop_core.chain.mapping.following import is_felt, is_seen
from teleop_core.kernels import inner
from teleop_core.kernels.fields import Fields, Integers, Vector3
from teleop_core.kernels.geometry import Array


class ReflectionNumbers(Fields):
    """Fields of a parameter record with what comes back."""

    is_reflected: int
    reflected_most: float  # [N]
    has_tank: int
    axis: Annotated[Integers, 3]  # axes of master and slave
    sign: Vector3


class ReflectionState(Fields):
    """Fields of a state record with what the hand feels."""

    heard: float  # share of the force that counts
    seen: float  # share of the slave's place that counts
    tank: float  # energy [J]
    push: Vector3  # the last one [N]
    pushed_at: Vector3  # where it began [m]
    pushed_way: float  # how far the hand went with it [m]


# Time [s] over which what comes from afar sets in, or fades where nothing comes any more.
_FADE = 0.1
# Of a tank: push that an empty one allows [N], and a step of the device's reading [m].
_SPARE, _READING = 0.005, 0.06e-3


class Law(NamedTuple):
    """The architecture: its push, its numbers and memory, what it gets and what it writes."""

    push: Any
    numbers: Array
    memory: Array
    felt: Array
    away: Array
    out: Array

    def clear(self) -> None:
        """Forget what happened."""
        for array in (self.memory, self.felt, self.away, self.out):
            array[:] = 0.0


def make_law(part: Architecture, numbers: Array) -> Law:
    """The law of an architecture, at rest."""
    return Law(part.push_pointer, numbers, np.zeros(MEMORY), np.zeros(3), np.zeros(3), np.zeros(3))


@inner
def reflect(
    p: Any, s: Any, law: Any, is_following: bool, period: float, stylus: Array, row: Any
) -> None:
    """Add to the hand's force (3,) [N] what it feels of the slave; what falls silent fades.

    Args:
        p: Record with :data:`REFLECTION_PARAMETERS`.
        s: Record with :data:`REFLECTION_STATE`; written.
        law: :class:`Law`; written.
        is_following: Whether the slave is led by the hand; where it goes its own way is not felt.
        period: Since the sample before [s].
        stylus: Where the tip of the stylus is (3,) [m].
        row: Signals.
    """
    if p.is_reflected == 0:
        return
    force, step = row.master_servo_cf, period / _FADE
    s.heard = min(max(s.heard + (step if is_felt(p, s, row) else -step), 0.0), 1.0)
    is_led = is_following and is_seen(p, s, row)
    s.seen = min(max(s.seen + (step if is_led else -step), 0.0), 1.0)
    for i in range(3):
        law.felt[i] = s.heard * row.slave_measured_cf[i]
        law.away[i] = s.seen * (row.slave_measured_cp[i] - s.command[i])
    law.push(law.numbers, law.memory, law.felt, law.away, period, law.out)
    square = 0.0
    for i in range(3):
        square += law.out[i] * law.out[i]
    share = 1.0
    if square > p.reflected_most * p.reflected_most:
        share = p.reflected_most / math.sqrt(square)
    _fill_tank(s, stylus)
    for i in range(3):
        s.push[p.axis[i]] = p.sign[i] * share * law.out[i]
    if p.has_tank:
        _draw_from_tank(s)
    for i in range(3):
        force[i] += s.push[i]


@inner
def _fill_tank(s: Any, stylus: Array) -> None:
    """Take from the tank what the last push gave the hand, which moved to a place since then."""
    s.pushed_way = 0.0
    for i in range(3):
        way = stylus[i] - s.pushed_at[i]
        s.tank -= s.push[i] * way
        s.pushed_way += abs(way)
        s.pushed_at[i] = stylus[i]


@inner
def _draw_from_tank(s: Any) -> None:
    """Make the push (3,) [N] no larger than the tank can pay for until the next sample.

    Source:
        The energy tank of Franken, Stramigioli, Misra, Secchi and Macchelli 2011, at the hand
        alone: what is in it came from the hand in this touch.
    """
    square = 0.0
    for i in range(3):
        square += s.push[i] * s.push[i]
    if square == 0.0:  # the touch is over
        s.tank = 0.0
    push, most = math.sqrt(square), _SPARE + max(s.tank, 0.0) / (_READING + 2.0 * s.pushed_way)
    if push > most:
        for i in range(3):
            s.push[i] *= most / push
