"""Fixtures in scores and pictures: any kind, turned and scaled as it stood around the slave."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rich.console import Console

from present import present
from recipes import START_NS, Recipe, state
from teleop_core.bags.reader import Bag
from teleop_core.base import EvaluationError, Within, parameter
from teleop_core.coupling.fixtures.reported_fixture import ReportedFixture
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.evaluation import Figure, TableRow, evaluate, study
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.evaluation.origin import read_origin
from teleop_core.graph import TICK_NS, topics
from teleop_core.kernels.axes import axis_map
from teleop_core.kernels.geometry import Array
from teleop_core.shapes import Shape, register_shape

# Lengths of some hundred millimetres in doubles.
ROUNDING_MM = 1e-9
AXES = axis_map("axes", MotionScalingParameters().axes)
OTHER_AXES = ("+x", "+y", "+z")
CENTER = np.array([0.4, 0.0, -0.18])
SPHERE = {"fixture": "sphere", "fixture.radius": "0.015"}
BOX = {"fixture": "box", "fixture.size": "(0.01, 0.02, 0.03)"}
# What each kind of fixture is called in the pictures and how far its slave's ends are apart [mm].
SIZES = {"sphere": (30, 30, 30), "box": (30, 10, 20)}


def fixture_on(
    described: dict[str, str] | None, gain: float = 1.0, size: Any = (0.03, 0.03, 0.03), at: int = 0
) -> tuple[topics.Topic, int, bytes]:
    """Report that a fixture is on around the slave at rest."""
    stamp_ns = START_NS + at * TICK_NS
    values = {"is_fixture_on": 1.0, "gain": gain}
    for axis, middle, extent in zip("xyz", CENTER, size, strict=True):
        values |= {f"fixture_center_{axis}": middle, f"fixture_size_{axis}": extent}
    return topics.TELEOP_STATE, stamp_ns, state(stamp_ns, described, **values)


def configuration(axes: tuple[str, str, str], stage: str = "motion_scaling") -> str:
    return yaml.safe_dump({stage: {"ros__parameters": {"axes": list(axes)}}})


def figures(bag: Bag) -> dict[str, Figure]:
    """Figures of a recording by their titles."""
    return {figure.title: figure for figure in study(bag).figures()}


@pytest.fixture
def recipe() -> Recipe:
    return Recipe(2000)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "bag"


# -- depth -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("gain", [1.0, 0.1])
def test_depth_of_a_slave_is_that_of_the_hand_by_the_gain(gain: float) -> None:
    rng = np.random.default_rng(2)
    offsets = rng.normal(scale=0.02 * gain, size=(200, 3))
    box = ReportedFixture("box", (("size", "(0.01, 0.02, 0.03)"),))
    hand = offsets @ AXES / gain
    half = np.array([0.005, 0.01, 0.015])
    expected = gain * np.linalg.norm(hand - np.clip(hand, -half, half), axis=1)
    found = box.depths(offsets, np.full(200, gain), AXES)
    assert np.allclose(found, expected, rtol=0, atol=1e-15)
    assert (found > 0.0).any()


def test_depth_of_what_is_no_number_is_none() -> None:
    sphere = ReportedFixture("sphere", (("radius", "0.015"),))
    offsets = np.array([[np.nan, 0, 0], [0, np.inf, 0], [0, 0, 1.0], [0, 0, 0]])
    depth = sphere.depths(offsets, np.array([1.0, 1.0, 0.0, 1.0]), AXES)
    assert np.array_equal(depth, [np.nan, np.nan, np.nan, 0.0], equal_nan=True)


def test_sphere_is_scored_by_the_distance_from_its_middle(recipe: Recipe, path: Path) -> None:
    recipe.singles = [fixture_on(SPHERE)]
    recipe.values(topics.SLAVE_MEASURED_CP)[500:1000, :3] += 0.01  # inside of the box around it
    score = evaluate(recipe.write(path)).fixture
    assert np.isclose(present(score.penetration_max_mm), 10 * np.sqrt(3) - 15, atol=ROUNDING_MM)
    assert np.isclose(present(score.outside_share), 0.25)
    assert (score.kind, score.unscored) == ("sphere", None)


def test_box_of_the_hand_scores_as_the_box_of_the_slave_that_older_recordings_tell(tmp_path: Path) -> None:
    scores = []
    for described in (BOX, None):
        recipe = Recipe(2000)
        recipe.singles = [fixture_on(described, 0.5, np.array([0.015, 0.005, 0.01]))]
        rng = np.random.default_rng(4)
        for topic in (topics.SLAVE_MEASURED_CP, topics.SLAVE_SERVO_CP):
            recipe.values(topic)[:, :3] += rng.normal(scale=0.01, size=(2000, 3))
        score = evaluate(recipe.write(tmp_path / str(described is None))).fixture
        assert score.kind == "box"
        scores.append(score)
    for name in ("outside_share", "penetration_max_mm", "penetration_rms_mm", "on_s", "hand_penetration_max_mm"):
        new, old = (getattr(score, name) for score in scores)
        assert np.isclose(new, old, rtol=1e-12), name
        assert new > 0.0


@pytest.mark.parametrize(("axes", "outside_mm"), [(None, 5.0), (OTHER_AXES, 15.0)])
def test_fixture_is_turned_by_the_recorded_map_of_axes(
    recipe: Recipe, path: Path, axes: tuple[str, str, str] | None, outside_mm: float
) -> None:
    if axes:
        recipe.metadata["configuration"] = configuration(axes)
    recipe.singles = [fixture_on(BOX)]
    recipe.values(topics.SLAVE_MEASURED_CP)[:, 0] += 0.02  # the hand's z or x, of 30 or 10 mm
    found = present(evaluate(recipe.write(path)).fixture.penetration_max_mm)
    assert np.isclose(found, outside_mm, atol=ROUNDING_MM)


def test_each_arm_has_its_own_map_of_axes(recipe: Recipe, path: Path) -> None:
    recipe.metadata["configuration"] = configuration(OTHER_AXES, "left/motion_scaling")
    bag = recipe.write(path)
    assert np.array_equal(read_origin(bag, "left").axes, np.eye(3))
    assert np.array_equal(read_origin(bag).axes, AXES)


@pytest.mark.parametrize(
    "axes",
    [
        "-z",
        ["+x", "+y"],
        ["+x", "+x", "+y"],
        ["+x", "+y", "-z"],
        ["a", "b", "c"],
        [["-z"], "-x", "+y"],
        [{}, "-x", "+y"],
        [None, 1, 0.5],
    ],
)
def test_map_of_axes_that_is_none_is_the_published_one(
    recipe: Recipe, path: Path, axes: str | Sequence[str | float | list[str] | dict[str, object] | None]
) -> None:
    said = {"motion_scaling": {"ros__parameters": {"axes": axes}}}
    recipe.metadata["configuration"] = yaml.safe_dump(said)
    assert np.array_equal(read_origin(recipe.write(path)).axes, AXES)


def test_kind_and_size_may_change_while_the_fixture_is_on(recipe: Recipe, path: Path) -> None:
    recipe.singles = [
        fixture_on(SPHERE),
        fixture_on(SPHERE | {"fixture.radius": "0.005"}, size=(0.01, 0.01, 0.01), at=500),
        fixture_on(BOX, size=(0.03, 0.01, 0.02), at=1000),
        (topics.TELEOP_STATE, START_NS + 1500 * TICK_NS, state(START_NS + 1500 * TICK_NS, BOX)),
    ]
    recipe.values(topics.SLAVE_MEASURED_CP)[:, 0] += 0.016
    bag = recipe.write(path)
    score = evaluate(bag)
    assert score.fixture.kind == "sphere and box"
    assert np.isclose(present(score.fixture.penetration_max_mm), 11.0, atol=ROUNDING_MM)
    mean_square = (1.0 + 11.0**2 + 1.0) / 3
    assert np.isclose(present(score.fixture.penetration_rms_mm), np.sqrt(mean_square), atol=ROUNDING_MM)
    assert np.isclose(score.fixture.on_s, 1.5)
    drawn = {trace["name"] for trace in figures(bag)["Path in space"].traces}
    assert drawn >= {"sphere", "box"}


# -- kinds of a user -------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class WallParameters:
    """A wall above the hand."""

    height: float = parameter(0.01, Within(0.0, 1.0, "m"), "above the middle")


def wall_distance(offset: Array, numbers: Array, out: Array) -> float:
    out[:] = 0.0, 1.0, 0.0
    return offset[1] - numbers[0]


def wall_outline(parameters: WallParameters) -> Array:
    corners = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1), (-1, 0, -1)], float)
    return 0.01 * corners + np.array([0, parameters.height, 0])


WALL = Shape("wall", WallParameters, wall_distance, wall_outline)
REPORTED_WALL = {"fixture": "wall", "fixture.height": "0.01"}


@pytest.mark.usefixtures("own_parts")
def test_plain_function_of_a_user_is_scored_and_drawn(recipe: Recipe, path: Path) -> None:
    register_shape(WALL)
    recipe.singles = [fixture_on(REPORTED_WALL, 0.5)]
    recipe.values(topics.SLAVE_MEASURED_CP)[:, 2] += 0.006  # the hand's y is the slave's z
    bag = recipe.write(path)
    assert np.isclose(present(evaluate(bag).fixture.penetration_max_mm), 1.0, atol=ROUNDING_MM)
    trace = next(t for t in figures(bag)["Path in space"].traces if t["name"] == "wall")
    assert np.allclose(trace["z"], 1e3 * CENTER[2] + 5.0, rtol=0, atol=ROUNDING_MM)


def failing_distance(offset: Array, numbers: Array, out: Array) -> float:
    if 0.025 < offset[1] < 0.035:
        raise ZeroDivisionError
    return wall_distance(offset, numbers, out)


@pytest.mark.usefixtures("own_parts")
def test_depth_that_raises_is_told_with_the_metric(recipe: Recipe, path: Path) -> None:
    register_shape(Shape("wall", WallParameters, failing_distance, wall_outline))
    recipe.singles = [fixture_on(REPORTED_WALL)]
    recipe.values(topics.SLAVE_MEASURED_CP)[:, 2] += 0.03
    with pytest.raises(EvaluationError, match="metric 'fixture' failed with ZeroDivisionError"):
        evaluate(recipe.write(path))


@pytest.mark.parametrize(
    ("described", "told"),
    [
        (REPORTED_WALL, "wall: shape is 'wall', must be one of: box, capsule"),
        (SPHERE | {"fixture.radius": "wide"}, "radius is 'wide', must be a number"),
        (SPHERE | {"fixture.width": "0.1"}, "is 'width', must be one of: radius"),
    ],
)
def test_fixture_of_an_unknown_shape_leaves_the_rest_of_the_score(
    recipe: Recipe, path: Path, described: dict[str, str], told: str
) -> None:
    recipe.singles = [fixture_on(described)]
    recipe.values(topics.SLAVE_MEASURED_CP)[:, 0] += 0.5e-3
    bag = recipe.write(path)
    score = evaluate(bag)
    assert np.isclose(present(score.position_error_mm.max), 0.5, atol=ROUNDING_MM)
    assert score.fixture.penetration_max_mm is score.fixture.outside_share is None
    assert np.isclose(score.fixture.on_s, 2.0)
    assert told in present(score.fixture.unscored)
    (row,) = [row for row in score.rows if row.label == "shape not known"]
    assert row.value == described["fixture"]
    assert f"not scored: {score.fixture.unscored}" in figures(bag)["Path in space"].sentence


def test_known_shapes_are_scored_beside_unknown_ones(recipe: Recipe, path: Path) -> None:
    recipe.singles = [fixture_on(REPORTED_WALL), fixture_on(SPHERE, at=1000)]
    recipe.values(topics.SLAVE_MEASURED_CP)[:, 0] += 0.016
    score = evaluate(recipe.write(path)).fixture
    assert np.isclose(present(score.penetration_rms_mm), 1.0, atol=ROUNDING_MM)
    assert score.outside_share == 1.0
    assert np.isclose(score.on_s, 2.0)
    assert score.kind == "wall and sphere"


# -- tables and pictures ---------------------------------------------------------------------------


def rows_of(bag: Bag) -> dict[str, TableRow]:
    return {row.label: row for row in evaluate(bag).rows}


@pytest.mark.parametrize(
    ("described", "robot", "published"), [(SPHERE, "rcrt1", ""), (BOX, "rcrt1", "1.000"), (BOX, "puma560", "")]
)
def test_only_a_box_and_the_source_s_robot_are_held_against_the_published_overshoot(
    recipe: Recipe, path: Path, described: dict[str, str], robot: str, published: str
) -> None:
    recipe.singles, recipe.metadata["robot"] = [fixture_on(described)], robot
    rows = rows_of(recipe.write(path))
    assert f"{described['fixture']} on for" in rows
    assert rows["slave outside, max"].published == published


@pytest.mark.parametrize("described", [SPHERE, BOX])
@pytest.mark.parametrize("gain", [1.0, 0.1])
def test_outline_stands_around_the_slave_in_every_picture(
    recipe: Recipe, path: Path, described: dict[str, str], gain: float
) -> None:
    kind = described["fixture"]
    recipe.singles = [fixture_on(described, gain, at=200)]
    shown = figures(recipe.write(path))
    ends = [
        (1e3 * middle - gain * size / 2, 1e3 * middle + gain * size / 2)
        for middle, size in zip(CENTER, SIZES[kind], strict=True)
    ]
    (trace,) = [t for t in shown["Path in space"].traces if t["name"] == kind]
    for axis, (low, high) in zip("xyz", ends, strict=True):
        assert np.allclose((np.nanmin(trace[axis]), np.nanmax(trace[axis])), (low, high), atol=0.05)
    planes = [t for t in shown["Path per plane"].traces if t["name"] == kind]
    for trace, (across, up) in zip(planes, ((0, 1), (0, 2), (1, 2)), strict=True):
        assert np.allclose((np.nanmin(trace["x"]), np.nanmax(trace["x"])), ends[across], atol=0.05)
        assert np.allclose((np.nanmin(trace["y"]), np.nanmax(trace["y"])), ends[up], atol=0.05)
    against_time = shown["Position against time"]
    walls = {(shape["x0"], round(shape["y0"], 1)) for shape in against_time.layout["shapes"]}
    assert walls == {(0.2, round(place, 1)) for pair in ends for place in pair}
    assert f"where the {kind} ends" in against_time.sentence
    assert f"the {kind} (" in shown["Path in space"].sentence


OPEN = {
    "half_space": ({"normal": (0.0, 1.0, 0.0), "room": 0.01}, [(2, -10.0)]),
    "box": ({"place": (0.0, 0.0, 0.025), "keep_out": True}, [(0, -10.0)]),
    "line": (
        {"direction": (1.0, 0.0, 0.0), "radius": 0.002, "length": 0.0},
        [(0, -2.0), (0, 2.0), (2, -2.0), (2, 2.0)],
    ),
}
"""Shapes that are open on a side, and their walls [mm] on the slave's axes."""


