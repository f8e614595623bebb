"""Combined: shapes made of several other shapes; each part is given by a text such as ``sphere radius=0.01``."""

import ast
import math
import re
from collections.abc import Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np

from teleop_core.base import ParameterError, build, parameter
from teleop_core.kernels import Array, inner, kernel_from_source
from teleop_core.shapes import SHAPES, Shape
from teleop_core.shapes.basis.drawing import with_lifts

PARTS = tuple(name for name in SHAPES.builtin if name not in {"intersection", "union"})
"""Shapes that can be parts. The index of a shape in this tuple is its number in :func:`part_distance`."""
MOST = 8
"""Largest number of parts."""
# Each part has these numbers before its own: index in PARTS, count of own numbers, side, and middle (3,) [m].
_HEAD = 6
_SETTING = re.compile(r"(\w+)\s*=\s*(.*?)\s*(?=\s\w+\s*=|$)")
_NOT = "not "


def parts_parameter(default: tuple[str, ...], doc: str) -> Any:
    """Field of a parameter group that holds the texts of parts."""
    doc += f"; each part is one of {', '.join(PARTS)}, followed by its parameters and at=[x, y, z] of its middle"
    return parameter(default, doc=f"{doc}; not before it: what is outside of that shape")


class ShapePart(NamedTuple):
    """A part of a shape.

    Attributes:
        kind: Shape of the part.
        parameters: Parameters of that shape.
        side: 1 for the inside of the shape, -1 for everything outside it.
        at: Middle of the part, relative to the middle of the whole shape (3,) [m].
    """

    kind: Shape
    parameters: Any
    side: float
    at: Array


def parts_of(texts: tuple[str, ...], name: str) -> list[ShapePart]:
    """Parts that texts describe.

    Args:
        texts: Such as ``not cylinder radius=0.01 direction=[1.0, 0.0, 0.0] at=[0.0, 0.01, 0.0]``.
        name: Name of the parameter, for messages.

    Raises:
        ParameterError: There is no part or more than :data:`MOST`, or a text does not describe a part.
        UnknownNameError: A text names a parameter that the part does not have.
    """
    if not 1 <= len(texts) <= MOST:
        raise ParameterError(name, texts, f"1 to {MOST} parts, such as 'sphere radius=0.01'")
    return [_part(text, f"{name}[{i}]") for i, text in enumerate(texts)]


def _part(text: str, name: str) -> ShapePart:
    kind, _, rest = text.strip().removeprefix(_NOT).strip().partition(" ")
    if kind not in PARTS:
        raise ParameterError(name, text, f"a text that begins with one of {', '.join(PARTS)}")
    if _SETTING.sub("", rest).strip():
        raise ParameterError(name, text, f"{kind}, then settings such as at=[0.0, 0.01, 0.0]")
    values: dict[str, Any] = {key: _value(value, f"{name} {key}") for key, value in _SETTING.findall(rest)}
    at = values.pop("at", (0.0, 0.0, 0.0))
    if not isinstance(at, tuple) or len(at) != 3 or not np.isfinite(at).all():
        raise ParameterError(f"{name} at", at, "x, y, z of the part's middle [m]")
    found, side = SHAPES.find(kind), -1.0 if text.strip().startswith(_NOT) else 1.0
    return ShapePart(found, build(found.parameters, values, f"{name} "), side, np.array(at, np.float64))


def _value(text: str, name: str) -> str | float | tuple[float, ...]:
    try:
        value = ast.literal_eval(text)
        if isinstance(value, str):
            return value
        return tuple(map(float, value)) if isinstance(value, list | tuple) else float(value)
    except (ValueError, TypeError, SyntaxError):
        text_of = "a number, numbers in brackets, or a name in quotes"
        raise ParameterError(name, text, text_of) from None


class Combined(Protocol):
    """Parameters of a shape that is made of other shapes."""

    @property
    def parts(self) -> tuple[str, ...]:
        """Option strings of the shapes that form this shape, such as ``sphere radius=0.01``."""


def numbers_of_parts(parameters: Combined) -> Array:
    """Numbers that :func:`part_distance` reads: the number of parts, then the numbers of each part."""
    rows: list[Array] = [np.array([len(parameters.parts)], np.float64)]
    for part in parts_of(parameters.parts, "parts"):
        numbers = part.kind.numbers(part.parameters)
        rows += [np.array([PARTS.index(part.kind.name), len(numbers), part.side, *part.at]), numbers]
    return np.concatenate(rows)


def outline_of_parts(parameters: Combined) -> Array:
    """Complete outlines of all parts, (N, 3) [m] relative to the middle; hidden lines are included."""
    parts = parts_of(parameters.parts, "parts")
    return with_lifts([part.kind.outline(part.parameters) + part.at for part in parts])


def _chain() -> Iterator[str]:
    yield "def distance_of(kind, offset, numbers, out):"
    for place, name in enumerate(PARTS):
        yield f"    if kind == {place}:"
        yield f"        return {name}(offset, numbers, out)"
    yield "    return 0.0"


_distance_of = kernel_from_source(
    "\n".join(_chain()) + "\n", "distance_of", {name: SHAPES.find(name).distance for name in PARTS}
)


@inner
def next_part(numbers: Array, first: int) -> int:
    """Index of the first number of the part after the part that begins at ``first``; the first part begins at 1."""
    return first + _HEAD + int(numbers[first + 1])


@inner
def part_distance(place: Array, numbers: Array, first: int, out: Array) -> float:
    """Write the outward direction of a part (3,); return the distance [m] of a point (3,) outside it.

    Args:
        place: The point (3,) [m], relative to the middle of the whole shape.
        numbers: Numbers of all parts.
        first: Index of the first number of this part.
        out: Outward direction, written; a vector of any length.
    """
    offset, side = np.empty(3), numbers[first + 2]
    for i in range(3):
        offset[i] = place[i] - numbers[first + 3 + i]
    own = numbers[first + _HEAD : next_part(numbers, first)]
    distance = _distance_of(int(numbers[first]), offset, own, out)
    for i in range(3):
        out[i] *= side
    return side * distance


@inner
def extreme_part(place: Array, numbers: Array, sign: float, out: Array) -> float:
    """Write the outward direction of the part with the largest (sign 1) or smallest (-1) distance.

    Of parts with equal distances the first is taken.

    Args:
        place: The point (3,) [m], relative to the middle of the whole shape.
        numbers: Numbers of all parts.
        sign: 1 or -1.
        out: Outward direction, written; a vector of any length.

    Returns:
        Distance of the point outside that part [m].
    """
    way, first, found = np.empty(3), 1, -math.inf * sign
    for _ in range(int(numbers[0])):
        distance = part_distance(place, numbers, first, way)
        if sign * (distance - found) > 0.0:
            found = distance
            for i in range(3):
                out[i] = way[i]
        first = next_part(numbers, first)
    return found
