"""Meshes: the triangles of solids, with sharp edges where a solid has them."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from teleop_core.bodies import Solid
from teleop_core.geometry import Array, rotations_from_quaternions

Faces = NDArray[np.int64]
Mesh = tuple[Array, Faces]
"""Vertices (V, 3) [m] and the three of each triangle (F, 3), seen from outside anticlockwise."""
_AROUND, _ARC = 20, 6
"""Sides of what is round, and steps of a quarter of its profile."""


def mesh_of(solid: Solid) -> Mesh:
    """Triangles of a solid in its body's frame."""
    vertices, faces = _MADE[solid.kind](*solid.size)
    turn = rotations_from_quaternions(solid.pose[None, 3:])[0]
    return vertices @ turn.T + solid.pose[:3], faces


def merged(meshes: list[Mesh]) -> Mesh:
    """Several meshes, at least one, as one."""
    begins = np.cumsum([0, *(len(vertices) for vertices, _ in meshes[:-1])])
    faces = [faces + begin for (_, faces), begin in zip(meshes, begins, strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def _box(x: float, y: float, z: float) -> Mesh:
    """Box around the origin; every face has corners of its own, so that edges are sharp."""
    quads = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)][:: int(side)], np.float64)
            quads.append(np.roll(np.insert(square, 0, side, axis=1), axis, axis=1))
    vertices = np.concatenate(quads) * (0.5 * x, 0.5 * y, 0.5 * z)
    corners = np.array([(0, 1, 2), (0, 2, 3)])
    return vertices, np.concatenate([corners + 4 * quad for quad in range(6)])


def _capsule(radius: float, length: float) -> Mesh:
    angle = np.linspace(0.0, 0.5 * math.pi, _ARC + 1)
    low = np.stack((radius * np.sin(angle), -0.5 * length - radius * np.cos(angle)), axis=1)
    high = low[::-1] * (1.0, -1.0)
    return _revolved([np.concatenate((low, high))])


def _sphere(radius: float) -> Mesh:
    return _capsule(radius, 0.0)


def _cylinder(radius: float, length: float) -> Mesh:
    top = 0.5 * length
    corners = np.array([(0.0, -top), (radius, -top), (radius, top), (0.0, top)])
    return _revolved([corners[i : i + 2] for i in range(3)])


def _revolved(profiles: list[Array]) -> Mesh:
    """What profiles of radius and height (N, 2), from below upwards, sweep about z."""
    angle = 2.0 * math.pi * np.arange(_AROUND) / _AROUND
    meshes = []
    for profile in profiles:
        rings = np.empty((len(profile), _AROUND, 3))
        rings[..., 0] = profile[:, :1] * np.cos(angle)
        rings[..., 1] = profile[:, :1] * np.sin(angle)
        rings[..., 2] = profile[:, 1:]
        here = np.arange(_AROUND)
        beside = np.roll(here, -1)
        strips = [
            _AROUND * ring + np.concatenate((
                np.stack((here, beside, beside + _AROUND), axis=1),
                np.stack((here, beside + _AROUND, here + _AROUND), axis=1),
            ))
            for ring in range(len(profile) - 1)
        ]  # fmt: skip
        meshes.append((rings.reshape(-1, 3), np.concatenate(strips)))
    return merged(meshes)


_MADE: dict[str, Callable[..., Mesh]] = {
    "box": _box,
    "capsule": _capsule,
    "sphere": _sphere,
    "cylinder": _cylinder,
}
