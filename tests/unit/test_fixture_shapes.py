"""Shapes of fixtures: every one leads from a place to the nearest one that is allowed.

What is allowed is said a second time here, in another way: in axes turned to the shape, by angles,
or by points close together along a path.
"""

import hashlib
import math
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from any_fixture import BALL, BEYOND, KINDS, THIN, beyond_line, beyond_path, found, pieces, places
from teleop_core.base.errors import ParameterError
from teleop_core.base.parameters import build
from teleop_core.chain.fixtures import FIXTURES
from teleop_core.chain.fixtures.cone import ConeParameters
from teleop_core.chain.fixtures.cylinder import CylinderParameters
from teleop_core.chain.fixtures.half_space import HalfSpaceParameters
from teleop_core.chain.fixtures.keep_out import KeepOutBoxParameters, KeepOutSphereParameters
from teleop_core.chain.fixtures.line import LineParameters
from teleop_core.chain.fixtures.path import PathParameters, path_depth
from teleop_core.chain.mapping.parameters import FixtureParameters
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.parts import numbers_of

# Sums and products of numbers below one.
ROUNDING = 1e-14
# Of angles and turned axes, in which the second description is.
TURNED = 1e-12
# Shallower places are not compared with points around them [m].
SHALLOW = 1e-6


def a_place(data: st.DataObject, parameters: Any) -> Array:
    """Place (3,) [m] to try: one of all, or, beside a forbidden body, one within its size."""
    offset = np.array(data.draw(places))
    if not hasattr(parameters, "place"):
        return offset
    size = getattr(parameters, "size", None) or (parameters.diameter,) * 3
    return np.array(parameters.place) + 5.5 * offset * size  # a tenth more than it is wide


def test_every_fixture_there_is_is_tried_here() -> None:
    elsewhere = {"mesh", "keep_out_mesh", "union", "intersection"}
    assert set(FIXTURES.names()) - elsewhere == set(KINDS) == set(BEYOND)


@pytest.mark.parametrize("name", KINDS)
@given(st.data())
def test_way_is_as_long_as_the_depth_and_leads_from_a_place_that_is_allowed(
    name: str, data: Any
) -> None:
    parameters: Any = data.draw(KINDS[name])
    offset = a_place(data, parameters)
    depth, way = found(name, parameters, offset)
    assert depth >= 0.0
    assert math.isclose(np.linalg.norm(way), depth, rel_tol=TURNED, abs_tol=ROUNDING)
    assert found(name, parameters, offset - way)[0] <= ROUNDING
    off = step_of(parameters) if name == "path" else TURNED
    assert BEYOND[name](parameters, offset - way) <= off
    if BEYOND[name](parameters, offset) <= 0.0:
        assert depth <= TURNED


def step_of(p: PathParameters) -> float:
    """Largest distance from one of the points along a path to the next [m]."""
    return np.linalg.norm(np.diff(pieces(p), axis=1), axis=-1).max() + TURNED


@pytest.mark.parametrize("name", [name for name in KINDS if name not in THIN])
@given(st.data())
def test_no_place_that_is_allowed_is_nearer_than_the_depth(name: str, data: Any) -> None:
    parameters: Any = data.draw(KINDS[name])
    offset = a_place(data, parameters)
    depth, _ = found(name, parameters, offset)
    assume(depth > SHALLOW)
    assert (BEYOND[name](parameters, offset + depth * BALL) > 0.0).all()


@given(KINDS["line"], places)
def test_depth_beside_a_line_is_the_distance_from_it_beyond_what_is_free(
    p: LineParameters, offset: tuple[float, float, float]
) -> None:
    expected = max(float(beyond_line(p, np.array(offset))), 0.0)
    assert math.isclose(found("line", p, offset)[0], expected, abs_tol=TURNED)


@given(KINDS["path"], places)
@settings(max_examples=200)
def test_depth_beside_a_path_is_the_distance_from_the_nearest_of_its_points(
    p: PathParameters, offset: tuple[float, float, float]
) -> None:
    apart = float(beyond_path(p, np.array(offset))) + p.tolerance
    half = 0.5 * step_of(p)
    depth, _ = found("path", p, offset)
    nearest = math.sqrt(max(apart * apart - half * half, 0.0))
    assert nearest - p.tolerance - ROUNDING <= depth <= max(apart - p.tolerance, 0.0) + ROUNDING


@pytest.mark.parametrize("name", KINDS)
@given(st.data())
def test_depth_changes_by_no_more_than_one_moves(name: str, data: st.DataObject) -> None:
    parameters = data.draw(KINDS[name])
    here, there = a_place(data, parameters), a_place(data, parameters)
    share = data.draw(st.sampled_from([1.0, 1e-3, 1e-6]))
    there = here + share * (there - here)
    change = abs(found(name, parameters, here)[0] - found(name, parameters, there)[0])
    assert change <= np.linalg.norm(there - here) + ROUNDING


@pytest.mark.parametrize("name", KINDS)
@given(st.data())
def test_outline_is_drawn_where_the_wall_is(name: str, data: Any) -> None:
    parameters: Any
    part, parameters = FIXTURES.find(name), data.draw(KINDS[name])
    points = part.outline(parameters)
    points = points[np.isfinite(points).all(axis=1)]
    beyond = BEYOND[name](parameters, points)
    if name in THIN:  # the line itself, in the middle of what is free
        beyond = beyond + parameters.tolerance
    assert np.abs(beyond).max() <= 1e-9


