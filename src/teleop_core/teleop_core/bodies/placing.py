"""Placing: poses of the bodies of a tree, as a kernel."""

import math

import numpy as np
from numpy.typing import NDArray

from teleop_core.geometry import Array, multiply_quaternions
from teleop_core.kernels import inner, kernel

Indices = NDArray[np.int64]


@inner
def _follow(parent: Array, origin: Array, out: Array) -> None:
    """Write the pose (7,) of ``origin``, given in the frame of ``parent``."""
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
    """Turn a pose (7,) about its z by ``value`` [rad], or push it along its z [m]."""
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
    coordinates: Array,
    free: Array,
    parents: Indices,
    kinds: Indices,
    places: Indices,
    origins: Array,
    out: Array,
) -> None:
    """Write the poses (N, B, 7) of bodies in the base.

    Args:
        coordinates: What moves the joints (N, m) [rad, m].
        free: Poses (N, k, 7) of the free bodies; (1, 0, 7) if there are none.
        parents: Parent of each body (B,), smaller than its own index; -1 for the base.
        kinds: Values of :class:`~teleop_core.bodies.body.Joint` (B,).
        places: Index of each body's coordinate, or of its pose among the free ones (B,).
        origins: Poses (B, 7) in the parents' frames where the coordinates are zero.
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
