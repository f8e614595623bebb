"""Meshes: the triangles of solids; sharp edges of a solid stay sharp."""

import math

import numpy as np
from numpy.typing import NDArray

from teleop_core.kernels import Array, product, rotations_from_quaternions
from teleop_core.robots.solids import Solid

Faces = NDArray[np.int64]
Mesh = tuple[Array, Faces]
"""Vertices (V, 3) [m], and the indices of the three vertices of each triangle (F, 3), anticlockwise seen from
outside."""
AROUND = 20
"""Default number of sides of round solids; a multiple of four."""


def mesh_of(solid: Solid, around: int = AROUND) -> Mesh:
    """Triangles of a solid in its body's frame; round solids have ``around`` sides."""
    if solid.kind == "box":
        vertices, faces = _box(*solid.size)
    else:
        vertices, faces = _revolved(_profiles(solid, around // 4), around)
    turn = rotations_from_quaternions(solid.pose[None, 3:])[0]
    return product(vertices, turn.T) + solid.pose[:3], faces


def merged(meshes: list[Mesh]) -> Mesh:
    """Merge one or more meshes into a single mesh."""
    begins = np.cumsum([0, *(len(vertices) for vertices, _ in meshes[:-1])])
    faces = [faces + begin for (_, faces), begin in zip(meshes, begins, strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def _box(x: float, y: float, z: float) -> Mesh:
    """Box around the origin; faces share no corners, so that edges are sharp."""
    quads = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)][:: int(side)], np.float64)
            quads.append(np.roll(np.insert(square, 0, side, axis=1), axis, axis=1))
    vertices = np.concatenate(quads) * (0.5 * x, 0.5 * y, 0.5 * z)
    corners = np.array([(0, 1, 2), (0, 2, 3)])
    return vertices, np.concatenate([corners + 4 * quad for quad in range(6)])


def _profiles(solid: Solid, arc: int) -> list[Array]:
    """Profiles of a solid: radii and heights (N, 2) [m], from bottom to top; each profile ends at a sharp edge.

    Args:
        solid: Capsule, cylinder or sphere.
        arc: Number of steps in a quarter of a circle.
    """
    radius, top = solid.size[0], 0.5 * sum(solid.size[1:])
    if solid.kind == "cylinder":
        corners = np.array([(0.0, -top), (radius, -top), (radius, top), (0.0, top)])
        return [corners[i : i + 2] for i in range(3)]
    angle = np.linspace(0.0, 0.5 * math.pi, arc + 1)
    low = np.stack((radius * np.sin(angle), -top - radius * np.cos(angle)), axis=1)
    high = low[::-1] * (1.0, -1.0)
    return [np.concatenate((low, high if top else high[1:]))]  # a sphere has one equator


def _revolved(profiles: list[Array], around: int) -> Mesh:
    """Surface of revolution about z of profiles of radius and height (N, 2), from bottom to top."""
    angle = 2.0 * math.pi * np.arange(around) / around
    meshes = []
    for profile in profiles:
        rings = np.empty((len(profile), around, 3))
        rings[..., 0] = profile[:, :1] * np.cos(angle)
        rings[..., 1] = profile[:, :1] * np.sin(angle)
        rings[..., 2] = profile[:, 1:]
        here = np.arange(around)
        beside = np.roll(here, -1)
        strips = [
            around * ring
            + np.concatenate(
                (
                    np.stack((here, beside, beside + around), axis=1),
                    np.stack((here, beside + around, here + around), axis=1),
                )
            )
            for ring in range(len(profile) - 1)
        ]
        meshes.append((rings.reshape(-1, 3), np.concatenate(strips)))
    return merged(meshes)
