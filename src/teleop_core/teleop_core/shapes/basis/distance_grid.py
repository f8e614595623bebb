"""Distance grid: distances of points from a mesh or height field, computed once and stored in the user's cache.

The key in the cache is the digest of the file and of everything else that the grid depends on. So all sessions share a
grid, and a changed file gets a new grid.
"""

import hashlib
import io
import math
import os
import tempfile
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from teleop_core.base import ParameterError
from teleop_core.kernels import Array, dot, product, rotation
from teleop_core.kernels.progress import told
from teleop_core.kernels.store import user_cache
from teleop_core.shapes.basis import directions, heights, spline
from teleop_core.shapes.basis.triangles import (
    Triangles,
    edges_of,
    read_triangles,
    tree_of,
    unit_normals,
    write_distances,
)

HEADER = 7
"""Number of values before the coefficients of the spline: nodes along x, y, z; step [m]; first node (3,) [m]."""
EDGE = 2
"""Number of nodes at each end of the grid that are not used, because the spline is straight there."""
_MADE = "1"  # version of the conversion; change it when the code converts a file differently
_MOST = 4_000_000  # largest number of nodes of a grid: 32 MB
_SIDES = (1e-3, 2.0)  # least and largest length of a mesh's longest side [m]
_THINNEST = 4.0  # least number of steps across the shortest side of a mesh
_SHARP = math.cos(math.radians(30.0))


class GridRequest(NamedTuple):
    """Everything that a grid depends on.

    Attributes:
        file: Path of the mesh or the heights.
        scale: Length of the unit of a mesh, or distance between neighbouring heights of a field [m].
        angles: Rotation angles of a mesh [rad]; empty for a field of heights.
        step: Distance between nodes of the grid [m].
        kind: Name of the shape.
    """

    file: str
    scale: float
    angles: tuple[float, ...]
    step: float
    kind: str = "mesh"

    def error(self, name: str, value: object, text: str) -> ParameterError:
        """Error about ``file``, ``scale`` or ``step`` that contains the name of the shape's parameter."""
        is_spacing = name == "scale" and self.kind != "mesh"
        full = f"{self.kind}.{'spacing' if is_spacing else name}"
        return ParameterError(full, value, text)


class DistanceGrid(NamedTuple):
    """Distances from a mesh, and its outline.

    Attributes:
        numbers: Header, then the coefficients of the cubic spline through the distances [m]; the index along z changes
            fastest.
        outline: Lines (N, 3) [m] with a row of NaN between two lines.
    """

    numbers: Array
    outline: Array


def distance_grid(request: GridRequest) -> DistanceGrid:
    """Grid of a mesh, from the user's cache if the cache contains it; computing a grid takes seconds.

    Raises:
        ParameterError: The file does not exist, is neither a closed mesh with a volume nor a field of heights, or does
            not fit the scale or the step; see :func:`read_triangles` and :func:`read_heights`.
    """
    path = Path(request.file).expanduser()
    try:
        data = path.read_bytes()
    except OSError as error:
        what = "a mesh, such as an STL or OBJ" if request.kind == "mesh" else "heights, CSV or .npy"
        text = f"a file with {what}" + (f" ({error.strerror})" if request.file else "")
        raise request.error("file", request.file, text) from error
    about = (_MADE, path.suffix.lower(), *map(repr, request[1:5]))
    return _found(hashlib.sha256("\n".join(about).encode() + data).hexdigest(), request)


@lru_cache(maxsize=4)
def _found(digest: str, request: GridRequest) -> DistanceGrid:
    """Grid of a digest: from memory, from the user's cache, or newly computed."""
    folder = user_cache("grids")
    if folder is None:
        return _make(request)
    kept = folder / f"{digest}.npz"
    grid = _loaded(kept)
    if grid is None:
        grid = _make(request)
        _keep(kept, grid)
    return grid


def _loaded(kept: Path) -> DistanceGrid | None:
    """Content of a file of the cache; None if the file is missing or incomplete."""
    try:
        with np.load(io.BytesIO(kept.read_bytes())) as file:
            grid = DistanceGrid(file["numbers"], file["outline"])
        os.utime(kept)  # records that the grid was used; see teleop_core.kernels.store.prune
    except Exception:  # a damaged archive may raise anything
        return None
    is_whole = len(grid.numbers) == HEADER + grid.numbers[:3].prod()
    return grid if is_whole else None


