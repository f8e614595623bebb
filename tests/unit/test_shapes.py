"""Shapes: a distance with a sign, a way out, and an outline, by the same laws for all.

What is inside is said a second time in ``any_shape``, in another way: in axes turned to the shape,
by angles, or by points close together along a path.
"""

import hashlib
import math
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from any_shape import BALL, BEYOND, KINDS, THIN, depth_of, found, pieces, places
from teleop_core.base.errors import ParameterError, PartError
from teleop_core.coupling.fixtures import Fixture
from teleop_core.kernels import kernel
from teleop_core.shapes import SHAPES, Shape, register_shape
from teleop_core.shapes.basis.directions import ON_AXIS
from teleop_core.shapes.capsule import CapsuleParameters
from teleop_core.shapes.cone import ConeParameters
from teleop_core.shapes.cylinder import CylinderParameters
from teleop_core.shapes.line import LineParameters
from teleop_core.shapes.path import PathParameters
from teleop_core.shapes.sphere import SPHERE, SphereParameters, sphere_distance, sphere_outline

# Sums and products of numbers below one.
ROUNDING = 1e-14
# Of angles and turned axes, in which the second description is.
TURNED = 1e-12
# Places that are nearer to the surface are not compared with points around them [m].
SHALLOW = 1e-6
SOME = np.random.default_rng(3).uniform(-0.06, 0.06, (20, 3))
EVERY = pytest.mark.parametrize("name", KINDS)


def off_by(name: str, parameters: Any) -> float:
    """What the second description is off by: of a path, half of the way from point to point."""
    if name != "path":
        return TURNED
    return np.linalg.norm(np.diff(pieces(parameters), axis=1), axis=-1).max() + TURNED


def test_every_shape_there_is_is_tried_here() -> None:
    elsewhere = {"mesh", "height_field", "union", "intersection"}
    assert set(SHAPES.names()) - elsewhere == set(KINDS) == set(BEYOND)


@EVERY
@given(st.data())
def test_way_out_leads_to_the_surface_from_either_side(name: str, data: Any) -> None:
    parameters = data.draw(KINDS[name])
    off = off_by(name, parameters)
    for offset in (np.array(data.draw(places)), *(SOME if name != "path" else ())):
        distance, out = found(name, parameters, offset)
        assert math.isclose(np.linalg.norm(out), 1.0, abs_tol=TURNED)
        beyond = BEYOND[name](parameters, offset)
        assert abs(beyond) <= off or (beyond > 0.0) == (distance > 0.0)
        if distance > 0.0 or name not in THIN:
            surface = offset - distance * out
            assert abs(found(name, parameters, surface)[0]) <= ON_AXIS
            assert abs(BEYOND[name](parameters, surface)) <= off + ON_AXIS


@pytest.mark.parametrize("name", [name for name in KINDS if name not in THIN])
@given(st.data())
def test_no_place_on_the_other_side_is_nearer_than_the_distance(name: str, data: Any) -> None:
    parameters, offset = data.draw(KINDS[name]), np.array(data.draw(places))
    distance, _ = found(name, parameters, offset)
    assume(abs(distance) > SHALLOW)
    assert (BEYOND[name](parameters, offset + distance * BALL) * distance > 0.0).all()


@pytest.mark.parametrize("name", ["line", "capsule"])
@given(st.data())
def test_distance_from_a_rod_is_that_of_its_axis_less_its_radius(name: str, data: Any) -> None:
    p, offset = data.draw(KINDS[name]), np.array(data.draw(places))
    assert math.isclose(found(name, p, offset)[0], BEYOND[name](p, offset), abs_tol=TURNED)


@given(KINDS["path"], places)
@settings(max_examples=200)
def test_distance_from_a_path_is_that_of_the_nearest_of_its_points(
    p: PathParameters, offset: tuple[float, float, float]
) -> None:
    apart = float(BEYOND["path"](p, np.array(offset))) + p.radius
    half = 0.5 * off_by("path", p)
    distance, _ = found("path", p, offset)
    nearest = math.sqrt(max(apart * apart - half * half, 0.0))
    assert nearest - p.radius - ROUNDING <= distance <= apart - p.radius + ROUNDING


@EVERY
@given(st.data())
def test_distance_changes_by_no_more_than_one_moves(name: str, data: st.DataObject) -> None:
    parameters = data.draw(KINDS[name])
    here, there = (np.array(data.draw(places)) for _ in range(2))
    there = here + data.draw(st.sampled_from([1.0, 1e-3, 1e-6])) * (there - here)
    change = abs(found(name, parameters, here)[0] - found(name, parameters, there)[0])
    assert change <= np.linalg.norm(there - here) + ROUNDING


