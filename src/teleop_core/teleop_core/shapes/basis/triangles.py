"""Triangles: the closed surface of a mesh from a file, and the distance of points from it."""

import io
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from teleop_core.base import ParameterError, TeleopError
from teleop_core.base.ranges import check
from teleop_core.kernels import Array, arctangent, dot, inner, kernel, length, product

_FLAT = 1e-6  # a mesh must fill this share of the cube around it
_LEAF = 4  # least number of triangles in a leaf of the tree


class Triangles(NamedTuple):
    """Triangles of a closed mesh; their corners are sorted counterclockwise as seen from outside.

    Attributes:
        points: Corners (P, 3) [m].
        faces: Indices of the corners of each triangle (F, 3).
    """

    points: Array
    faces: NDArray[np.int64]


def read_triangles(path: Path, data: bytes, placed: Array) -> Triangles:
    """Read a mesh, and check that it encloses a volume.

    If the triangles of the mesh point inwards, they are reversed.

    Args:
        path: Path of the file, for messages; its ending gives the format.
        data: Content of the file.
        placed: Matrix (3, 3) from the file's axes to the shape's axes, scale included [m].

    Raises:
        ParameterError: The file is not a mesh, or the mesh has a hole or no volume. For a hole, the message contains
            the middle of an edge of the hole, in the units of the file.
        TeleopError: The library that reads meshes is not installed.
    """
    name = "mesh.file"
    try:
        import trimesh
    except ImportError as error:
        raise TeleopError("a mesh needs trimesh: pip install 'teleop_core[mesh]'") from error
    try:
        with np.errstate(all="ignore"):  # no warnings about numbers that are refused below
            mesh = trimesh.load_mesh(io.BytesIO(data), file_type=path.suffix.lower().lstrip("."))
            mesh.merge_vertices(merge_tex=True, merge_norm=True)
        points, faces = np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int64)
        faces = faces.reshape(-1, 3)  # an empty array has no second axis otherwise
    except Exception as error:  # a third-party reader may raise anything for an arbitrary file
        text = f"a mesh that can be read, such as STL or OBJ ({type(error).__name__}: {error})"
        raise ParameterError(name, str(path), text) from error
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    if not (len(faces) and np.isfinite(points).all()):
        raise ParameterError(name, str(path), "a mesh of triangles with finite corners")
    check(f"{name}: longest side in the file's unit", float(np.ptp(points, axis=0).max()), "")
    _check_closed(name, path, points, faces)
    points = product(points - 0.5 * (points.min(axis=0) + points.max(axis=0)), placed.T)
    a, b, c = points[faces].transpose(1, 0, 2)
    volume = float(dot(a, np.cross(b, c)).sum()) / 6.0
    if abs(volume) <= _FLAT * math.pow(np.ptp(points, axis=0).max(), 3.0):
        raise ParameterError(name, str(path), "a mesh that encloses a volume; this one is flat")
    return Triangles(points, faces if volume > 0.0 else np.ascontiguousarray(faces[:, ::-1]))


def _check_closed(name: str, path: Path, points: Array, faces: NDArray[np.int64]) -> None:
    """Raise an error unless the triangles use every edge exactly once in each direction.

    Raises:
        ParameterError: An edge is missing or repeated in one direction; the message contains its position.
    """
    edges = edges_of(faces)
    forth = np.sort(edges[:, 0] * len(points) + edges[:, 1])
    back = edges[:, 1] * len(points) + edges[:, 0]
    is_lone = np.searchsorted(forth, back, "right") - np.searchsorted(forth, back) != 1
    if not is_lone.any():
        again = forth[:-1][forth[1:] == forth[:-1]]
        if not len(again):
            return
        lone = np.stack(np.divmod(again[0], len(points)))
    else:
        lone = edges[is_lone][0]
    place = points[lone].mean(axis=0)
    sides = int((np.sort(edges, axis=1) == np.sort(lone)).all(axis=1).sum())
    wrong = {1: "it has a hole", 2: "two triangles face opposite sides"}
    text = (
        f"a closed mesh; {wrong.get(sides, f'{sides} triangles meet')} at the edge whose middle is "
        f"{[float(f'{x:.6g}') for x in place]} in the file"
    )
    raise ParameterError(name, str(path), text)


