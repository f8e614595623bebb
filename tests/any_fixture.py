"""Any fixture: parameters of every shape for hypothesis, and the depth at a place."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from teleop_core.base.errors import ParameterError
from teleop_core.chain.fixtures import FIXTURES
from teleop_core.chain.fixtures.box import BoxParameters
from teleop_core.chain.fixtures.cone import ConeParameters
from teleop_core.chain.fixtures.cylinder import CylinderParameters
from teleop_core.chain.fixtures.half_space import HalfSpaceParameters
from teleop_core.chain.fixtures.keep_out import KeepOutBoxParameters, KeepOutSphereParameters
from teleop_core.chain.fixtures.line import LineParameters
from teleop_core.chain.fixtures.path import PathParameters
from teleop_core.chain.fixtures.sphere import SphereParameters
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.parts import numbers_of

lengths = st.floats(1e-3, 0.1)
places = st.tuples(*[st.floats(-0.1, 0.1)] * 3)
directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 1e-3)
sizes = st.tuples(lengths, lengths, lengths)
endings = st.one_of(st.just(0.0), lengths)


def valid(group: type[object], **values: SearchStrategy) -> SearchStrategy:
    """Groups of parameters, those that do not fit together left out."""

    def make(chosen: Mapping[str, float | tuple[float, float, float]]) -> Any:
        try:
            return group(**chosen)
        except ParameterError:
            return None

    return st.fixed_dictionaries(values).map(make).filter(lambda made: made is not None)


KINDS = {
    "box": valid(BoxParameters, size=sizes),
    "sphere": valid(SphereParameters, diameter=lengths),
    "cylinder": valid(CylinderParameters, diameter=lengths, length=endings, direction=directions),
    "half_space": valid(HalfSpaceParameters, normal=directions, room=st.floats(0.0, 0.1)),
    "cone": st.builds(
        lambda axis, far, half: ConeParameters(
            axis=axis, half_angle=half, apex=tuple(-far * x / math.hypot(*axis) for x in axis)
        ),
        directions, lengths, st.floats(0.05, 1.5),
    ),
    "line": valid(
        LineParameters, direction=directions, tolerance=st.floats(0.0, 0.02), length=endings
    ),
    "path": valid(
        PathParameters, tolerance=st.floats(0.0, 0.02),
        points=st.lists(places, min_size=1, max_size=5).map(lambda rows: sum(rows, ())),
    ),
    "keep_out_sphere": valid(KeepOutSphereParameters, place=places, diameter=lengths),
    "keep_out_box": valid(KeepOutBoxParameters, place=places, size=sizes),
}  # fmt: skip


def found(name: str, parameters: Any, offset: Sequence[float] | Array) -> Any:
    """Depth and way of a fixture at a place (3,)."""
    out = np.full(3, math.nan)
    depth = FIXTURES.find(name).depth(np.array(offset, dtype=float), numbers_of(parameters), out)
    return depth, out


PER_PIECE = 2001

# What is allowed, said a second time: how far beyond it a point (..., 3) is, by some measure [m].


def beyond_cylinder(p: CylinderParameters, points: Array) -> float:
    x, y, z = np.moveaxis(turned(p.direction, points), -1, 0)
    ends = np.abs(z) - 0.5 * p.length if p.length else np.full(z.shape, -1.0)
    return np.maximum(np.hypot(x, y) - 0.5 * p.diameter, ends)


def beyond_half_space(p: HalfSpaceParameters, points: Array) -> Any:
    return -p.room - turned(p.normal, points)[..., 2]


def beyond_cone(p: ConeParameters, points: Array) -> float:
    x, y, z = np.moveaxis(turned(p.axis, points - np.array(p.apex)), -1, 0)
    far, angle = np.hypot(np.hypot(x, y), z), np.arctan2(np.hypot(x, y), z)
    return far * (angle - p.half_angle)


def beyond_line(p: LineParameters, points: Array) -> float:
    x, y, z = np.moveaxis(turned(p.direction, points), -1, 0)
    over = np.maximum(np.abs(z) - 0.5 * p.length, 0.0) if p.length else 0.0
    return np.sqrt(x**2 + y**2 + over**2) - p.tolerance


def beyond_path(p: PathParameters, points: Array) -> Any:
    along = pieces(p).reshape(-1, 3)
    apart = [np.linalg.norm(point - along, axis=1).min() for point in points.reshape(-1, 3)]
    return np.reshape(apart, points.shape[:-1]) - p.tolerance


def turned(direction: Sequence[float] | Array, points: Array) -> Array:
    """Points in axes at right angles whose z is a direction; no matter how the others look."""
    axes = np.linalg.svd(np.array([direction]))[2]  # rows: the direction or against it, two others
    z = points @ (np.array(direction) / math.hypot(*direction))
    return np.stack((points @ axes[1], points @ axes[2], z), axis=-1)


def pieces(p: PathParameters) -> Array:
    """Points close together along every piece of a path, (pieces, PER_PIECE, 3)."""
    corners = np.vstack((np.zeros(3), np.reshape(p.points, (-1, 3))))
    share = np.linspace(0.0, 1.0, PER_PIECE)[:, None]
    return np.stack([a + share * (b - a) for a, b in itertools.pairwise(corners)])


BEYOND: dict[str, Callable[[Any, Array], Any]] = {
    "box": lambda p, x: (np.abs(x) - 0.5 * np.array(p.size)).max(axis=-1),
    "sphere": lambda p, x: np.linalg.norm(x, axis=-1) - 0.5 * p.diameter,
    "cylinder": beyond_cylinder,
    "half_space": beyond_half_space,
    "cone": beyond_cone,
    "line": beyond_line,
    "path": beyond_path,
    "keep_out_sphere": lambda p, x: 0.5 * p.diameter - np.linalg.norm(x - p.place, axis=-1),
    "keep_out_box": lambda p, x: (0.5 * np.array(p.size) - np.abs(x - p.place)).min(axis=-1),
}
THIN = {"line", "path"}
"""Those that may have no room at all: points around a place would miss them."""


def a_ball_of_points() -> Array:
    """Points (N, 3) that fill a ball of radius 1, most of them near its surface."""
    rng = np.random.default_rng(1)
    rays = rng.normal(size=(6000, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    return rays * (1.0 - 1e-6 - np.repeat([0.0, 1e-3, 0.02, 0.2, 0.5, 0.9], 1000))[:, None]


BALL = a_ball_of_points()
