"""Shapes made of others: a union is the least of its parts, an intersection the most of them."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import teleop_core as tc
from any_shape import BALL, BEYOND, KINDS, found, places
from present import present
from teleop_core.bags.reader import Bag
from teleop_core.base import ParameterError, build, values_of
from teleop_core.coupling.fixtures.reported_fixture import reported_fixture
from teleop_core.coupling.mapping.gains import FixtureParameters
from teleop_core.evaluation.scoring import evaluate
from teleop_core.kernels.geometry import Array
from teleop_core.shapes import SHAPES
from teleop_core.shapes.basis.combined import PARTS

INSIDE = 1e-7  # what the rounds leave of a way, at most [m]
SHALLOW = 1e-5
CONVEX = ("box", "sphere", "cylinder", "capsule", "half_space", "plane", "cone")
middles = st.tuples(*[st.floats(-0.02, 0.02)] * 3)
BOTH = pytest.mark.parametrize("name", ["union", "intersection"])


class Part(NamedTuple):
    """A part of a shape, its middle, and -1 for what is outside of it."""

    kind: str
    given: Any
    at: Array
    side: float

    def text(self) -> str:
        values = {**values_of(self.given), "at": self.at.tolist()}
        words = [f"{n}={list(v) if isinstance(v, tuple) else v}" for n, v in values.items()]
        return " ".join(["not"] * (self.side < 0.0) + [self.kind, *words])

    def distance(self, offset: Array) -> float:
        return self.side * found(self.kind, self.given, offset - self.at)[0]

    def beyond(self, points: Array) -> Any:
        return self.side * BEYOND[self.kind](self.given, points - self.at)


@st.composite
def parts_of(draw: st.DrawFn, kinds: Sequence[str] = tuple(KINDS), *, may_be_not: bool = True) -> list[Part]:
    """Two to four parts, each perhaps beside the middle, or what is outside of it."""
    return [
        Part(
            kind,
            draw(KINDS[kind]),
            np.array(draw(st.just((0.0,) * 3) | middles)),
            draw(st.sampled_from([1.0, -1.0])) if may_be_not else 1.0,
        )
        for kind in draw(st.lists(st.sampled_from(kinds), min_size=2, max_size=4))
    ]


def whole(name: str, texts: Sequence[str]) -> Any:
    return SHAPES.find(name).parameters(parts=tuple(texts))


def of(name: str, parts: Sequence[Part], offset: Sequence[float] | Array) -> tuple[float, Array]:
    return found(name, whole(name, [part.text() for part in parts]), offset)


def test_every_shape_that_is_not_made_of_others_can_be_a_part() -> None:
    assert set(PARTS) == set(SHAPES.names()) - {"union", "intersection"}


@given(parts_of(), places)
def test_a_union_is_as_far_as_its_nearest_part_inside_and_outside(parts: list[Part], offset: Any) -> None:
    distance, out = of("union", parts, offset)
    assert distance == min(part.distance(np.array(offset)) for part in parts)
    assert math.isclose(np.linalg.norm(out), 1.0)
    if distance > 0.0:
        assert of("union", parts, np.array(offset) - distance * out)[0] <= 1e-11


@given(parts_of(), places)
def test_not_turns_a_shape_inside_out(parts: list[Part], offset: Any) -> None:
    (part, *_), both = parts, []
    for side in (1.0, -1.0):
        both.append(of("union", [part._replace(side=side)], offset))
    assert both[0][0] == -both[1][0]
    assert np.array_equal(both[0][1], -both[1][1])


@given(parts_of(CONVEX, may_be_not=False), places)
@settings(max_examples=300)
def test_no_place_in_all_parts_is_nearer_than_an_intersection_of_convex_ones(parts: list[Part], offset: Any) -> None:
    offset = np.array(offset)
    distance, out = of("intersection", parts, offset)
    farthest = max(part.distance(offset) for part in parts)
    assert distance >= farthest - INSIDE
    assert farthest > 0.0 or distance == farthest
    assume(distance > SHALLOW)
    around = offset + (distance - INSIDE) * BALL
    assert not np.all([part.beyond(around) <= 0.0 for part in parts], axis=0).any()
    left = max(part.distance(offset - distance * out) for part in parts)
    assert left <= INSIDE or math.isclose(distance, farthest)  # how seldom: the next law


def test_the_rounds_nearly_always_end_at_the_nearest_place() -> None:
    rng, count, late = np.random.default_rng(1), 0, 0
    for _ in range(400):
        normals, length = rng.normal(size=(2, 3)), rng.uniform(0.004, 0.06, 4)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        parameters = whole(
            "intersection",
            (
                f"half_space normal={normals[0].tolist()} room={0.2 * length[0]}",
                f"cylinder direction={normals[1].tolist()} radius={0.5 * length[1]} length={length[2]}",
                f"sphere radius={0.5 * length[3]}",
            ),
        )
        for offset in rng.uniform(-0.04, 0.04, (5, 3)):
            distance, out = found("intersection", parameters, offset)
            if distance > 0.0:
                count += 1
                late += found("intersection", parameters, offset - distance * out)[0] > INSIDE
    assert count > 1000
    assert late <= 0.005 * count


@given(parts_of(), places)
def test_an_intersection_leads_into_all_parts_or_out_of_the_one_that_is_farthest(
    parts: list[Part], offset: Any
) -> None:
    offset = np.array(offset)
    distance, out = of("intersection", parts, offset)
    distances = [part.distance(offset) for part in parts]
    assert distance >= max(distances) - INSIDE
    assert math.isclose(np.linalg.norm(out), 1.0)
    left = max(part.distance(offset - distance * out) for part in parts)
    assert left <= INSIDE or distance == max(distances)


def test_a_thin_wedge_leads_to_its_edge() -> None:
    """Two walls that meet at 20 degrees, and a place 10 mm beyond their edge."""
    angle = math.radians(10.0)
    walls = [f"half_space normal={[math.sin(angle), side * math.cos(angle), 0.0]} room=0.0" for side in (1.0, -1.0)]
    distance, out = found("intersection", whole("intersection", walls), [-0.01, 0.0, 0.0])
    assert distance == pytest.approx(0.01, abs=1e-6)
    np.testing.assert_allclose(out, (-1.0, 0.0, 0.0), atol=2e-4)


def test_between_two_walls_where_nothing_is_inside_the_farthest_leads() -> None:
    walls = (
        "half_space normal=[0, 1, 0] room=0.0",
        "half_space normal=[0, -1, 0] room=0.0",
        "not sphere at=[0.02, 0, 0] radius=0.015",
    )
    distance, _ = found("intersection", whole("intersection", walls), [0.02, 0.001, 0.0])
    assert distance > 0.013


def test_a_middle_that_is_not_allowed_is_refused() -> None:
    far = "sphere radius=0.01 at=[0.05, 0.0, 0.0]"
    for kind, parts in (("union", (far, far)), ("intersection", ("box", far))):
        with pytest.raises(ParameterError, match=f"lies inside of the {kind}; it is 0.04 m off"):
            build(FixtureParameters, {"kind": kind, f"{kind}.parts": parts})
    build(FixtureParameters, {"kind": "union", "union.parts": ("box", far)})


@BOTH
@given(parts=parts_of())
def test_the_lines_of_all_parts_are_drawn_where_they_are(name: str, parts: list[Part]) -> None:
    points: Any = SHAPES.find(name).outline(whole(name, [part.text() for part in parts]))
    wanted: Any = np.concatenate([SHAPES.find(p.kind).outline(p.given) + p.at for p in parts])
    is_drawn = np.isfinite(wanted).all(axis=1)
    np.testing.assert_allclose(points[np.isfinite(points).all(axis=1)], wanted[is_drawn])


def test_a_report_of_a_union_has_its_shape_again() -> None:
    parts = ("sphere radius=0.01", "cylinder radius=0.005 length=0.0 at=[0.0, 0.0, 0.001]")
    given_values = {"kind": "union", "union.parts": parts, "place": (0.001, 0.0, 0.0)}
    made = build(FixtureParameters, given_values).made
    reported = reported_fixture(made.described(), np.ones(3))
    assert not reported.fault
    assert reported.made == made


@pytest.mark.parametrize("kind", ["mesh", "union"])
def test_meshes_hold_a_hand_and_are_scored_though_they_are_gone(kind: str, tmp_path: Path) -> None:
    trimesh.creation.box((30.0, 30.0, 30.0)).export(tmp_path / "box.stl")
    trimesh.creation.icosphere(subdivisions=4, radius=8.0).export(tmp_path / "ball.stl")
    parts = [f"mesh file='{tmp_path / 'box.stl'}'", f"mesh file='{tmp_path / 'ball.stl'}' at=[0.0, 0.015, 0.0]"]
    of_kind = {"mesh.file": str(tmp_path / "box.stl"), "union.parts": parts}
    given_settings: Any = {"fixture": kind} | {f"fixture.{n}": v for n, v in of_kind.items()}
    held = tc.run("coarse_box", duration=6.0, settings=given_settings, out=tmp_path / "bag")
    before = held.score()
    assert present(before.value("fixture.hand_penetration_max_mm")) > 0.1
    for name in ("box", "ball"):
        (tmp_path / f"{name}.stl").unlink()
    after = evaluate(Bag(tmp_path / "bag"))
    assert after.fixture == before.fixture
    assert after.fixture.unscored is None


@pytest.mark.parametrize(
    "parts",
    [
        ("cone apex=[0.0, 0.0, 0.015] axis=[0.0, 0.0, -1.0]",),
        ("box size=[0.06, 0.06, 0.03]", "not hole at=[0.0, 0.0, 0.015]"),
    ],
)
def test_the_tip_touches_shapes_made_of_others(parts: tuple[str, ...]) -> None:
    given_settings: Any = {"world": "intersection", "world.intersection.parts": parts}
    rows = tc.run("palpation", duration=8.0, settings=given_settings)
    assert rows["slave/true_cf"].values[:, 2].max() > 0.1