def edges_of(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Edges (3 F, 2) of triangles: first the edges from corner 0 to 1 of all triangles, then 1 to 2, then 2 to 0."""
    return np.concatenate([faces[:, [i, (i + 1) % 3]] for i in range(3)])


def unit_normals(triangles: Triangles) -> Array:
    """Unit normals (F, 3) out of the mesh; zero where a triangle has no area."""
    a, b, c = triangles.points[triangles.faces].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    size = length(across)[:, None]
    return np.divide(across, size, out=np.zeros_like(across), where=size > 0.0)


def _pseudonormals(triangles: Triangles) -> Array:
    """Normals (F, 7, 3) that show the side of a point. Per triangle: face, corners 0, 1, 2, edges 01, 12, 20.

    Source:
        Baerentzen and Aanaes 2005: the normal of a corner is the sum over its triangles, weighted by their angles.
    """
    points, faces = triangles
    normals = unit_normals(triangles)
    found = np.empty((len(faces), 7, 3))
    found[:, 0] = normals
    at_corners = np.zeros_like(points)
    for i in range(3):
        here = points[faces[:, i]]
        one, other = (points[faces[:, (i + k) % 3]] - here for k in (1, 2))
        angle = arctangent(length(np.cross(one, other)), dot(one, other))
        np.add.at(at_corners, faces[:, i], angle[:, None] * normals)
    found[:, 1:4] = at_corners[faces]
    _, edge = np.unique(np.sort(edges_of(faces), axis=1), axis=0, return_inverse=True)
    at_edges = np.zeros((edge.max() + 1, 3))
    np.add.at(at_edges, edge.ravel(), np.tile(normals, (3, 1)))
    found[:, 4:7] = at_edges[edge.reshape(3, -1)].transpose(1, 0, 2)
    return found


class Tree(NamedTuple):
    """Triangles in a binary tree of boxes: node ``i`` has the children ``2 i`` and ``2 i + 1``.

    Attributes:
        boxes: Lower and upper corner of each node's box (2 L, 2, 3) [m]; ``boxes[0]`` is not used.
        begin: (L + 1,): index of the first triangle of each of the L leaves, then the number of triangles.
        corners: Corners of the triangles (F, 3, 3) [m].
        normals: Normals from :func:`_pseudonormals` (F, 7, 3).
        stack: Scratch memory for nodes.
    """

    boxes: Array
    begin: NDArray[np.int64]
    corners: Array
    normals: Array
    stack: NDArray[np.int64]


def tree_of(triangles: Triangles) -> Tree:
    """Sort the triangles of a mesh into a tree, without triangles of area zero, which their neighbours cover."""
    has_area = unit_normals(triangles).any(axis=1)
    corners = triangles.points[triangles.faces][has_area]
    parts: list[Any] = [np.arange(len(corners))]
    centers = corners.mean(axis=1)
    while len(corners) >= 2 * _LEAF * len(parts):
        parts = [half for part in parts for half in _halves(part, centers[part])]
    order, leaves = np.concatenate(parts), len(parts)
    begin = np.cumsum([0, *map(len, parts)])
    boxes = np.zeros((2 * leaves, 2, 3))
    boxes[leaves:, 0] = np.minimum.reduceat(corners.min(axis=1)[order], begin[:-1])
    boxes[leaves:, 1] = np.maximum.reduceat(corners.max(axis=1)[order], begin[:-1])
    for node in range(leaves - 1, 0, -1):
        boxes[node, 0] = np.minimum(*boxes[2 * node : 2 * node + 2, 0])
        boxes[node, 1] = np.maximum(*boxes[2 * node : 2 * node + 2, 1])
    normals = _pseudonormals(triangles)[has_area]
    return Tree(boxes, begin, corners[order], normals[order], np.zeros(128, np.int64))


def _halves(part: Any, centers: Array) -> tuple[Any, Any]:
    """Two halves of a part: the triangles below and above the median along its longest side."""
    axis = int(np.ptp(centers, axis=0).argmax())
    ordered = part[np.argsort(centers[:, axis], kind="stable")]
    return ordered[: len(part) // 2], ordered[len(part) // 2 :]


@inner
def _to_box(box: Array, x: float, y: float, z: float) -> float:
    """Squared distance [m²] of a point from a box (2, 3)."""
    dx = max(box[0, 0] - x, 0.0, x - box[1, 0])
    dy = max(box[0, 1] - y, 0.0, y - box[1, 1])
    dz = max(box[0, 2] - z, 0.0, z - box[1, 2])
    return dx * dx + dy * dy + dz * dz


@inner
def _share(over: float, of: float) -> float:
    """Position of the nearest point on an edge, as a share of the edge, 0 to 1."""
    return over / of if of > 0.0 else 0.0


@inner
def _nearest_on(  # noqa: PLR0911 - seven regions
    t: Array, x: float, y: float, z: float
) -> tuple[int, float, float]:
    """Point of a triangle (3, 3) that is nearest to x, y, z.

    Returns:
        The feature on which the nearest point lies, as an index of a row of :func:`_pseudonormals`. Then the
        coordinates of this point: its share of the edge from corner 0 to 1, and its share of the edge from corner 0 to
        2.

    Source:
        Ericson 2005, Real-Time Collision Detection, section 5.1.5: regions of corners and edges.
    """
    ab0, ab1, ab2 = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    ac0, ac1, ac2 = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    p0, p1, p2 = x - t[0, 0], y - t[0, 1], z - t[0, 2]
    bb, cc = ab0 * ab0 + ab1 * ab1 + ab2 * ab2, ac0 * ac0 + ac1 * ac1 + ac2 * ac2
    bc = ab0 * ac0 + ab1 * ac1 + ab2 * ac2
    b, c = ab0 * p0 + ab1 * p1 + ab2 * p2, ac0 * p0 + ac1 * p1 + ac2 * p2
    if b <= 0.0 and c <= 0.0:
        return 1, 0.0, 0.0
    if b >= bb and c - bc <= b - bb:
        return 2, 1.0, 0.0
    if c >= cc and b - bc <= c - cc:
        return 3, 0.0, 1.0
    u, v = cc * b - bc * c, bb * c - bc * b  # coordinates of the point, times the square of twice the area
    if v <= 0.0 <= b <= bb:
        return 4, _share(b, bb), 0.0
    if u <= 0.0 <= c <= cc:
        return 6, 0.0, _share(c, cc)
    whole = bb * cc - bc * bc
    if u + v >= whole:
        along = _share((c - bc) - (b - bb), bb - 2.0 * bc + cc)
        return 5, 1.0 - along, along
    return 0, u / whole, v / whole


@inner
def _signed(tree: Tree, x: float, y: float, z: float, most: float) -> float:
    """Signed distance [m] of a point that is at most ``most`` [m] from a mesh; negative inside."""
    least, side = most * most, 1.0
    leaves, stack = tree.begin.shape[0] - 1, tree.stack
    stack[0], waiting = 1, 1
    while waiting:
        waiting -= 1
        node = stack[waiting]
        if _to_box(tree.boxes[node], x, y, z) > least:
            continue
        if node < leaves:
            left, right = (_to_box(tree.boxes[2 * node], x, y, z), _to_box(tree.boxes[2 * node + 1], x, y, z))
            nearer = 2 * node if left <= right else 2 * node + 1
            stack[waiting], stack[waiting + 1] = 4 * node + 1 - nearer, nearer
            waiting += 2
            continue
        for i in range(tree.begin[node - leaves], tree.begin[node - leaves + 1]):
            t = tree.corners[i]
            on, u, v = _nearest_on(t, x, y, z)
            square = along = 0.0
            for k in range(3):
                place = x if k == 0 else y if k == 1 else z
                way = place - t[0, k] - u * (t[1, k] - t[0, k]) - v * (t[2, k] - t[0, k])
                square += way * way
                along += way * tree.normals[i, on, k]
            if square < least:
                least, side = square, along
    return math.copysign(math.sqrt(least), side)


@kernel
def write_distances(tree: Tree, first: Array, step: float, distances: Array) -> None:
    """Write the signed distances (N, M) [m] of points that are ``step`` [m] apart along y and z.

    Args:
        tree: Tree of the mesh.
        first: Point of ``distances[0, 0]`` (3,) [m].
        step: Distance between points [m].
        distances: Signed distances (N, M) [m]; written.
    """
    for j in range(distances.shape[0]):
        most = 1e9
        for k in range(distances.shape[1]):
            found = _signed(tree, first[0], first[1] + j * step, first[2] + k * step, most)
            distances[j, k] = found
            most = abs(found) + 1.001 * step  # from one point to the next the distance grows by at most the step
