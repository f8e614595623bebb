"""Scenery: what a scene looks like around its arm, for those who draw it."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from teleop_core.kernels import Array
from teleop_core.robots.bodies.looks import Look


@dataclass(frozen=True, eq=False)
class Scenery:
    """Looks of all bodies of a scene, those of its arms included.

    Attributes:
        base: Pose (7,) of the arm's base in the world of the scene.
        fixed: Looks of what never moves, in the world of the scene.
        bodies: Name and looks of each moving body in its own frame, in the order of ``scene/poses``.
        start: Poses (n, 7) of these bodies at the start of a session, in the world of the scene.
    """

    base: Array
    fixed: tuple[Look, ...]
    bodies: tuple[tuple[str, tuple[Look, ...]], ...]
    start: Array


@runtime_checkable
class HasScenery(Protocol):
    """A robot that is the arm of a scene."""

    def scenery(self) -> Scenery:
        """What the scene looks like."""
        ...