def _keep(kept: Path, grid: DistanceGrid) -> None:
    """Write a grid to the user's cache, if there is a cache; readers never see an incomplete file."""
    with suppress(OSError):
        kept.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=kept.parent, delete=False) as file:
            np.savez(file, numbers=grid.numbers, outline=grid.outline)
        os.replace(file.name, kept)


def _make(request: GridRequest) -> DistanceGrid:
    """Read a file, make its grid, and report the progress."""
    path, step = Path(request.file).expanduser(), request.step
    with told(f"making the distance grid of {path.name}") as tell:
        triangles = _read(request, path)
        low, high = triangles.points.min(axis=0), triangles.points.max(axis=0)
        _check_size(request, high - low)
        nodes = _nodes(high - low, step)
        first = 0.5 * (low + high) - 0.5 * step * (np.array(nodes) - 1)
        tree, distances = tree_of(triangles), np.empty(nodes)
        for i in range(nodes[0]):
            tell(f"{100 * i // nodes[0]} %")
            write_distances(tree, first + i * step * np.eye(3)[0], step, distances[i])
        for i in range(3):  # the spline along x, y and z
            spline.write_spline(distances.reshape(math.prod(nodes[:i]), nodes[i], -1))
    numbers = np.concatenate((nodes, (step,), first, distances.ravel()))
    return DistanceGrid(numbers, _outline(triangles))


def _read(request: GridRequest, path: Path) -> Triangles:
    if request.kind != "mesh":
        return heights.read_heights(path, path.read_bytes(), request.scale, request.step)
    x, y, z = request.angles
    turned = product(rotation("z", z), product(rotation("y", y), rotation("x", x)))
    return read_triangles(path, path.read_bytes(), request.scale * turned)


def _nodes(size: Array, step: float) -> list[int]:
    """Numbers of nodes of a grid for a mesh of a size (3,) [m]; a tip at the end of the grid is not near the mesh."""
    around = np.ceil((size + 2.0 * directions.NEAR) / step).astype(np.int64)
    return (around + 3 + 2 * EDGE).tolist()


def _check_size(request: GridRequest, size: Array) -> None:
    """Raise an error if a mesh of a size (3,) [m] does not fit its scale or its step.

    Raises:
        ParameterError: The mesh is too small, too large or too thin, or its grid would be too large.
    """
    longest = float(size.max())
    if not _SIDES[0] <= longest <= _SIDES[1]:
        text = (
            f"so that the {request.kind.replace('_', ' ')}, now {longest:.3g} m long, is between "
            f"{_SIDES[0]:g} and {_SIDES[1]:g} m long"
        )
        raise request.error("scale", request.scale, text)
    fits = request.step
    while math.prod(_nodes(size, fits)) > _MOST:
        fits *= 1.05
    if fits > request.step:
        text = f"at least {fits:.2g} m for an object of this size: the grid would be too large"
        raise request.error("step", request.step, text)
    if (shortest := float(size.min())) < _THINNEST * request.step:
        text = f"at most {shortest / _THINNEST:.2g} m for an object as thin as this one"
        raise request.error("step", request.step, text)


def _outline(triangles: Triangles) -> Array:
    """Sharp edges of a mesh and three sections through its middle, (N, 3) [m], with rows of NaN between the lines."""
    from trimesh import Trimesh
    from trimesh.intersections import mesh_plane

    points, faces = triangles
    edges = np.sort(edges_of(faces), axis=1)
    order = np.lexsort(edges.T)  # places the two occurrences of each edge next to each other
    normals = np.tile(unit_normals(triangles), (3, 1))[order]
    is_sharp = dot(normals[::2], normals[1::2]) < _SHARP
    lines = [points[edges[order][::2][is_sharp]]]
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    mesh = Trimesh(points, faces, process=False)
    lines += [mesh_plane(mesh, normal, middle).reshape(-1, 2, 3) for normal in np.eye(3)]
    every = np.concatenate(lines)
    drawn = np.full((len(every), 3, 3), np.nan)
    drawn[:, :2] = every
    return drawn.reshape(-1, 3)
