"""Bodies of a robot: a tree of rigid bodies on joints, and where it is for joint vectors."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from teleop_core.bodies.placing import place
from teleop_core.bodies.solids import Solid
from teleop_core.errors import ShapeError
from teleop_core.geometry import Array

Coordinates: TypeAlias = Callable[[Array], tuple[Array, Array]]
"""From joint vectors (N, n): coordinates (N, m) of the tree, of which the first n are the joints
themselves, and poses (N, k, 7), in the base, of the k free bodies."""
HERE = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
HERE.setflags(write=False)


class Joint(IntEnum):
    """How a body moves against its parent."""

    FIXED = 0
    REVOLUTE = 1  # about z of its own frame
    PRISMATIC = 2  # along z of its own frame
    FREE = 3  # placed in the base as a whole: legs, platforms


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body of a robot.

    Attributes:
        name: Unique in the robot; the first is ``base``, the last ``tip``.
        solids: Its shapes, in its frame.
        parent: Index of the body that it moves against; -1 for the base.
        joint: How it moves.
        origin: Its pose (7,) in the parent's frame where the coordinate is zero; unused if free.
        coordinate: Index of what moves it: of the coordinates of a joint, of the poses of a free
            body; -1 for a fixed one.
    """

    name: str
    solids: tuple[Solid, ...] = ()
    parent: int = 0
    joint: Joint = Joint.FIXED
    origin: Array = field(default_factory=HERE.copy)
    coordinate: int = -1


class Bodies:
    """All bodies of a robot.

    Args:
        bodies: The bodies, parents before their children; the base first, the tip last.
        joints: Number of joints of the robot.
        coordinates: Coordinates of the tree and poses of its free bodies for joint vectors; None
            where the joints are the coordinates and no body is free.
        joint_body: Index of the body that each joint moves first, (n,).
        size: Length [m] to which the robot reaches, for cameras and arrows.
    """

    def __init__(
        self,
        bodies: tuple[Body, ...],
        joints: int,
        coordinates: Coordinates | None,
        joint_body: tuple[int, ...],
        size: float,
    ) -> None:
        self.bodies, self.n, self.joint_body, self.size = bodies, joints, joint_body, size
        self.names = tuple(body.name for body in bodies)
        self._coordinates = coordinates
        self._parents: NDArray[np.int64] = np.array([body.parent for body in bodies])
        self._kinds: NDArray[np.int64] = np.array([int(body.joint) for body in bodies])
        self._places: NDArray[np.int64] = np.array([body.coordinate for body in bodies])
        self._origins = np.array([body.origin for body in bodies])
        self._no_free = np.empty((1, 0, 7))

    def poses(self, q: object) -> Array:
        """Where all bodies are.

        Joints with which the loops of a robot do not close draw what is known: the bodies come
        apart where the loop is open.

        Args:
            q: Joint vector (n,) or batch (N, n) [rad, m]; limits are not applied.

        Returns:
            (B, 7) or (N, B, 7) in slave_base: x, y, z [m], quaternion w, x, y, z. The last is that
            of the tip. Where joints are not finite, neither are the bodies that they move.

        Raises:
            ShapeError: Another shape.
        """
        joints = np.array(q, dtype=np.float64, order="C")  # a copy: one that can be written
        if joints.ndim not in {1, 2} or joints.shape[-1] != self.n:
            raise ShapeError("q", (self.n,), joints.shape)
        rows = joints.reshape(-1, self.n)
        out = np.empty((len(rows), len(self.bodies), 7))
        coordinates, free = self.coordinates(rows)
        place(coordinates, free, self._parents, self._kinds, self._places, self._origins, out)
        return out[0] if joints.ndim == 1 else out

    def coordinates(self, q: Array) -> tuple[Array, Array]:
        """What the poses of all bodies follow from, for who places them elsewhere.

        Args:
            q: Joint vectors (N, n) [rad, m].

        Returns:
            Coordinates (N, m) of the tree [rad, m], and poses (N, k, 7) of its free bodies; without
            any of these (1, 0, 7).
        """
        return (q, self._no_free) if self._coordinates is None else self._coordinates(q)

    def index(self, name: str) -> int:
        """Index of a body by its name.

        Raises:
            ValueError: There is none of that name.
        """
        return self.names.index(name)