@pytest.mark.parametrize("kind", OPEN)
@pytest.mark.parametrize("gain", [1.0, 0.1])
def test_walls_are_drawn_where_there_are_some_and_nowhere_else(
    recipe: Recipe, path: Path, kind: str, gain: float
) -> None:
    values: Any
    values, walls = OPEN[kind]
    told = {"fixture": kind} | {f"fixture.{name}": repr(value) for name, value in values.items()}
    recipe.singles = [fixture_on(told, gain, at=200)]
    shown = figures(recipe.write(path))
    found = {(s["yref"], s["y0"]) for s in shown["Position against time"].layout["shapes"]}
    expected = [(f"y{axis + 1}" if axis else "y", 1e3 * CENTER[axis] + gain * place) for axis, place in walls]
    assert [axis for axis, _ in sorted(found)] == [axis for axis, _ in sorted(expected)]
    np.testing.assert_allclose([place for _, place in sorted(found)], [p for _, p in sorted(expected)], atol=1e-3)
    assert f"leaves the {kind} by" in shown["Path in space"].sentence


def test_page_speaks_of_the_kind_and_of_no_box(recipe: Recipe, path: Path, tmp_path: Path) -> None:
    recipe.singles = [fixture_on(SPHERE)]
    recipe.write(path)
    evaluate_bags([path], None, tmp_path / "page.html", Console(quiet=True))
    body = (tmp_path / "page.html").read_text().split("page-data")[0].split("<body")[1]
    assert "sphere" in body
    assert "box" not in body


def test_fixture_that_is_reported_again_is_drawn_once(recipe: Recipe, path: Path) -> None:
    recipe.singles = [fixture_on(SPHERE), fixture_on(SPHERE, at=500)]
    walls = figures(recipe.write(path))["Position against time"].layout["shapes"]
    assert [(wall["x0"], wall["x1"]) for wall in walls] == [(0.0, 1.999)] * 6
