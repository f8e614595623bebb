"""Mesh: a closed surface of triangles from a file; its distance is interpolated in a grid.

The distances at the nodes of the grid are computed once, see :mod:`teleop_core.shapes.basis.distance_grid`. Between the
nodes the distance is a cubic spline. Its gradient is the normal, which is therefore continuous.
"""

import math
from dataclasses import dataclass

from teleop_core.base import Within, fixed
from teleop_core.kernels import Array, inner, kernel
from teleop_core.shapes import Shape
from teleop_core.shapes.basis import directions, distance_grid, spline


@dataclass(frozen=True, kw_only=True)
class MeshParameters:
    """A mesh from a file."""

    file: str = fixed("", doc="file of the mesh: STL, OBJ, PLY, OFF, or another format that trimesh reads")
    scale: float = fixed(1e-3, Within(1e-6, 1e3, "m"), "length unit of the file; 0.001 for millimetres")
    angles: tuple[float, ...] = fixed(
        (0.0, 0.0, 0.0),
        Within(-2.0 * math.pi, 2.0 * math.pi, "rad"),
        "rotation of the mesh about its middle: about x, then y, then z of the base",
        length=3,
    )
    step: float = fixed(
        1e-3, Within(5e-5, 0.05, "m"), "spacing of the grid of distances; smaller details are rounded off"
    )


@inner
def _cell(offset: float, shape: Array, axis: int) -> tuple[int, float, float]:
    """Position of a point in the grid along an axis; for a point outside the grid, the end of the grid.

    Returns:
        Index of the second of the four nodes around the point; distance from that node in steps; distance outside the
        grid [m].
    """
    wanted = (offset - shape[4 + axis]) / shape[3]
    last = shape[axis] - 1.0 - distance_grid.EDGE
    at = min(max(wanted, float(distance_grid.EDGE)), last)
    node = min(int(at), int(last) - 1)
    return node, at - node, (wanted - at) * shape[3]


@inner
def _gradient(shape: Array, at: tuple[int, int, int], share: tuple[float, float, float], gradient: Array) -> float:
    """Write the gradient (3,) of the spline after a node; return the spline's value [m]."""
    wx, wy, wz = spline.weights(share[0]), spline.weights(share[1]), spline.weights(share[2])
    sx, sy, sz = spline.slopes(share[0]), spline.slopes(share[1]), spline.slopes(share[2])
    rows, columns = int(shape[1]), int(shape[2])
    value = along_x = along_y = along_z = 0.0
    for i in range(4):
        plane = across = upwards = 0.0
        for j in range(4):
            first = distance_grid.HEADER + ((at[0] - 1 + i) * rows + at[1] - 1 + j) * columns + at[2] - 1
            a, b, c, d = shape[first], shape[first + 1], shape[first + 2], shape[first + 3]
            line = wz[0] * a + wz[1] * b + wz[2] * c + wz[3] * d
            slope = sz[0] * a + sz[1] * b + sz[2] * c + sz[3] * d
            plane += wy[j] * line
            across += sy[j] * line
            upwards += wy[j] * slope
        value += wx[i] * plane
        along_x += sx[i] * plane
        along_y += wx[i] * across
        along_z += wx[i] * upwards
    gradient[0], gradient[1], gradient[2] = (along_x / shape[3], along_y / shape[3], along_z / shape[3])
    return value


@kernel
def mesh_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the outward unit vector of a mesh (3,); return the distance [m] of a point (3,) outside it.

    Where the distance ``f`` has a ridge (behind an edge, in the middle of the mesh), the slope of its spline is below
    1. The returned value is ``f |∇f|``. So the force of a spring along the outward direction is proportional to the
    gradient of ``f²``, and a closed path around the ridge gains no energy. Outside the grid, the distance is measured
    from the surface point that is nearest to the end of the grid.
    """
    i, u, x = _cell(offset[0], numbers, 0)
    j, v, y = _cell(offset[1], numbers, 1)
    k, w, z = _cell(offset[2], numbers, 2)
    value = _gradient(numbers, (i, j, k), (u, v, w), out)
    slope = directions.length_of(out)
    if slope > 0.0:
        directions.make_unit(out)
    else:
        out[2] = 1.0
    if x == 0.0 and y == 0.0 and z == 0.0:
        return value * slope
    out[0], out[1], out[2] = x + value * out[0], y + value * out[1], z + value * out[2]
    distance = directions.length_of(out)
    directions.make_unit(out)
    return distance


def _grid(p: MeshParameters) -> distance_grid.DistanceGrid:
    return distance_grid.distance_grid(distance_grid.GridRequest(p.file, p.scale, p.angles, p.step))


def mesh_numbers(parameters: MeshParameters) -> Array:
    """Numbers of the grid for :func:`mesh_distance`; raises the errors of :func:`distance_grid`."""
    return _grid(parameters).numbers


def mesh_outline(parameters: MeshParameters) -> Array:
    """Sharp edges of the mesh and three sections through its middle, (N, 3) [m]; errors as :func:`mesh_numbers`."""
    return _grid(parameters).outline


MESH = Shape("mesh", MeshParameters, mesh_distance, mesh_outline, mesh_numbers)
