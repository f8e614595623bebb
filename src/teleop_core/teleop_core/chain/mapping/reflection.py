"""Reflection: the push of what the slave touches at the hand, and the tank that pays for it."""

import math
from typing import Any

from teleop_core.chain.mapping.following import is_felt
from teleop_core.graph.signals import Field
from teleop_core.kernels import inner
from teleop_core.kernels.geometry import Array

REFLECTION_PARAMETERS: list[Field] = [
    ("reflected", "f8"), ("reflected_most", "f8"), ("has_tank", "i8")
]  # fmt: skip
REFLECTION_STATE: list[Field] = [
    ("heard", "f8"), ("tank", "f8"),
    ("push", "f8", (3,)), ("pushed_at", "f8", (3,)), ("pushed_way", "f8"),
]  # fmt: skip
"""Share of the force that counts, energy in the tank [J], the last push [N], where it began [m],
and how far the hand went with it [m]."""
# Time [s] over which a force that comes from afar sets in, or fades where nothing comes any more.
_FADE = 0.1
# Of a tank: push that an empty one allows [N], and a step of the device's reading [m].
_SPARE, _READING = 0.005, 0.06e-3


@inner
def reflect(p: Any, s: Any, period: float, stylus: Array, row: Any) -> None:
    """Add what the slave touches to the hand's force (3,) [N]; what falls silent fades.

    Source:
        Position-force architecture, Lawrence 1993: the slave gets the hand's place, the hand gets
        the slave's force.
    """
    if p.reflected == 0.0:  # once it is switched on, the push sets in from nothing
        s.heard = s.push[0] = s.push[1] = s.push[2] = 0.0
        return
    force, felt = row.master_servo_cf, row.slave_measured_cf
    step = period / _FADE
    s.heard = min(max(s.heard + (step if is_felt(p, s, row) else -step), 0.0), 1.0)
    square = 0.0
    for i in range(3):
        square += felt[i] * felt[i]
    asked = p.reflected * math.sqrt(square)
    share = p.reflected * (p.reflected_most / asked if asked > p.reflected_most else 1.0)
    _fill_tank(s, stylus)
    for i in range(3):
        s.push[p.axis[i]] = p.sign[i] * s.heard * share * felt[i]
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