@pytest.mark.parametrize("name", KINDS)
@given(st.data())
def test_middle_of_a_fixture_is_allowed_whatever_its_parameters(
    name: str, data: st.DataObject
) -> None:
    assert found(name, data.draw(KINDS[name]), np.zeros(3))[0] <= ROUNDING


# Ends, ties and fixed directions.


def test_a_tube_and_a_line_of_length_zero_have_no_ends() -> None:
    far = np.array([0.0, 50.0, 0.0])
    assert found("cylinder", CylinderParameters(length=0.0), far)[0] == 0.0
    assert found("cylinder", CylinderParameters(length=0.1), far)[0] == 49.95
    upright = (0.0, 1.0, 0.0)
    assert found("line", LineParameters(direction=upright), far)[0] == 0.0
    short = LineParameters(direction=upright, length=0.1, tolerance=0.0)
    assert found("line", short, far)[0] == 49.95


def test_below_a_floor_the_way_out_is_down_from_the_plane() -> None:
    floor = HalfSpaceParameters(room=0.01)
    depth, way = found("half_space", floor, np.array([0.02, -0.03, 0.0]))
    assert math.isclose(depth, 0.02)
    assert np.allclose(way, (0.0, -0.02, 0.0), rtol=0, atol=ROUNDING)


def test_beyond_its_tip_a_cone_leads_to_the_tip() -> None:
    depth, way = found("cone", ConeParameters(), np.array([0.0, -0.05, 0.0]))
    assert math.isclose(depth, 0.02)
    assert np.allclose(way, (0.0, -0.02, 0.0), rtol=0, atol=ROUNDING)


def test_the_earlier_of_two_pieces_leads_where_both_are_equally_near() -> None:
    # There and back 20 mm beside it: the point is halfway.
    p = PathParameters(points=(0.1, 0.0, 0.0, 0.1, 0.02, 0.0, 0.0, 0.02, 0.0), tolerance=0.0)
    depth, way = found("path", p, np.array([0.05, 0.01, 0.0]))
    assert (depth, way.tolist()) == (0.01, [0.0, 0.01, 0.0])


def test_a_piece_of_no_length_is_a_point() -> None:
    p = PathParameters(points=(0.0, 0.0, 0.0), tolerance=0.0)
    assert found("path", p, np.array([0.0, 0.03, 0.0]))[0] == 0.03


def test_the_middle_of_what_is_forbidden_has_a_way_out() -> None:
    ball, block = KeepOutSphereParameters(), KeepOutBoxParameters(size=(0.04, 0.03, 0.02))
    assert found("keep_out_sphere", ball, ball.place)[1].tolist() == [0.0, 0.0, -0.015]
    assert found("keep_out_box", block, block.place)[1].tolist() == [0.0, 0.0, -0.01]


def test_a_path_takes_64_points_and_no_more() -> None:
    most = PathParameters(points=(0.01, 0.0, 0.0) * 64)
    out = np.empty(3)
    assert path_depth(np.array([0.01, 0.0, 0.0]), numbers_of(most), out) == 0.0
    with pytest.raises(ParameterError) as error:
        PathParameters(points=(0.01, 0.0, 0.0) * 65)
    assert error.value.name == "path.points"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("cylinder.direction", (0.0, 0.0, 0.0)),
        ("line.direction", (0.0, 1e-200, 0.0)),
        ("half_space.normal", (0.0, 0.0, 0.0)),
        ("cone.axis", (0.0, 0.0, 0.0)),
        ("cone.apex", (0.0, 0.03, 0.0)),  # the hand would be beyond the tip
        ("cone.apex", (0.03, -0.03, 0.0)),
        ("path.points", ()),
        ("path.points", (0.01, 0.0)),
        ("keep_out_sphere.place", (0.0, 0.01, 0.0)),
        ("keep_out_box.place", (0.0, 0.01, 0.0)),
    ],
)
def test_numbers_that_do_not_fit_together_are_refused_by_name(
    name: str, value: tuple[float, ...]
) -> None:
    with pytest.raises(ParameterError) as error:
        build(FixtureParameters, {name: value})
    assert (error.value.name, error.value.value) == (name, value)


DIGEST = """
import sys
sys.path.insert(0, sys.argv[1])
from test_fixture_shapes import digest
print(digest())
"""


OBLIQUE: Any = {
    "cylinder": {"direction": (0.3, 0.7, -0.5)},
    "half_space": {"normal": (-0.2, 0.9, 0.3)},
    "cone": {"axis": (0.1, 0.9, 0.2)},
    "line": {"direction": (0.3, 0.7, -0.5), "length": 0.03},
    "path": {"points": (0.01, 0.02, 0.003, -0.02, 0.01, 0.02)},
    "keep_out_sphere": {"place": (0.011, 0.013, -0.007)},
    "keep_out_box": {"place": (0.011, 0.013, -0.017)},
}
"""Parameters along no axis: sums of zeros would be the same in any order."""


def digest() -> str:
    """Digest of depths and ways of all kinds at forty places."""
    seen = hashlib.sha256()
    for name in KINDS:
        part: Any = FIXTURES.find(name)
        shape, out = numbers_of(part.parameters(**OBLIQUE.get(name, {}))), np.empty(3)
        for offset in np.random.default_rng(2).uniform(-0.06, 0.06, (40, 3)):
            seen.update(np.float64(part.depth(offset, shape, out)).tobytes() + out.tobytes())
    return seen.hexdigest()


def test_depths_have_the_same_bits_compiled_and_as_plain_python() -> None:
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", DIGEST, os.path.dirname(__file__)],
        capture_output=True, text=True, timeout=300, check=True, env=plain,
    )  # fmt: skip
    assert done.stdout.strip() == digest()
