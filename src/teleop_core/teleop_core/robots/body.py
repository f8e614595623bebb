"""Bodies of a robot: a tree of rigid bodies on joints, and their poses for joint vectors."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from teleop_core.base import ShapeError
from teleop_core.kernels import Array, inner, kernel, multiply_quaternions
from teleop_core.robots.solids import Solid

Indices = NDArray[np.int64]


@inner
def _follow(parent: Array, origin: Array, out: Array) -> None:
    """Transform the pose ``origin`` (7,) from the frame of ``parent`` to the base; ``out`` (7,) is written."""
    w, x, y, z = parent[3], parent[4], parent[5], parent[6]
    a, b, c = origin[0], origin[1], origin[2]
    # Twice the cross product of the vector part with the point: p + w t + v × t.
    i, j, k = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    out[0] = parent[0] + a + w * i + y * k - z * j
    out[1] = parent[1] + b + w * j + z * i - x * k
    out[2] = parent[2] + c + w * k + x * j - y * i
    multiply_quaternions(parent[3:7], origin[3:7], out[3:7])


@inner
def _move(kind: int, value: float, pose: Array) -> None:
    """Rotate a pose (7,) in place about its z axis by ``value`` [rad], or shift it along that axis [m]."""
    w, x, y, z = pose[3], pose[4], pose[5], pose[6]
    if kind == 1:
        c, s = math.cos(0.5 * value), math.sin(0.5 * value)
        pose[3], pose[4] = c * w - s * z, c * x + s * y
        pose[5], pose[6] = c * y - s * x, c * z + s * w
    elif kind == 2:
        pose[0] += value * 2.0 * (x * z + w * y)
        pose[1] += value * 2.0 * (y * z - w * x)
        pose[2] += value * (1.0 - 2.0 * (x * x + y * y))


@kernel
def place(
    coordinates: Array, free: Array, parents: Indices, kinds: Indices, places: Indices, origins: Array, out: Array
) -> None:
    """Write the poses (N, B, 7) of bodies in the base.

    Args:
        coordinates: Coordinates that move the joints (N, m) [rad, m].
        free: Poses (N, k, 7) of the free bodies; (1, 0, 7) if there are none.
        parents: Parent of each body (B,), smaller than its own index; -1 for the base.
        kinds: Values of :class:`~teleop_core.robots.body.Joint` (B,).
        places: For each body (B,), the index of its coordinate, or the index of its pose in ``free``.
        origins: Poses (B, 7) in the parents' frames, with all coordinates at zero.
        out: Poses (N, B, 7): x, y, z [m], quaternion w, x, y, z.
    """
    for i in range(out.shape[0]):
        for b in range(out.shape[1]):
            if kinds[b] == 3:
                out[i, b] = free[i, places[b]]
            elif parents[b] < 0:
                out[i, b] = origins[b]
            else:
                _follow(out[i, parents[b]], origins[b], out[i, b])
                if kinds[b] > 0:
                    _move(kinds[b], coordinates[i, places[b]], out[i, b])


Coordinates: TypeAlias = Callable[[Array], tuple[Array, Array]]
"""Function from joint vectors (N, n) to two arrays. The first array contains the coordinates (N, m) of the tree; the
first n of them are the joints. The second array contains the poses (N, k, 7) of the k free bodies in the base."""
HERE = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
HERE.setflags(write=False)


class Joint(IntEnum):
    """How a body moves relative to its parent."""

    FIXED = 0
    REVOLUTE = 1  # rotates about the z axis of the body's own frame
    PRISMATIC = 2  # slides along the z axis of the body's own frame
    FREE = 3  # a leg or platform whose whole pose in the base is given


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body of a robot.

    Attributes:
        name: Unique name; the first body is called ``base``, the last body ``tip``.
        solids: Shapes of the body, in its own frame.
        parent: Index of the parent body; -1 for the base.
        joint: Kind of joint that moves the body.
        origin: Pose (7,) of the body in the parent's frame when its coordinate is zero; unused for a free body.
        coordinate: Index of the coordinate that moves the body; for a free body, the index of its pose; -1 for a fixed
            body.
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
        coordinates: Function from joint vectors to coordinates of the tree and poses of its free bodies. None means
            that the joints are the coordinates and that no body is free.
        joint_body: Index of the body that each joint moves first, (n,).
        size: Reach of the robot [m]; cameras and arrows are scaled by it.
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
        """Poses of all bodies.

        If a loop of the robot does not close at ``q``, there is a gap between two of its bodies.

        Args:
            q: Joint vector (n,) or batch (N, n) [rad, m]; limits are not applied.

        Returns:
            (B, 7) or (N, B, 7) in slave_base: x, y, z [m], quaternion w, x, y, z. The last pose is that of the tip. A
            joint value that is not finite makes the poses of the bodies that it moves not finite.

        Raises:
            ShapeError: ``q`` is neither (n,) nor (N, n).
        """
        joints = np.array(q, dtype=np.float64, order="C")  # a writable copy
        if joints.ndim not in {1, 2} or joints.shape[-1] != self.n:
            raise ShapeError("q", (self.n,), joints.shape)
        rows = joints.reshape(-1, self.n)
        out = np.empty((len(rows), len(self.bodies), 7))
        coordinates, free = self.coordinates(rows)
        place(coordinates, free, self._parents, self._kinds, self._places, self._origins, out)
        return out[0] if joints.ndim == 1 else out

    def coordinates(self, q: Array) -> tuple[Array, Array]:
        """Coordinates of the tree and poses of its free bodies, for callers that compute all poses themselves.

        Args:
            q: Joint vectors (N, n) [rad, m].

        Returns:
            Coordinates (N, m) of the tree [rad, m], and poses (N, k, 7) of its free bodies; (1, 0, 7) if there is no
            free body.
        """
        return (q, self._no_free) if self._coordinates is None else self._coordinates(q)

    def index(self, name: str) -> int:
        """Index of a body by its name.

        Raises:
            ValueError: No body is called ``name``.
        """
        return self.names.index(name)