@EVERY
@given(st.data())
def test_outline_is_drawn_where_the_surface_is(name: str, data: Any) -> None:
    parameters: Any = data.draw(KINDS[name])
    points = SHAPES.find(name).outline(parameters)
    points = points[np.isfinite(points).all(axis=1)]
    beyond = BEYOND[name](parameters, points)
    if name in THIN:  # the line itself, in the middle of what is inside
        beyond = beyond + parameters.radius
    assert np.abs(beyond).max() <= 1e-9


@EVERY
def test_there_is_a_way_out_however_little_a_point_is_off(name: str) -> None:
    parameters = SHAPES.find(name).parameters()
    for tiny in (0.0, 1e-170, 6e-160, 1e-155, 1e-140):
        for offset in ((0.0, 0.0, tiny), (tiny, tiny, tiny), (0.03, tiny, tiny), (tiny, -0.03, 0.0)):
            distance, out = found(name, parameters, offset)
            assert math.isfinite(distance)
            assert math.hypot(*out) == pytest.approx(1.0, abs=TURNED)


@EVERY
@pytest.mark.parametrize("keep_out", [False, True])
@given(st.data())
def test_a_fixture_leads_back_to_the_nearest_place_of_the_side_that_it_allows(
    name: str, keep_out: bool, data: Any
) -> None:
    parameters, offset = data.draw(KINDS[name]), np.array(data.draw(places))
    place = tuple(data.draw(places))
    side = -1.0 if keep_out else 1.0
    fixture = Fixture(SHAPES.find(name), parameters, place, keep_out)
    if side * found(name, parameters, -np.array(place))[0] > 1e-12:
        with pytest.raises(ParameterError, match="so that the middle, where the hand starts, lies"):
            depth_of(fixture, offset)
        return
    depth, way = depth_of(fixture, offset)
    distance, out = found(name, parameters, offset - np.array(place))
    assert depth == max(side * distance, 0.0)
    np.testing.assert_allclose(way, side * depth * out, rtol=0, atol=ROUNDING)


# Ends, ties and fixed directions.


def test_a_tube_and_a_line_of_length_zero_have_no_ends_but_a_capsule_has() -> None:
    far = np.array([0.0, 50.0, 0.0])
    assert found("cylinder", CylinderParameters(length=0.0), far)[0] == -0.015
    assert found("cylinder", CylinderParameters(length=0.1), far)[0] == 49.95
    upright = (0.0, 1.0, 0.0)
    assert found("line", LineParameters(direction=upright, radius=0.0), far)[0] == 0.0
    short = LineParameters(direction=upright, length=0.1, radius=0.0)
    assert found("line", short, far)[0] == 49.95
    assert found("capsule", CapsuleParameters(length=0.0, radius=0.5), far)[0] == 49.5


def test_beyond_its_tip_a_cone_leads_to_the_tip() -> None:
    distance, out = found("cone", ConeParameters(), np.array([0.0, -0.05, 0.0]))
    assert math.isclose(distance, 0.02)
    assert np.allclose(out, (0.0, -1.0, 0.0), rtol=0, atol=ROUNDING)


def test_the_earlier_of_two_pieces_leads_where_both_are_equally_near() -> None:
    # There and back 20 mm beside it: the point is halfway.
    p = PathParameters(points=(0.1, 0.0, 0.0, 0.1, 0.02, 0.0, 0.0, 0.02, 0.0), radius=0.0)
    distance, out = found("path", p, np.array([0.05, 0.01, 0.0]))
    assert (distance, out.tolist()) == (0.01, [0.0, 1.0, 0.0])


def test_a_piece_of_no_length_is_a_point_and_64_of_them_are_taken() -> None:
    p = PathParameters(points=(0.0, 0.0, 0.0) * 64, radius=0.0)
    assert found("path", p, np.array([0.0, 0.03, 0.0]))[0] == 0.03


DIGEST = """
import sys
sys.path.insert(0, sys.argv[1])
from test_shapes import digest
print(digest())
"""


