"""Unions and intersections: the nearest place that one part, or that all of them, allow."""

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from any_fixture import BALL, BEYOND, KINDS
from teleop_core.base.errors import ParameterError, TeleopError, UnknownNameError
from teleop_core.base.parameters import build, values_of
from teleop_core.chain.fixtures import FIXTURES
from teleop_core.chain.fixtures.combined import MOST, PARTS
from teleop_core.chain.fixtures.reported_fixture import reported_fixture
from teleop_core.chain.mapping.parameters import FixtureParameters
from teleop_core.kernels.geometry import Array

ALLOWED = 1e-7  # what the rounds leave of a way, at most [m]
SHALLOW = 1e-5
CONVEX = ("box", "sphere", "cylinder", "half_space", "cone")

places = st.tuples(*[st.floats(-0.08, 0.08)] * 3).map(np.array)
middles = st.tuples(*[st.floats(-0.02, 0.02)] * 3)


def text_of(kind: str, parameters: object, at: list[float]) -> str:
    values = {**values_of(parameters), "at": at}
    return " ".join(
        [kind, *(f"{name}={list(v) if isinstance(v, tuple) else v}" for name, v in values.items())]
    )


@st.composite
def combined(
    draw: st.DrawFn, name: str, kinds: tuple[str, ...] = PARTS, is_moved: bool = True
) -> tuple[Array, list[SimpleNamespace]]:
    """Numbers of a shape, and its parts: kind, parameters, middle."""
    parts = []
    for kind in draw(st.lists(st.sampled_from(kinds), min_size=2, max_size=4)):
        at = draw(middles) if is_moved and draw(st.booleans()) else (0.0, 0.0, 0.0)
        parts.append(SimpleNamespace(kind=kind, given=draw(KINDS[kind]), at=np.array(at)))
    texts = tuple(text_of(part.kind, part.given, part.at.tolist()) for part in parts)
    part = FIXTURES.find(name)
    try:
        return part.numbers(part.parameters(parts=texts)), parts
    except ParameterError:  # the middle is forbidden
        assume(False)


def found(name: str, numbers: Array, offset: Sequence[float] | Array) -> tuple[float, Array]:
    out = np.full(3, math.nan)
    return FIXTURES.find(name).depth(np.array(offset, dtype=float), numbers, out), out


def depth_of(part: SimpleNamespace, offset: Array) -> float:
    kind = FIXTURES.find(part.kind)
    return kind.depth(offset - part.at, kind.numbers(part.given), np.zeros(3))


@given(combined("union"), places)
def test_a_union_is_as_far_as_its_nearest_part(
    shape: tuple[Array, list[SimpleNamespace]], offset: Array
) -> None:
    numbers, parts = shape
    depth, way = found("union", numbers, offset)
    assert depth == min(depth_of(part, offset) for part in parts)
    assert math.isclose(np.linalg.norm(way), depth, rel_tol=1e-12, abs_tol=1e-14)
    assert found("union", numbers, offset - way)[0] <= 1e-14


@given(combined("intersection", CONVEX), places)
@settings(max_examples=1000)
def test_no_place_that_all_parts_allow_is_nearer_than_an_intersection_of_convex_ones(
    shape: tuple[Array, list[SimpleNamespace]], offset: Array
) -> None:
    numbers, parts = shape
    depth, way = found("intersection", numbers, offset)
    deepest = max(depth_of(part, offset) for part in parts)
    assert depth >= deepest - ALLOWED
    assert deepest > 0.0 or depth == 0.0
    assume(depth > SHALLOW)
    around = offset + (depth - ALLOWED) * BALL
    is_allowed = np.ones(len(around), bool)
    for part in parts:
        is_allowed &= BEYOND[part.kind](part.given, around - part.at) <= 0.0
    assert not is_allowed.any()
    left = max(depth_of(part, offset - way) for part in parts)
    assert left <= ALLOWED or math.isclose(depth, deepest)  # how seldom: the next law


def test_the_rounds_nearly_always_end_at_the_nearest_place() -> None:
    rng, part, count, late = np.random.default_rng(1), FIXTURES.find("intersection"), 0, 0
    out = np.empty(3)
    for _ in range(400):
        normals, length = rng.normal(size=(2, 3)), rng.uniform(0.004, 0.06, 4)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        numbers = part.numbers(part.parameters(parts=(
            f"half_space normal={normals[0].tolist()} room={0.2 * length[0]}",
            f"cylinder direction={normals[1].tolist()} diameter={length[1]} length={length[2]}",
            f"sphere diameter={length[3]}",
        )))  # fmt: skip
        for offset in rng.uniform(-0.04, 0.04, (5, 3)):
            if part.depth(offset, numbers, out) > 0.0:
                count += 1
                late += part.depth(offset - out, numbers, np.empty(3)) > ALLOWED
    assert count > 1000
    assert late <= 0.005 * count


@given(combined("intersection", is_moved=False), places)
def test_an_intersection_leads_to_where_all_parts_allow_or_out_of_the_deepest(
    shape: tuple[Array, list[SimpleNamespace]], offset: Array
) -> None:
    numbers, parts = shape
    depth, way = found("intersection", numbers, offset)
    depths = [depth_of(part, offset) for part in parts]
    assert depth >= max(depths) - ALLOWED
    assert math.isclose(np.linalg.norm(way), depth, rel_tol=1e-12, abs_tol=1e-14)
    left = max(depth_of(part, offset - way) for part in parts)
    assert left <= ALLOWED or depth == max(depths)


