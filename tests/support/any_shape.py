"""Any shape: parameters of every one for hypothesis, and what is outside of it, said once more."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from teleop_core.base import ParameterError
from teleop_core.coupling.fixtures import Fixture, Held, fixture_depth
from teleop_core.kernels import Array, kernel
from teleop_core.shapes import SHAPES, box, capsule, cone, cylinder, half_space, hole, line, path, plane, sphere

lengths = st.floats(1e-3, 0.1)
places = st.tuples(*[st.floats(-0.1, 0.1)] * 3)
directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 1e-3)
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
    "box": valid(box.BoxParameters, size=st.tuples(lengths, lengths, lengths)),
    "sphere": valid(sphere.SphereParameters, radius=lengths),
    "cylinder": valid(cylinder.CylinderParameters, radius=lengths, length=endings, direction=directions),
    "capsule": valid(capsule.CapsuleParameters, radius=lengths, length=endings, direction=directions),
    "half_space": valid(half_space.HalfSpaceParameters, normal=directions, room=st.floats(0.0, 0.1)),
    "plane": valid(plane.PlaneParameters, normal=directions),
    "cone": st.builds(
        lambda axis, far, half: cone.ConeParameters(
            axis=axis, half_angle=half, apex=tuple(-far * x / math.hypot(*axis) for x in axis)
        ),
        directions,
        lengths,
        st.floats(0.05, 1.5),
    ),
    "line": valid(line.LineParameters, direction=directions, radius=st.floats(0.0, 0.02), length=endings),
    "path": valid(
        path.PathParameters,
        radius=st.floats(0.0, 0.02),
        points=st.lists(places, min_size=1, max_size=5).map(lambda rows: sum(rows, ())),
    ),
    "hole": valid(
        hole.HoleParameters,
        radius=lengths,
        thickness=lengths,
        plate_radius=lengths,
        chamfer=st.floats(0.0, 0.02),
        axis=directions,
    ),
}
THIN = {"line", "path"}
"""Those that may be too thin for points around a place to meet them."""


def found(name: str, parameters: object, offset: Sequence[float] | Array) -> tuple[float, Array]:
    """Distance of a place (3,) from a shape, and the way out, of length 1."""
    part, out = SHAPES.find(name), np.full(3, math.nan)
    distance = part.distance(np.array(offset, dtype=float), part.numbers(parameters), out)
    return distance, out / np.linalg.norm(out)


@kernel
def _depth(held: Held, offset: Array, out: Array) -> float:
    return fixture_depth(held, offset, out)


def depth_of(fixture: Fixture, offset: Sequence[float] | Array) -> tuple[float, Array]:
    """How far a place (3,) is outside of what a fixture allows, and the way there."""
    out = np.full(3, math.nan)
    return _depth(fixture.held, np.array(offset, dtype=float), out), out


PER_PIECE = 2001

# What is inside, said a second time: how far beyond it a point (..., 3) is, by some measure [m].


def beyond_tube(p: Any, points: Array, length: float) -> Any:
    x, y, z = np.moveaxis(turned(p.direction, points), -1, 0)
    over = np.maximum(np.abs(z) - 0.5 * length, 0.0)
    return np.sqrt(x**2 + y**2 + over**2) - p.radius


def beyond_cylinder(p: cylinder.CylinderParameters, points: Array) -> Any:
    x, y, z = np.moveaxis(turned(p.direction, points), -1, 0)
    return np.maximum(np.hypot(x, y) - p.radius, np.abs(z) - 0.5 * (p.length or math.inf))


def beyond_cone(p: cone.ConeParameters, points: Array) -> Any:
    x, y, z = np.moveaxis(turned(p.axis, points - np.array(p.apex)), -1, 0)
    far, angle = np.hypot(np.hypot(x, y), z), np.arctan2(np.hypot(x, y), z)
    return far * (angle - p.half_angle)


def beyond_path(p: path.PathParameters, points: Array) -> Any:
    along = pieces(p).reshape(-1, 3)
    apart = [np.linalg.norm(point - along, axis=1).min() for point in points.reshape(-1, 3)]
    return np.reshape(apart, points.shape[:-1]) - p.radius


def beyond_hole(p: hole.HoleParameters, points: Array) -> Any:
    x, y, up = np.moveaxis(turned(p.axis, points), -1, 0)
    out = np.hypot(x, y)
    faces = (up, -p.thickness - up, out - p.plate_radius, p.radius - out, up - out + p.radius + p.chamfer)
    return np.max(faces, axis=0)


def turned(direction: Sequence[float] | Array, points: Array) -> Array:
    """Points in axes at right angles whose z is a direction; no matter how the others look."""
    axes = np.linalg.svd(np.array([direction]))[2]  # rows: the direction or against it, two others
    z = points @ (np.array(direction) / math.hypot(*direction))
    return np.stack((points @ axes[1], points @ axes[2], z), axis=-1)


def pieces(p: path.PathParameters) -> Array:
    """Points close together along every piece of a path, (pieces, PER_PIECE, 3)."""
    corners = np.vstack((np.zeros(3), np.reshape(p.points, (-1, 3))))
    share = np.linspace(0.0, 1.0, PER_PIECE)[:, None]
    return np.stack([a + share * (b - a) for a, b in itertools.pairwise(corners)])


BEYOND: dict[str, Callable[[Any, Array], Any]] = {
    "box": lambda p, x: (np.abs(x) - 0.5 * np.array(p.size)).max(axis=-1),
    "sphere": lambda p, x: np.linalg.norm(x, axis=-1) - p.radius,
    "cylinder": beyond_cylinder,
    "capsule": lambda p, x: beyond_tube(p, x, p.length),
    "half_space": lambda p, x: -p.room - turned(p.normal, x)[..., 2],
    "plane": lambda p, x: turned(p.normal, x)[..., 2],
    "cone": beyond_cone,
    "line": lambda p, x: beyond_tube(p, x, p.length or math.inf),
    "path": beyond_path,
    "hole": beyond_hole,
}


def a_ball_of_points() -> Array:
    """Points (N, 3) that fill a ball of radius 1, most of them near its surface."""
    rng = np.random.default_rng(1)
    rays = rng.normal(size=(6000, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    return rays * (1.0 - 1e-6 - np.repeat([0.0, 1e-3, 0.02, 0.2, 0.5, 0.9], 1000))[:, None]


BALL = a_ball_of_points()