OBLIQUE: Any = {
    "cylinder": {"direction": (0.3, 0.7, -0.5)},
    "capsule": {"direction": (0.3, 0.7, -0.5)},
    "half_space": {"normal": (-0.2, 0.9, 0.3)},
    "plane": {"normal": (-0.2, 0.9, 0.3)},
    "cone": {"axis": (0.1, 0.9, 0.2)},
    "line": {"direction": (0.3, 0.7, -0.5), "length": 0.03},
    "path": {"points": (0.01, 0.02, 0.003, -0.02, 0.01, 0.02)},
    "hole": {"axis": (0.3, 0.7, -0.5)},
}
"""Parameters along no axis: sums of zeros would be the same in any order."""


def digest() -> str:
    """Digest of distances and ways out of all kinds at forty places, and of two made of others."""
    seen = hashlib.sha256()
    for name in (*KINDS, "union", "intersection"):
        part: Any = SHAPES.find(name)
        numbers, out = part.numbers(part.parameters(**OBLIQUE.get(name, {}))), np.empty(3)
        for offset in np.random.default_rng(2).uniform(-0.06, 0.06, (40, 3)):
            distance = np.float64(part.distance(offset, numbers, out))
            seen.update(distance.tobytes() + out.tobytes())
    return seen.hexdigest()


def test_distances_have_the_same_bits_compiled_and_as_plain_python() -> None:
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", DIGEST, os.path.dirname(__file__)],
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
        env=plain,
    )
    assert done.stdout.strip() == digest()


# Shapes of a user's own.


def writes(*numbers: float, distance: Any = None) -> Callable[..., Any]:
    def own(offset: Any, given: Any, out: Any) -> Any:
        out[:] = numbers
        return offset[0] if distance is None else distance

    return own


@kernel
def writes_four(offset: Any, given: Any, out: Any) -> Any:
    for i in range(4):
        out[i] = 1.0
    return offset[0]


@kernel
def reads_beyond(offset: Any, given: Any, out: Any) -> Any:
    out[0], out[1], out[2] = 1.0, 0.0, 0.0
    return offset[0] - given[3]


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "two arguments": ({"distance": lambda offset, out: 0.0}, "distance(offset, numbers, out)"),
    "kernel of two": ({"distance": kernel(lambda offset, out: 0.0)}, "distance(offset, numbers"),
    "a vector": ({"distance": writes(1, 0, 0, distance=np.zeros(3))}, "-> float"),
    "nothing": ({"distance": lambda offset, numbers, out: None}, "-> float"),
    "raises": ({"distance": lambda offset, numbers, out: 1 / 0}, "raises ZeroDivisionError"),
    "no number": ({"distance": writes(1, 0, 0, distance=math.nan)}, "a finite distance"),
    "no way": ({"distance": writes(math.nan, 0, 0)}, "a finite distance"),
    "way of length 0": ({"distance": writes(0, 0, 0)}, "an out other than 0"),
    "way of four": ({"distance": writes(1, 0, 0, 0)}, "distance(offset, numbers, out)"),
    "writes beyond": ({"distance": writes_four}, "three numbers"),
    "reads beyond": ({"distance": reads_beyond}, "a finite distance"),
    "does not grow": ({"distance": writes(0, 1, 0)}, "by 0 times that"),
    "not called": ({"distance": None}, "callable distance"),
    "flat outline": ({"outline": lambda p: np.zeros((4, 2))}, "outline (N, 3)"),
    "no outline": ({"outline": lambda p: np.full((4, 3), np.nan)}, "finite points"),
    "outline of nothing": ({"outline": lambda: None}, "outline(parameters)"),
    "no dataclass": ({"parameters": dict}, "dataclass"),
}


@pytest.mark.parametrize("case", BAD)
def test_shape_that_cannot_work_is_refused_before_anything_runs(own_parts: None, case: str) -> None:
    values, expected = BAD[case]
    whole = {"parameters": SphereParameters, "distance": sphere_distance, "outline": sphere_outline}
    with pytest.raises(PartError) as error:
        register_shape(Shape("own", **{**whole, **values}))
    assert (error.value.kind, error.value.name) == ("shape", "own")
    assert expected in error.value.expected
    assert "\n" not in str(error.value)
    assert "own" not in SHAPES.names()


def test_size_of_a_fixture_is_that_of_its_outline_wherever_it_is() -> None:
    fixture = Fixture(SPHERE, SphereParameters(radius=0.02), (0.01, 0.0, 0.0))
    np.testing.assert_allclose(fixture.size(), 0.04)
    np.testing.assert_allclose(np.nanmax(fixture.outline(), axis=0), (0.03, 0.02, 0.02))
