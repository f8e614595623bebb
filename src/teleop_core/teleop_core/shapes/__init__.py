"""Shapes: bodies with a signed distance to a point, and with lines to draw them.

Each shape is one file of this folder. A virtual fixture constrains the hand to the inside or outside of a shape
(:mod:`teleop_core.coupling.fixtures`); an object that the slave's tool touches has a shape
(:mod:`teleop_core.slave.world`).
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pkgutil import iter_modules
from typing import Any

import numpy as np

from teleop_core.base import PartError, Registry, part_check, values_of
from teleop_core.base.registry import places, tried
from teleop_core.kernels import Array, fenced, is_whole, numbers_of, pointer

__all__ = ["SHAPES", "Shape", "files_of", "moved", "register_shape"]

_ROW = "float64[::1]"
DISTANCE = f"float64({_ROW}, {_ROW}, {_ROW})"
"""Signature of a distance kernel, so that one compiled stage serves every shape."""


@dataclass(frozen=True)
class Shape:
    """A body in space.

    Attributes:
        name: Name of the shape in ``--set fixture=`` and ``--set world=``.
        parameters: Parameter group of the shape: real numbers and tuples of numbers. A text parameter ``file`` is the
            path of a file; recordings store a copy of this file.
        distance: ``distance(offset, numbers, out)``, a kernel or a plain function. ``offset`` (3,) [m] runs from the
            middle of the shape to a point; ``numbers`` contains the parameters in their order. The outward normal of
            the nearest surface is written to ``out`` (3,), with any length except 0. The kernel returns the distance of
            the point from the surface [m], negative inside.
        outline: ``outline(parameters)`` returns points (N, 3) [m] of a line along the edges, relative to the middle; a
            row of NaN interrupts the line.
        numbers: ``numbers(parameters)`` returns the ``numbers`` of ``distance``, if they differ from the parameters.
    """

    name: str
    parameters: type
    distance: Callable[[Array, Array, Array], float]
    outline: Callable[[Any], Array]
    numbers: Callable[[Any], Array] = numbers_of

    pointer = cached_property(lambda self: pointer(self.distance, DISTANCE))
    """The distance as an argument for kernels."""


_FILE = re.compile(r"""\bfile\s*=\s*['"]([^'"]*)['"]""")  # file name in the text of a part


def files_of(parameters: object) -> list[str]:
    """Names of the files in a shape's parameters, including those of its parts."""
    found: list[str] = []
    for name, value in values_of(parameters).items():
        if name == "file":
            found.append(str(value))
        for text in value if isinstance(value, tuple) else ():
            found += _FILE.findall(str(text))
    return found


def moved(value: Any, files: Mapping[str, str]) -> Any:
    """Value of a parameter with its file paths replaced by the present paths in ``files``."""
    if isinstance(value, list | tuple):
        return type(value)(moved(element, files) for element in value)
    if not isinstance(value, str):
        return value
    return files.get(value) or _FILE.sub(lambda said: said[0].replace(said[1], files.get(said[1], said[1])), value)


_STEP = 1e-6  # over a step outwards of this length [m], the distance must grow by this length
_TRIED = np.array([(0.31, 0.02, 0.05), (0.01, 0.43, -0.03), (-0.02, 0.04, 0.37), (-0.29, 0.23, -0.41)])
"""Offsets at which a shape is tried [m]."""


def _try(part: Shape) -> None:
    """Try a shape at some points, so that errors are reported before anything runs."""
    needs = (
        "one with distance(offset, numbers, out) -> float, outline(parameters) -> (N, 3) and "
        "parameters that all have defaults"
    )
    with tried("shape", part.name, needs):
        parameters = part.parameters()
        points = np.asarray(part.outline(parameters), np.float64)
        numbers = part.numbers(parameters)
        faults = (_fault_at(part, numbers, offset) for offset in _TRIED)
        fault = next(filter(None, faults), "")
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).any():
        fault = f"an outline (N, 3) of finite points, not {points.shape}"
    if fault:
        raise PartError("shape", part.name, f"one with {fault}")


def _fault_at(part: Shape, numbers: Array, offset: Array) -> str:
    """Requirement that the shape violates at one point; empty if it meets all requirements."""
    (given, _), (out, fence) = fenced(numbers), fenced(np.zeros(3))
    distance = float(part.distance(offset, given, out))
    size, place = float(np.linalg.norm(out)), f"at {offset.tolist()} m from its middle"
    if not is_whole(fence):
        return f"a distance that writes three numbers to out; {place} it writes more"
    if not np.isfinite([distance, *out]).all() or size == 0.0:
        return f"a finite distance and an out other than 0; {place} {distance!r}, {out.tolist()}"
    farther = float(part.distance(offset + _STEP / size * out, given, np.zeros(3)))
    if not abs(farther - distance - _STEP) <= 1e-2 * _STEP:
        growth = (farther - distance) / _STEP
        return f"a distance that grows along out at the same rate; {place} it grows by {growth:.3g} times that"
    return ""


SHAPES: Registry[Shape] = Registry(
    "shape",
    "shapes",
    places("teleop_core.shapes", " ".join(m.name for m in iter_modules(__path__) if not m.ispkg)),
    part_check("shape", Shape, "distance", "outline"),
    _try,
)
"""All shapes by name: every file of this folder contains one."""

register_shape = SHAPES.register
"""Adds your shape under its own name; see :meth:`Registry.register`."""
