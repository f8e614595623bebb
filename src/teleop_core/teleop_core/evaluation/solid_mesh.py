"""Solid mesh: the simple solids of a robot's bodies as triangles that a page can draw."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from teleop_core.bodies import Bodies, Role, Solid
from teleop_core.geometry import Array

ROLES: tuple[Role, ...] = ("base", "link", "joint", "leg", "platform", "tool")
_MANY = 30  # solids, of which fewer sides are enough
_BOX = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_BOX_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip

Indices = NDArray[np.int64]


class Mesh(NamedTuple):
    """Triangles of all bodies of a robot.

    Attributes:
        points: Corners (V, 3) [m], each in the frame of its body.
        faces: Corners of each triangle (F, 3).
        body: Body of each corner (V,).
        role: Index among :data:`ROLES` of what each corner is part of (V,).
    """

    points: Array
    faces: Indices
    body: Indices
    role: Indices


def mesh_of(bodies: Bodies) -> Mesh:
    """Triangles of all solids; those of a body stand together, in the order of the bodies."""
    owned = [(number, solid) for number, body in enumerate(bodies.bodies) for solid in body.solids]
    sides = 8 if len(owned) > _MANY else 12
    shapes = [_shape(solid, sides) for _, solid in owned]
    counts = [len(points) for points, _ in shapes]
    begins = np.cumsum([0, *counts[:-1]])
    return Mesh(
        np.concatenate([points for points, _ in shapes]),
        np.concatenate([faces + begin for (_, faces), begin in zip(shapes, begins, strict=True)]),
        np.repeat([number for number, _ in owned], counts),
        np.repeat([ROLES.index(solid.role) for _, solid in owned], counts),
    )


def posed(points: Array, poses: Array) -> Array:
    """Points (V, 3) that poses (V, 7) of their own bring elsewhere."""
    w, v = poses[:, 3:4], poses[:, 4:]
    # Rodrigues' formula with quaternions: p + 2 v × (v × p + w p).
    return np.asarray(
        poses[:, :3] + points + 2.0 * np.cross(v, np.cross(v, points) + w * points), dtype=float
    )


def _shape(solid: Solid, sides: int) -> tuple[Array, Indices]:
    """Corners (V, 3) in the frame of the body, and triangles (F, 3)."""
    if solid.kind == "box":
        points, faces = _BOX * solid.size, _BOX_FACES
    else:
        points, faces = _turned(_profile(solid, sides), sides)
    return posed(points, np.broadcast_to(solid.pose, (len(points), 7))), faces


def _profile(solid: Solid, sides: int) -> Array:
    """Radii and heights (K, 2) [m] of what a round solid is turned from, from below."""
    radius = solid.size[0]
    if solid.kind == "cylinder":
        half = 0.5 * solid.size[1]
        return np.array([[0.0, -half], [radius, -half], [radius, half], [0.0, half]])
    half = 0.5 * solid.size[1] if solid.kind == "capsule" else 0.0
    angles = np.linspace(-0.5, 0.5, sides // 2 + 1) * np.pi
    quarter = len(angles) // 2
    shift = np.where(np.arange(len(angles)) <= quarter, -half, half)
    profile = np.stack((radius * np.cos(angles), radius * np.sin(angles) + shift), axis=1)
    if not half:
        return profile
    middle = [[radius * np.cos(angles[quarter]), radius * np.sin(angles[quarter]) + half]]
    return np.insert(profile, quarter + 1, middle, axis=0)


def _turned(profile: Array, sides: int) -> tuple[Array, Indices]:
    """Corners and triangles of a profile (K, 2) that is turned about z."""
    turns = np.arange(sides) * (2.0 * np.pi / sides)
    radius, height = profile[:, :1], profile[:, 1:]
    heights = np.broadcast_to(height, (len(profile), sides))
    points = np.stack((radius * np.cos(turns), radius * np.sin(turns), heights), axis=-1)
    ring, side = np.divmod(np.arange((len(profile) - 1) * sides), sides)
    here, beside = ring * sides + side, ring * sides + (side + 1) % sides
    faces = np.concatenate((
        np.stack((here, beside, beside + sides), axis=1),
        np.stack((here, beside + sides, here + sides), axis=1),
    ))  # fmt: skip
    return points.reshape(-1, 3), faces
