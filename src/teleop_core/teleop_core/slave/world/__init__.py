"""World: what the slave's tool can touch.

An object is a use of a shape (:mod:`teleop_core.shapes`), or one of the few in this folder that are objects alone. What
it is made of, and how it pushes, is the same for all (:mod:`teleop_core.slave.world.contact`).
"""

from teleop_core.base.registry import Registry, part_check, places
from teleop_core.shapes import SHAPES, Shape

__all__ = ["WORLD_OBJECTS"]

WORLD_OBJECTS: Registry[Shape] = Registry(
    "world object",
    "world_objects",
    places("teleop_core.slave.world", "empty button"),
    part_check("world object", Shape, "distance", "outline"),
    base=SHAPES,
)
"""All objects by name: every shape, and those that are objects alone."""
