"""Solids: the simple shapes that bodies are made of."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from teleop_core.base import ParameterError, ShapeError
from teleop_core.kernels import Array, length

Kind = Literal["capsule", "box", "sphere", "cylinder"]
Role = Literal["base", "link", "joint", "leg", "platform", "tool"]

SIZES: dict[Kind, int] = {"capsule": 2, "box": 3, "sphere": 1, "cylinder": 2}
"""Number of sizes that each kind of solid has."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A shape of a body.

    Args:
        kind: Kind of solid.
        size: Sizes in metres. Capsule: radius, and length along z between the centres of its half spheres. Cylinder:
            radius, and length along z between its faces. Box: x, y, z. Sphere: radius.
        pose: Pose of the solid's centre in the body's frame (7,): x, y, z [m], quaternion w, x, y, z.
        role: Part of the robot to which it belongs, for its colour.

    Raises:
        ShapeError: The number of sizes is wrong for the kind, or the pose is not (7,).
        ParameterError: A size is negative or not finite.
    """

    kind: Kind
    size: tuple[float, ...]
    pose: Array
    role: Role

    def __post_init__(self) -> None:
        if len(self.size) != SIZES[self.kind]:
            raise ShapeError(f"size of a {self.kind}", (SIZES[self.kind],), (len(self.size),))
        if not all(np.isfinite(length) and length >= 0.0 for length in self.size):
            raise ParameterError(f"size of a {self.kind}", self.size, "lengths >= 0 m")
        pose = np.array(self.pose, dtype=np.float64)
        if pose.shape != (7,):
            raise ShapeError(f"pose of a {self.kind}", (7,), pose.shape)
        pose.setflags(write=False)
        object.__setattr__(self, "pose", pose)


def capsule(start: Array, end: Array, radius: float, role: Role) -> Solid:
    """Capsule whose half spheres have their centres at two points (3,) [m] of the body."""
    way = end - start
    size = float(length(way))
    pose = np.concatenate((0.5 * (start + end), along(way[None])[0]))
    return Solid("capsule", (radius, size), pose, role)


def cylinder(center: Array, direction: Array, radius: float, length: float, role: Role) -> Solid:
    """Cylinder about a point (3,) [m] along a direction (3,) of the body."""
    pose = np.concatenate((center, along(direction[None])[0]))
    return Solid("cylinder", (radius, length), pose, role)


def ball(center: Array, radius: float, role: Role) -> Solid:
    """Sphere about a point (3,) [m] of the body."""
    return Solid("sphere", (radius,), np.concatenate((center, (1.0, 0.0, 0.0, 0.0))), role)


def rim(points: Array, radius: float, role: Role) -> tuple[Solid, ...]:
    """Capsules along the sides of a polygon (k, 3) [m] of the body."""
    ends = np.roll(points, -1, axis=0)
    pairs = zip(points, ends, strict=True)
    return tuple(capsule(a, b, radius, role) for a, b in pairs if length(b - a) > 0.0)


def along(directions: Array) -> Array:
    """Quaternions (N, 4), w, x, y, z, of the smallest rotations of the z axis to directions (N, 3).

    A direction of length zero gives no rotation; the direction -z gives a rotation about x.
    """
    lengths = length(directions)[:, None]
    unit = np.divide(directions, lengths, out=np.zeros_like(directions), where=lengths > 0.0)
    unit[lengths[:, 0] == 0.0, 2] = 1.0
    turns = np.stack((1.0 + unit[:, 2], -unit[:, 1], unit[:, 0], np.zeros(len(unit))), axis=-1)
    sizes = length(turns)
    is_opposite = sizes < 1e-9
    turns[is_opposite] = (0.0, 1.0, 0.0, 0.0)
    sizes[is_opposite] = 1.0
    return np.asarray(turns / sizes[:, None])
