"""Architectures: how the force on the hand follows from the slave's force and position, one file per kind.

Each kind computes a push on the hand from the force on the slave's tip and from the distance between the tip and its
command. All kinds share the handling of axes, silence, the largest push and passivity
(:mod:`teleop_core.coupling.mapping.reflection`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from teleop_core.base import PartError, Registry, part_check
from teleop_core.base.registry import places, tried
from teleop_core.kernels import Array, fenced, is_whole, numbers_of, pointer

__all__ = ["ARCHITECTURES", "MEMORY", "Architecture", "register_architecture"]

_ROW = "float64[::1]"
PUSH = f"void({_ROW}, {_ROW}, {_ROW}, {_ROW}, float64, {_ROW})"
"""Signature of a push kernel, so that one compiled stage serves every kind."""
MEMORY = 12
"""Number of values that an architecture remembers."""


def unscaled(parameters: object) -> float:
    """Return one: forces at the hand are as large as those on the tip."""
    return 1.0


def unled(parameters: object) -> float:
    """Return zero: the hand's force does not move the slave."""
    return 0.0


@dataclass(frozen=True)
class Architecture:
    """A kind of architecture: defines the force on the hand.

    Attributes:
        name: Name of the architecture in ``--set reflection.architecture=``.
        parameters: Parameter group of the architecture.
        push: ``push(numbers, memory, felt, away, period, out)``, a kernel or a plain function, called for every sample
            of the master. ``numbers`` are the numbers of the parameters. ``memory`` (12,) is kept from sample to
            sample, and is zero at the start. ``felt`` (3,) is the force on the tip [N]. ``away`` (3,) is the vector
            from the commanded to the measured tip position [m]. ``felt`` and ``away`` are in axes of the slave's base,
            have the delay of the network, and are zero while no values arrive. ``period`` is the time since the last
            sample [s]. The push (3,) [N], in axes of the slave's base, is written into ``out``.
        numbers: ``numbers(parameters)`` returns the ``numbers`` of ``push``, if they differ from the numbers of the
            parameters in their order.
        force_scale: ``force_scale(parameters)`` returns the force at the hand, divided by the tip force that causes
            it, > 0. Energies of hand and slave are compared by this factor.
        lead_gain: ``lead_gain(parameters)`` returns the force on the slave's tip, divided by the force with which the
            hand resists the push, for the stage ``impedance``.
        needs_impedance: Whether the architecture needs a stage ``impedance``.
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
    """Call the kernel for some samples, so that errors are reported before anything runs."""
    needs = "one with push(numbers, memory, felt, away, period, out) and parameters that all have defaults"
    with tried("architecture", part.name, needs):
        numbers, _ = fenced(part.numbers(part.parameters()))  # an index one too large reads NaN
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
"""All architectures by name."""

register_architecture = ARCHITECTURES.register
"""Adds your architecture under its own name; see :meth:`Registry.register`."""
