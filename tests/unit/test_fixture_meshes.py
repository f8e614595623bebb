"""Fixtures of meshes: they hold the hand as the shapes do that they are meshes of."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import teleop_core as tc
from present import present
from teleop_core.bags.reader import Bag
from teleop_core.base.errors import ParameterError
from teleop_core.chain.fixtures import FIXTURES
from teleop_core.evaluation.scoring import evaluate
from teleop_core.kernels.geometry import Array

SIZE = (30.0, 24.0, 20.0)  # of a box [mm]
RADIUS = 15.0  # of a ball [mm]
BOUND = 4e-5  # of distances of a grid of 1 mm away from edges [m]; on flat sides 3e-6
BESIDE = (0.03, 0.005, 0.0)  # place of what is to stay out of [m]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Meshes of a box and a ball, and a cache of its own."""
    made = tmp_path_factory.mktemp("meshes")
    trimesh.creation.box(SIZE).export(made / "box.stl")
    trimesh.creation.icosphere(subdivisions=5, radius=RADIUS).export(made / "ball.stl")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TELEOP_KERNELS", str(Path.home() / ".cache" / "teleop_core" / "kernels"))
        patch.setenv("XDG_CACHE_HOME", str(made / "cache"))
        yield made


def ways(
    name: str, values: Mapping[str, str | float | tuple[float, float, float]], offsets: Array
) -> tuple[Array, Array]:
    """Depths (N,) and ways (N, 3) [m] of a fixture at offsets (N, 3) from its middle."""
    part, out = FIXTURES.find(name), np.zeros((len(offsets), 3))
    shape = part.numbers(part.parameters(**values))
    depths = [part.depth(offset, shape, row) for offset, row in zip(offsets, out, strict=True)]
    return np.array(depths), out


@pytest.mark.parametrize(
    ("mesh", "file", "shape", "values"),
    [
        ("mesh", "box", "box", {"size": tuple(1e-3 * x for x in SIZE)}),
        ("mesh", "ball", "sphere", {"diameter": 2e-3 * RADIUS}),
        ("keep_out_mesh", "box", "keep_out_box",
         {"size": tuple(1e-3 * x for x in SIZE), "place": BESIDE}),
        ("keep_out_mesh", "ball", "keep_out_sphere", {"diameter": 2e-3 * RADIUS, "place": BESIDE}),
    ],
)  # fmt: skip
def test_depth_and_way_are_those_of_the_shape(
    mesh: str,
    file: str,
    shape: str,
    values: Mapping[str, float | tuple[float, float, float]],
    folder: Path,
) -> None:
    offsets = np.random.default_rng(1).uniform(-0.04, 0.04, (60_000, 3))
    wanted, way = ways(shape, values, offsets)
    if file == "box":  # an edge of a mesh is rounded by the grid
        over = np.abs(offsets - np.array(values.get("place", 0.0))) - 0.5e-3 * np.array(SIZE)
        over.sort(axis=1)
        is_clear = (over[:, 2] - over[:, 1] > 6e-3) & (np.abs(over[:, 2]) < 3e-3)
    else:
        is_clear = wanted < 3e-3
    is_clear &= wanted != 0.0
    place = {"place": values["place"]} if "place" in values else {}
    given = {"file": str(folder / f"{file}.stl"), **place}
    depth, found = ways(mesh, given, offsets[is_clear])
    assert len(depth) > 100
    assert np.abs(depth - wanted[is_clear]).max() < BOUND
    assert np.linalg.norm(found - way[is_clear], axis=1).max() < 3.0 * BOUND
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), depth, atol=1e-12)


@pytest.mark.parametrize("mesh", ["mesh", "keep_out_mesh"])
def test_where_the_hand_is_allowed_there_is_no_wall(mesh: str, folder: Path) -> None:
    offsets = np.random.default_rng(2).uniform(-0.05, 0.05, (5000, 3))
    place = BESIDE if mesh == "keep_out_mesh" else (0.0, 0.0, 0.0)
    depth, way = ways(mesh, {"file": str(folder / "ball.stl"), "place": place}, offsets)
    apart = np.linalg.norm(offsets - np.array(place), axis=1) - 1e-3 * RADIUS
    is_free = apart < -BOUND if mesh == "mesh" else apart > BOUND
    assert is_free.any()
    assert not depth[is_free].any()
    assert not way[is_free].any()
    assert (depth > 0.0)[np.abs(apart) > BOUND].sum() == (~is_free)[np.abs(apart) > BOUND].sum()


def session(folder: Path, kind: str, **settings: str | tuple[float, float, float]) -> tc.Recording:
    return tc.run("coarse_box", duration=7.0, settings={"fixture": kind, **settings}, out=folder)


def test_a_hand_in_a_mesh_of_a_box_is_held_and_scored_as_in_the_box_though_the_file_is_gone(
    folder: Path, tmp_path: Path
) -> None:
    file = tmp_path / "box.stl"
    trimesh.creation.box((30.0, 30.0, 30.0)).export(file)
    held = session(tmp_path / "mesh", "mesh", **{"fixture.mesh.file": str(file)})
    box = session(tmp_path / "box", "box", **{"fixture.box.size": (0.03, 0.03, 0.03)})
    key = "fixture.hand_penetration_max_mm"
    before, wanted = held.score().value(key), box.score().value(key)
    assert before == pytest.approx(wanted, abs=0.11)  # a step of the reading to either side
    assert present(before) > 0.1
    file.unlink()
    score = evaluate(Bag(tmp_path / "mesh"))
    assert score.fixture.unscored is None
    assert score.value(key) == before
    again = tc.replay(tmp_path / "mesh")
    assert np.array_equal(again["master/servo_cf"].values, held["master/servo_cf"].values)


@pytest.mark.parametrize(
    ("kind", "values", "name", "text"),
    [
        ("mesh", {}, "fixture.mesh.file", "a file with a mesh"),
        ("keep_out_mesh", {"file": "none.stl"}, "fixture.keep_out_mesh.file", "No such file"),
        ("mesh", {"file": __file__}, "fixture.mesh.file", "a mesh that can be read"),
        ("mesh", {"file": "ball", "place": (0.02, 0.0, 0.0)}, "fixture.mesh.place",
         "lies inside of the mesh; it is 0.005 m off"),
        ("keep_out_mesh", {"file": "ball", "place": (0.01, 0.0, 0.0)},
         "fixture.keep_out_mesh.place", "lies outside of the mesh; it is 0.005"),
    ],
)  # fmt: skip
def test_what_cannot_hold_a_hand_is_refused_by_its_name(
    kind: str, values: Any, name: str, text: str, folder: Path
) -> None:
    if values.get("file") == "ball":
        values = values | {"file": str(folder / "ball.stl")}
    settings = {f"fixture.{kind}.{key}": value for key, value in values.items()}
    with pytest.raises(ParameterError, match=text) as error:
        tc.run("coarse_box", duration=1.0, settings={"fixture": kind, **settings})
    assert error.value.name == name


def test_the_outline_of_a_mesh_lies_on_it_where_it_was_put(folder: Path) -> None:
    part = FIXTURES.find("keep_out_mesh")
    given = part.parameters(file=str(folder / "ball.stl"), place=BESIDE)
    points = part.outline(given)
    points = points[np.isfinite(points).all(axis=1)] - np.array(BESIDE)
    radii = np.linalg.norm(points, axis=1)
    assert math.isclose(radii.max(), 1e-3 * RADIUS, rel_tol=1e-3)
    assert radii.min() > 0.99e-3 * RADIUS
