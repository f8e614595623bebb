"""Heights: the surface of a block, read from a table, as triangles.

Between the heights of the table the surface is a cubic spline. The surface is cut into triangles half a step of the
distance grid wide, so that the hand does not feel their edges.
"""

import io
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array
from teleop_core.shapes.basis import spline, triangles

FIELD = "height_field"
THICKNESS = 0.02
"""Thickness of the block below the lowest height [m]."""
_LEAST = 4  # least number of heights along x and along y
_MOST = 400_000  # largest number of points of the surface


def read_heights(path: Path, data: bytes, spacing: float, step: float) -> triangles.Triangles:
    """Read a table of heights and make a closed block from it; the middle of the block is at height 0.

    Args:
        path: Path of the file, for messages; its ending gives the format: ``.npy``, or else CSV.
        data: Content of the file: heights [m], a row for each x, a column for each y.
        spacing: Distance between neighbouring heights [m].
        step: Step of the distance grid [m].

    Raises:
        ParameterError: The file is not a table of finite heights, or the table is too large for the step.
    """
    heights = _table(path, data)
    parts = math.ceil(2.0 * spacing / step)
    nodes = tuple(parts * (n - 1) + 1 for n in heights.shape)
    if math.prod(nodes) > _MOST:
        fits = 2.0 * spacing * math.sqrt(heights.size / _MOST)
        text = f"at least {max(fits, 1.2 * step):.2g} m for a field with this number of heights"
        raise ParameterError(f"{FIELD}.step", step, text)
    for axis in range(2):
        lines = np.ascontiguousarray(np.moveaxis(heights, axis, 0))[None]
        spline.write_spline(lines)
        between = np.empty((1, nodes[axis], lines.shape[2]))
        spline.write_between(lines, between)
        heights = np.moveaxis(between[0], 0, axis)
    return _block(np.ascontiguousarray(heights), spacing / parts)


def _table(path: Path, data: bytes) -> Array:
    """Heights (N, M) [m] of a file.

    Raises:
        ParameterError: The file contains no heights.
    """
    try:
        if path.suffix.lower() == ".npy":
            table = np.load(io.BytesIO(data), allow_pickle=False)
        else:
            table = np.loadtxt(io.StringIO(data.decode()), delimiter=",", ndmin=2)
        heights = np.array(table, np.float64)
    except Exception as error:  # a third-party reader may raise anything for an arbitrary file
        reason = str(error).partition("\n")[0]
        text = f"a table of heights [m], CSV or .npy ({type(error).__name__}: {reason})"
        raise ParameterError(f"{FIELD}.file", str(path), text) from error
    if heights.ndim != 2 or min(heights.shape) < _LEAST or not np.isfinite(heights).all():
        text = f"a table of {_LEAST} x {_LEAST} finite heights at least; its shape is "
        raise ParameterError(f"{FIELD}.file", str(path), f"{text}{heights.shape}")
    return heights


def _block(heights: Array, width: float) -> triangles.Triangles:
    """Block with a flat bottom below heights (N, M) [m]; neighbouring heights are ``width`` [m] apart."""
    rows, columns = heights.shape
    x = width * (np.arange(rows) - 0.5 * (rows - 1))
    y = width * (np.arange(columns) - 0.5 * (columns - 1))
    top = np.stack((*np.meshgrid(x, y, indexing="ij"), heights), axis=2).reshape(-1, 3)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    rim: NDArray[np.int64] = np.concatenate(
        (index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1])
    )  # counterclockwise seen from above
    floor = float(heights.min()) - THICKNESS
    below = top[rim]
    below[:, 2] = floor
    low = rows * columns + np.arange(len(rim))
    middle = np.full(len(rim), rows * columns + len(rim))
    after, low_after = np.roll(rim, -1), np.roll(low, -1)
    faces = ((a, b, c), (a, c, d), (rim, low, low_after), (rim, low_after, after), (low, middle, low_after))
    return triangles.Triangles(
        np.vstack((top, below, (0.0, 0.0, floor))), np.concatenate([np.stack(corners, axis=1) for corners in faces])
    )