@given(st.tuples(*[st.floats(0.002, 0.1)] * 3), places)
def test_six_walls_at_right_angles_are_a_box(
    size: tuple[float, float, float], offset: Array
) -> None:
    walls = []
    for axis in range(3):
        for side in (1.0, -1.0):
            normal = [0.0, 0.0, 0.0]
            normal[axis] = side
            walls.append(f"half_space normal={normal} room={0.5 * size[axis]}")
    part, box = FIXTURES.find("intersection"), FIXTURES.find("box")
    _, way = found("intersection", part.numbers(part.parameters(parts=tuple(walls))), offset)
    wanted = np.empty(3)
    box.depth(offset, np.array(size), wanted)
    np.testing.assert_allclose(way, wanted, rtol=0.0, atol=1e-15)


def test_a_thin_wedge_leads_to_its_edge() -> None:
    """Two walls that meet at 20 degrees, and a place 10 mm beyond their edge."""
    angle = math.radians(10.0)
    walls = tuple(f"half_space normal={[math.sin(angle), side * math.cos(angle), 0.0]} room=0.0"
                  for side in (1.0, -1.0))  # fmt: skip
    part = FIXTURES.find("intersection")
    numbers = part.numbers(part.parameters(parts=walls))
    depth, way = found("intersection", numbers, [-0.01, 0.0, 0.0])
    assert depth == pytest.approx(0.01, abs=1e-6)
    np.testing.assert_allclose(way, (-0.01, 0.0, 0.0), atol=2e-6)


def test_between_two_walls_where_nothing_is_allowed_the_deepest_pushes() -> None:
    walls = ("half_space normal=[0, 1, 0] room=0.0", "half_space normal=[0, -1, 0] room=0.0",
             "keep_out_sphere place=[0.02, 0, 0] diameter=0.03")  # fmt: skip
    part = FIXTURES.find("intersection")
    numbers = part.numbers(part.parameters(parts=walls))
    depth, way = found("intersection", numbers, [0.02, 0.001, 0.0])
    assert depth > 0.013
    assert math.isclose(np.linalg.norm(way), depth, rel_tol=1e-12)


@pytest.mark.parametrize("name", ["union", "intersection"])
@pytest.mark.parametrize(
    ("parts", "error", "said"),
    [
        ((), ParameterError, "parts"),
        (("sphere",), ParameterError, "2 to 8 parts"),
        (("sphere",) * (MOST + 1), ParameterError, "2 to 8 parts"),
        (("sphere", "tube diameter=0.02"), ParameterError, r"parts\[1\]"),
        (("sphere", "union"), ParameterError, "begins with one of box, sphere"),
        (("sphere", "mesh file='a.stl'"), ParameterError, "begins with one of box, sphere"),
        (("sphere radius=0.02", "box"), UnknownNameError, "diameter"),
        (("sphere diameter=2.0", "box"), ParameterError, r"parts\[0\] diameter"),
        (("sphere diameter=wide", "box"), ParameterError, "a number, or numbers in brackets"),
        (("sphere 0.02", "box"), ParameterError, "then settings such as"),
        (("sphere", "box at=[0.01, 0.0]"), ParameterError, r"parts\[1\] at"),
        (("sphere", "box at=['a', 0, 0]"), TeleopError, r"parts\[1\] at"),
        (("sphere", "keep_out_sphere place=[0, 0, 0]"), ParameterError, "keep_out_sphere.place"),
    ],
)
def test_a_part_that_is_wrong_is_refused_by_its_number(
    name: str, parts: tuple[str, ...], error: type[TeleopError], said: str
) -> None:
    with pytest.raises(error, match=said):
        build(FixtureParameters, {f"{name}.parts": parts})


def test_a_middle_that_is_not_allowed_is_refused() -> None:
    far = "sphere diameter=0.02 at=[0.05, 0.0, 0.0]"
    with pytest.raises(ParameterError, match="one allows the middle"):
        build(FixtureParameters, {"union.parts": (far, far)})
    with pytest.raises(ParameterError, match="allows the middle") as error:
        build(FixtureParameters, {"intersection.parts": ("box", far)})
    assert error.value.name == "intersection.parts[1]"
    build(FixtureParameters, {"union.parts": ("box", far)})


@pytest.mark.parametrize("name", ["union", "intersection"])
@given(data=st.data())
def test_the_lines_of_all_parts_are_drawn_where_they_are(name: str, data: st.DataObject) -> None:
    numbers, parts = data.draw(combined(name))
    texts = tuple(text_of(part.kind, part.given, part.at.tolist()) for part in parts)
    part = FIXTURES.find(name)
    points: Any = part.outline(part.parameters(parts=texts))
    points = points[np.isfinite(points).all(axis=1)]
    wanted: Any = [FIXTURES.find(p.kind).outline(p.given) + p.at for p in parts]
    wanted = np.concatenate(wanted)
    np.testing.assert_allclose(points, wanted[np.isfinite(wanted).all(axis=1)])
    assert len(numbers)


def test_a_report_of_a_union_has_its_shape_again() -> None:
    parts = ("sphere diameter=0.02", "cylinder diameter=0.01 length=0.0 at=[0.0, 0.0, 0.001]")
    chosen = build(FixtureParameters, {"kind": "union", "union.parts": parts}).kind
    told = {"fixture": "union"}
    told |= {f"fixture.{n}": repr(v) for n, v in values_of(chosen.parameters).items()}
    reported = reported_fixture(told, np.ones(3))
    assert not reported.fault
    offsets = np.random.default_rng(1).uniform(-0.05, 0.05, (100, 3))
    numbers = FIXTURES.find("union").numbers(chosen.parameters)
    wanted = FIXTURES.find("union").depths(offsets, numbers)
    np.testing.assert_array_equal(reported.depths(offsets, np.ones(100), np.eye(3)), wanted)
