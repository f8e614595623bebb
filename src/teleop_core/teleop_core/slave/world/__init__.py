"""World: what the slave's tool can touch.

An object has a shape of :mod:`teleop_core.shapes`, or one of the few shapes in this folder that only objects have.
Material and contact force are the same for all (:mod:`teleop_core.slave.world.contact`).
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
"""All objects by name: every shape, and the shapes that only objects have."""
