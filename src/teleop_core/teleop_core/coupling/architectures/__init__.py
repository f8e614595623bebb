"""Architectures: what the hand feels of the slave, one file per kind.

A kind turns the force on the slave's tip, and how far the tip is from where the hand leads it, into a push. Axes,
silence, the largest push and passivity are the same for all (:mod:`teleop_core.coupling.mapping.reflection`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numba import types

from teleop_core.base import PartError, Registry, part_check
from teleop_core.base.registry import places, tried
from teleop_core.kernels import Array, fenced, is_whole, numbers_of, pointer

__all__ = ["ARCHITECTURES", "MEMORY", "Architecture", "register_architecture"]

_ROW = types.float64[::1]
PUSH = types.void(_ROW, _ROW, _ROW, _ROW, types.float64, _ROW)
"""Signature of a push kernel, so that one compiled stage serves every kind."""
MEMORY = 12
"""Numbers that an architecture remembers."""


def unscaled(parameters: object) -> float:
    """One: forces at the hand are of the size of those on the tip."""
    return 1.0


def unled(parameters: object) -> float:
    """Zero: the hand's force does not move the slave."""
    return 0.0


@dataclass(frozen=True)
class Architecture:
    """A kind of architecture: what comes back to the hand.

    Attributes:
        name: What ``--set reflection.architecture=`` calls it.
        parameters: Its parameter group.
        push: ``push(numbers, memory, felt, away, period, out)``, a kernel or a plain function, called for every sample
            of the master. ``numbers`` are those of the parameters; ``memory`` (12,) is kept from sample to sample, and
            zero at the start; ``felt`` (3,) is the force on the tip [N]; ``away`` (3,) the way from where the hand
            leads the tip to where the tip was measured [m]; both along the slave's base, as late as they come, and zero
            where nothing comes; ``period`` is the time since the sample before [s]. Writes the push (3,) along the
            slave's base [N].
        numbers: ``numbers(parameters)`` gives what ``push`` takes, if that is
            something else than the numbers of the parameters in their order.
        force_scale: ``force_scale(parameters)`` gives the force at the hand over the one on the
            tip that it answers, above 0, by which energies of hand and slave are compared.
        lead_gain: ``lead_gain(parameters)`` gives the force that leads the slave's tip over what
            the hand bears of the push [N/N], for the stage ``impedance``.
        needs_impedance: Whether it works with a stage ``impedance`` alone.
    """

    name: str
    parameters: type
    push: Callable[[Array, Array, Array, Array, float, Array], None]
    numbers: Callable[[Any], Array] = numbers_of
    force_scale: Callable[[Any], float] = unscaled
    lead_gain: Callable[[Any], float] = unled
    needs_impedance: bool = False

    push_pointer = cached_property(lambda self: pointer(self.push, PUSH))
    """The push as an argument for kernels."""


def _try(part: Architecture) -> None:
    """Push for some samples, so that what cannot work is told before anything runs."""
    needs = "one with push(numbers, memory, felt, away, period, out) and parameters that all have defaults"
    with tried("architecture", part.name, needs):
        numbers, _ = fenced(part.numbers(part.parameters()))  # one too far is NaN
        memory, fence = fenced(np.zeros(MEMORY))
        out, behind = fenced(np.zeros(3))
        for size in (0.0, 1.0, -3.0):
            part.push(numbers, memory, np.full(3, size), np.full(3, 1e-3 * size), 1e-3, out)
            if not (np.isfinite(out).all() and is_whole(fence) and is_whole(behind)):
                text = f"one whose push is finite and remembers {MEMORY} numbers; it is {out!r}"
                raise PartError("architecture", part.name, text)


ARCHITECTURES: Registry[Architecture] = Registry(
    "architecture",
    "architectures",
    places(
        "teleop_core.coupling.architectures", "unilateral position_force position_position three_channel four_channel"
    ),
    part_check("architecture", Architecture, "push"),
    _try,
)
"""All kinds by name."""

register_architecture = ARCHITECTURES.register
"""Adds one of yours under its own name; see :meth:`Registry.register`."""
