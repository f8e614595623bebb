"""World: what the slave's tool can touch, one file per shape.

An object is a shape: how far a point is outside of it, which way its surface looks, and how it is
drawn. What it is made of, and how it pushes, is the same for all
(:mod:`teleop_core.slave.world.contact`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numba import types

from teleop_core.base.errors import PartError
from teleop_core.base.registry import Registry, part_check, places, tried
from teleop_core.kernels import pointer
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.parts import fenced, is_whole, numbers_of

__all__ = ["WORLD_OBJECTS", "WorldObject", "register_world_object"]

_ROW = types.float64[::1]
DISTANCE = types.float64(_ROW, _ROW, _ROW)
"""Signature of a distance kernel, so that one compiled simulator serves every object."""


@dataclass(frozen=True)
class WorldObject:
    """A shape that the tip can touch.

    Attributes:
        name: What ``--set world=`` calls it.
        parameters: Its parameter group: real numbers and tuples of them, in the slave's base. What
            a text ``file`` among them names is kept with recordings.
        distance: ``distance(offset, shape, normal)``, a kernel or a plain function. ``offset`` (3,)
            [m] runs from the middle of the object to the tip, along the slave's base; ``shape``
            holds the numbers of the parameters in their order; ``normal`` (3,) gets the unit vector
            out of the object where it is nearest. Returns how far the tip is outside [m], negative
            inside.
        outline: ``outline(parameters)`` gives points (N, 3) [m] of one line along its edges around
            its middle; a row of NaN lifts the pen.
        numbers: ``numbers(parameters)`` gives ``shape``, if that is something else.
    """

    name: str
    parameters: type
    distance: Callable[[Array, Array, Array], float]
    outline: Callable[[Any], Array]
    numbers: Callable[[Any], Array] = numbers_of

    distance_pointer = cached_property(lambda self: pointer(self.distance, DISTANCE))
    """The distance as an argument for kernels."""


_STEP = 1e-6  # along the normal, over which the distance must grow by as much [m]
_TRIED = np.array(
    [(0.31, 0.02, 0.05), (0.01, 0.43, -0.03), (-0.02, 0.04, 0.37), (-0.29, 0.23, -0.41)]
)
"""Offsets at which an object is tried [m]."""


def _try(part: WorldObject) -> None:
    """Try it at some places, so that what cannot work is told before anything runs."""
    needs = (
        "one with distance(offset, shape, normal) -> float, outline(parameters) -> (N, 3) and "
        "parameters that all have defaults"
    )
    with tried("world object", part.name, needs):
        parameters = part.parameters()
        np.asarray(part.outline(parameters), np.float64).reshape(-1, 3)
        for offset in _TRIED:
            _try_at(part, part.numbers(parameters), offset)


def _try_at(part: WorldObject, numbers: Array, offset: Array) -> None:
    """Make sure of distance and normal at one place.

    Raises:
        PartError: One is not finite, the normal is not of length 1, more than three numbers are
            written, or the distance does not grow by as much as one goes along the normal.
    """
    (shape, _), (normal, fence) = fenced(numbers), fenced(np.zeros(3))
    length = float(part.distance(offset, shape, normal))
    place = f"at {offset.tolist()} m from its middle"
    if not is_whole(fence):
        text = f"one whose distance writes three numbers to normal; {place} it writes more"
        raise PartError("world object", part.name, text)
    if not (math.isfinite(length) and abs(math.hypot(*normal) - 1.0) < 1e-6):
        text = f"one with a normal of length 1; {place} it is {normal.tolist()}"
        raise PartError("world object", part.name, text)
    farther = float(part.distance(offset + _STEP * normal, shape, np.zeros(3)))
    if abs(farther - length - _STEP) > 1e-2 * _STEP:
        text = (
            "one whose distance grows by as much as one goes along its normal; "
            f"{place} it grows by {(farther - length) / _STEP:.3g} times that"
        )
        raise PartError("world object", part.name, text)


WORLD_OBJECTS: Registry[WorldObject] = Registry(
    "world object",
    "world_objects",
    places(
        "teleop_core.slave.world",
        "empty plane sphere box cylinder capsule button mesh height_field hole",
    ),
    part_check("world object", WorldObject, "distance", "outline"),
    _try,
)
"""All objects by name."""

register_world_object = WORLD_OBJECTS.register
"""Adds one of yours under its own name; see :meth:`Registry.register`."""
