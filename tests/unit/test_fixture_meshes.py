"""Fixtures of meshes: they hold the hand as the shapes do that they are meshes of."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import teleop_core as tc
from any_shape import depth_of
from present import present
from teleop_core.bags.reader import Bag
from teleop_core.base.errors import ParameterError
from teleop_core.chain.fixtures import Fixture
from teleop_core.evaluation.scoring import evaluate
from teleop_core.shapes import SHAPES
from teleop_core.shapes.sphere import SPHERE, SphereParameters

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


def test_a_hand_stays_inside_or_outside_of_a_mesh_as_of_the_shape_that_it_is_one_of(
    folder: Path,
) -> None:
    """That the distances are those of the shape, and its outline, is tested in ``test_mesh``."""
    mesh, group = SHAPES.find("mesh"), SHAPES.find("mesh").parameters
    ball = group(file=str(folder / "ball.stl"))
    for keep_out, place in ((False, (0.0, 0.0, 0.0)), (True, BESIDE)):
        wanted = Fixture(SPHERE, SphereParameters(radius=1e-3 * RADIUS), place, keep_out)
        fixture = Fixture(mesh, ball, place, keep_out)
        offsets = np.random.default_rng(1).uniform(-0.04, 0.04, (5000, 3))
        apart = np.linalg.norm(offsets - np.array(place), axis=1) - 1e-3 * RADIUS
        for offset in offsets[np.abs(apart) < 3e-3]:
            (depth, way), (right, right_way) = depth_of(fixture, offset), depth_of(wanted, offset)
            assert abs(depth - right) < BOUND
            assert np.linalg.norm(way - right_way) < 3.0 * BOUND


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
    ("values", "name", "text"),
    [
        ({}, "mesh.file", "a file with a mesh"),
        ({"mesh.file": "none.stl"}, "mesh.file", "No such file"),
        ({"mesh.file": __file__}, "mesh.file", "a mesh that can be read"),
        ({"mesh.file": "ball", "place": (0.02, 0.0, 0.0)}, "fixture.place",
         "lies inside of the mesh; it is 0.005 m off"),
        ({"mesh.file": "ball", "place": (0.01, 0.0, 0.0), "keep_out": True}, "fixture.place",
         "lies outside of the mesh; it is 0.005"),
    ],
)  # fmt: skip
def test_what_cannot_hold_a_hand_is_refused_by_its_name(
    values: Any, name: str, text: str, folder: Path
) -> None:
    if values.get("mesh.file") == "ball":
        values = values | {"mesh.file": str(folder / "ball.stl")}
    settings: Any = {f"fixture.{key}": value for key, value in values.items()}
    with pytest.raises(ParameterError, match=text) as error:
        tc.run("coarse_box", duration=1.0, settings={"fixture": "mesh", **settings})
    assert error.value.name == name
