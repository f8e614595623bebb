"""Mesh: a triangle mesh from a file as an object to touch, beside its analytic shape."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

import coal
import numpy as np
import pytest
import trimesh
from trimesh import Trimesh

import teleop_core as tc
from led_tip import assert_none_gains_energy
from present import present
from teleop_console.world_nodes import object_outline
from teleop_core.bags import kept_files
from teleop_core.base.errors import ParameterError, TeleopError
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.progress import in_work, told
from teleop_core.kernels.store import prune, user_cache
from teleop_core.robots import load_robot
from teleop_core.session import configuration, virtual
from teleop_core.shapes.basis import distance_grid
from teleop_core.shapes.basis.triangles import read_triangles, tree_of, write_distances
from teleop_core.shapes.mesh import MeshParameters
from teleop_core.slave.world import WORLD_OBJECTS

BOX = (60.0, 60.0, 30.0)  # as the box of the world, in mm as files are


class Bounds(NamedTuple):
    """What a mesh may differ by from its shape, to 3 mm from its surface, as docs/world.md says."""

    distance: float  # [m]
    normal: float  # [degrees]


BOUNDS = {"sphere": Bounds(25e-6, 0.3), "box": Bounds(3e-6, 0.1), "capsule": Bounds(30e-6, 1.0)}
AWAY = 6e-3  # from the edges of the box, and from its ridges within [m]


def solid(name: str) -> Trimesh:
    """Mesh of the shape of that name in the world, about its middle, in mm."""
    if name == "box":
        return trimesh.creation.box(BOX)
    if name == "sphere":
        return trimesh.creation.icosphere(subdivisions=5, radius=15.0)
    return trimesh.creation.capsule(height=60.0, radius=10.0, count=[192, 192])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Meshes of the shapes in the world, and a cache of its own."""
    made = tmp_path_factory.mktemp("meshes")
    for name in BOUNDS:
        solid(name).export(made / f"{name}.stl")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TELEOP_KERNELS", str(Path.home() / ".cache" / "teleop_core" / "kernels"))
        patch.setenv("XDG_CACHE_HOME", str(made / "cache"))
        yield made


def parameters(folder: Path, name: str, **more: Any) -> MeshParameters:
    """Parameters of a mesh; that of a capsule is turned from z to y, as the world's lies."""
    angles = (0.5 * np.pi, 0.0, 0.0) if name == "capsule" else (0.0, 0.0, 0.0)
    return MeshParameters(**{"file": str(folder / f"{name}.stl"), "angles": angles} | more)


def analytic(name: str) -> Any:
    """Parameters of the shape that the mesh is one of."""
    size = {"size": tuple(1e-3 * x for x in BOX)} if name == "box" else {}
    return WORLD_OBJECTS.find(name).parameters(**size)


def found(name: str, group: object, places: Array) -> tuple[Array, Array]:
    """Distances (N,) and normals (N, 3) of an object at places (N, 3)."""
    part, normals = WORLD_OBJECTS.find(name), np.zeros((len(places), 3))
    shape = part.numbers(group)
    distances = [part.distance(*row) for row in zip(places, repeat(shape), normals, strict=False)]
    return np.array(distances), normals / np.linalg.norm(normals, axis=1)[:, None]


@pytest.mark.parametrize("name", BOUNDS)
def test_a_fine_mesh_has_distance_and_normal_of_its_shape_within_the_bounds(name: str, folder: Path) -> None:
    places = np.random.default_rng(1).uniform(-0.045, 0.045, (40_000, 3))
    wanted, outward = found(name, analytic(name), places)
    is_compared = np.abs(wanted) < 3e-3
    if name == "box":
        over = np.sort(np.abs(places) - 0.5e-3 * np.array(BOX), axis=1)
        is_compared &= over[:, 2] - over[:, 1] > AWAY
    places, wanted, outward = places[is_compared], wanted[is_compared], outward[is_compared]
    distance, normal = found("mesh", parameters(folder, name), places)
    assert len(places) > 300
    assert np.abs(distance - wanted).max() < BOUNDS[name].distance
    angle = 2.0 * np.arcsin(0.5 * np.linalg.norm(normal - outward, axis=1))
    assert np.degrees(angle.max()) < BOUNDS[name].normal
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize("name", BOUNDS)
def test_inside_is_negative_and_outside_positive_everywhere(name: str, folder: Path) -> None:
    """Also far beyond the grid."""
    places = np.random.default_rng(2).uniform(-1.0, 1.0, (4000, 3)) * 0.05
    places[:400] *= 20.0
    wanted, outward = found(name, analytic(name), places)
    is_clear = np.abs(wanted) > 1e-3
    distance, normal = found("mesh", parameters(folder, name), places)
    assert (np.sign(distance) == np.sign(wanted))[is_clear].all()
    is_far = wanted > 0.02
    np.testing.assert_allclose(distance[is_far], wanted[is_far], rtol=0.05)
    assert ((normal * outward).sum(axis=1) > 0.9)[is_far].all()


def test_distances_at_the_nodes_are_those_of_a_library_of_others_with_the_right_sign() -> None:
    """A ring, whose hole is outside, and a star of thin spikes, at whose tips many sides meet."""
    star = trimesh.creation.box((4.0, 4.0, 4.0)).subdivide().subdivide()
    star.vertices *= np.random.default_rng(3).uniform(2.0, 6.0, (len(star.vertices), 1))
    ring = trimesh.creation.torus(20.0, 5.0)
    rng, dot, here = np.random.default_rng(4), coal.Sphere(1e-12), coal.Transform3s()
    for mesh in (ring, star):
        data = mesh.export(file_type="stl")
        triangles = read_triangles(Path("some.stl"), data, 1e-3 * np.eye(3))
        tree, model = tree_of(triangles), coal.BVHModelOBBRSS()
        model.beginModel(len(triangles.faces), len(triangles.points))
        for corners in triangles.points[triangles.faces]:
            model.addTriangle(*corners)
        model.endModel()
        solid_angles = []
        for place in rng.uniform(-0.03, 0.03, (400, 3)):
            distance, result = np.empty((1, 1)), coal.DistanceResult()
            write_distances(tree, place, 1.0, distance)
            there = coal.Transform3s(np.eye(3), place)
            coal.distance(model, here, dot, there, coal.DistanceRequest(True, True), result)
            assert abs(distance[0, 0]) == pytest.approx(result.min_distance + 1e-12, abs=1e-8)
            # The solid angle of all triangles, of van Oosterom and Strackee 1983.
            a, b, c = (triangles.points[triangles.faces] - place).transpose(1, 0, 2)
            la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
            ab, bc, ca = ((x * y).sum(axis=1) for x, y in ((a, b), (b, c), (c, a)))
            below = la * lb * lc + ab * lc + bc * la + ca * lb
            angle = 2.0 * np.arctan2((a * np.cross(b, c)).sum(axis=1), below).sum()
            assert (distance[0, 0] < 0.0) == (angle > 2.0 * np.pi)
            solid_angles.append(angle)
        assert min(solid_angles) < 1.0 < max(solid_angles)


def loop(rng: np.random.Generator, middle: tuple[float, float, float]) -> Array:
    """A closed way (N, 3) [m] of a second to four, slow and fast, through an object's top."""
    share = np.linspace(0.0, 1.0, int(rng.integers(1000, 4000)))
    way = np.zeros((len(share), 3))
    for k in range(1, 5):
        way += np.sin(2.0 * np.pi * k * share)[:, None] * rng.normal(size=3)
        way += (1.0 - np.cos(2.0 * np.pi * k * share))[:, None] * rng.normal(size=3)
    return way / np.abs(way).max() * (0.05, 0.05, 0.03) + middle


@pytest.mark.parametrize("friction", [0.0, 0.6])
@pytest.mark.parametrize("name", ["box", "sphere"])
def test_no_motion_gains_energy_from_a_mesh_whatever_edge_it_crosses(name: str, friction: float, folder: Path) -> None:
    """Tips that are led around closed ways, so fast and deep that they cross all its ridges."""
    rng = np.random.default_rng(5)
    ways = (loop(rng, (0.0, 0.0, 0.028 if name == "box" else 0.018)) for _ in range(60))
    assert_none_gains_energy(ways, "mesh", parameters(folder, name), friction)


def without(mesh: Trimesh, face: int) -> Trimesh:
    mesh.update_faces(np.arange(len(mesh.faces)) != face)
    return mesh


def pressed(file: Path, *settings: str) -> virtual.VirtualTime:
    """Session that presses a mesh."""
    texts = ["world=mesh", f"world.mesh.file={file}", *settings]
    return virtual.VirtualTime(configuration.configure("palpation", settings=texts))


def test_a_hole_is_told_by_the_middle_of_an_edge_along_it(tmp_path: Path) -> None:
    mesh = solid("box")
    corners = mesh.vertices[mesh.faces[3]]
    without(mesh, 3).export(tmp_path / "hole.stl")
    with pytest.raises(ParameterError) as caught:
        pressed(tmp_path / "hole.stl")
    told_at = str(caught.value).partition("[")[2].partition("]")[0]
    place = np.array([float(x) for x in told_at.split(",")])
    middles = 0.5 * (corners + np.roll(corners, 1, axis=0))
    assert np.linalg.norm(middles - place, axis=1).min() < 1e-3


def test_a_mesh_that_is_inside_out_is_turned(folder: Path, tmp_path: Path) -> None:
    mesh = solid("box")
    mesh.invert()
    mesh.export(tmp_path / "inverted.stl")
    for name in ("inverted", "box"):
        place = tmp_path if name == "inverted" else folder
        distance, _ = found("mesh", parameters(place, name), np.array([(0.0, 0.0, 0.012)]))
        assert distance[0] == pytest.approx(-3e-3, abs=1e-5)


def test_a_grid_is_made_once_and_kept_by_what_the_file_says(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made, heard = [], []
    make = distance_grid._make

    def counted(request: distance_grid.GridRequest) -> distance_grid.DistanceGrid:
        made.append(request.step)
        return make(request)

    monkeypatch.setattr(distance_grid, "_make", counted)
    file = tmp_path / "block.stl"
    for size in (BOX, (40.0, 40.0, 40.0)):
        trimesh.creation.box(size).export(file)
        for _ in range(3):
            distance_grid._found.cache_clear()
            grid = distance_grid.distance_grid(distance_grid.GridRequest(str(file), 1e-3, (0.0, 0.0, 0.0), 2e-3))
            heard.append(grid.numbers)
    assert len(made) == 2
    np.testing.assert_array_equal(heard[0], heard[2])
    assert len(heard[0]) != len(heard[3])
    kept = list(present(user_cache("grids")).iterdir())
    assert sorted(path.suffix for path in kept) == [".npz", ".npz"]
    kept[0].write_bytes(kept[0].read_bytes()[:1000])  # damaged: made again
    distance_grid._found.cache_clear()
    distance_grid.distance_grid(distance_grid.GridRequest(str(file), 1e-3, (0.0, 0.0, 0.0), 2e-3))
    assert prune(days=-1.0) >= 2
    assert not list(present(user_cache("grids")).iterdir())
    distance_grid._found.cache_clear()


def test_who_waits_is_told_that_a_grid_is_made_and_how_far_it_is(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    seen = []

    def watched(*arguments: Any) -> None:
        seen.append(in_work())
        write_distances(*arguments)

    monkeypatch.setattr(distance_grid, "write_distances", watched)
    request = distance_grid.GridRequest(str(folder / "box.stl"), 1e-3, (0.0, 0.0, 0.0), 3e-3)
    distance_grid.distance_grid(request)
    assert seen[0] == "making the distance grid of box.stl (0 %)"
    percent = 100 * (len(seen) - 1) // len(seen)
    assert seen[-1] == f"making the distance grid of box.stl ({percent} %)"
    assert in_work() == ""
    with pytest.raises(TeleopError, match="something"), told("something"):
        raise TeleopError(in_work())
    assert in_work() == ""


def test_a_session_without_a_mesh_loads_no_reader_and_compiles_no_grid() -> None:
    code = (
        "import sys\n"
        "from teleop_core.session.configuration import configure\n"
        "from teleop_core.shapes import mesh\n"
        "from teleop_core.shapes.basis import triangles\n"
        "configure('palpation').group('slave_sim').world.shape\n"
        "assert not {'trimesh', 'coal'} & set(sys.modules)\n"
        "kernels = mesh.mesh_distance, triangles.write_distances\n"
        "assert not any(getattr(k, 'signatures', ()) for k in kernels)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def gone(path: Path) -> None:
    path.unlink()


def another(path: Path) -> None:
    trimesh.creation.box((50.0, 50.0, 31.0)).export(path)


def recorded(folder: Path, where: Path) -> tuple[tc.Recording, Path]:
    """Recording of a session that presses a mesh, and that mesh."""
    path = where / "block.stl"
    path.write_bytes((folder / "box.stl").read_bytes())
    settings = {"world": "mesh", "world.mesh.file": str(path)}
    return tc.run("palpation", duration=8.0, out=where / "bag", settings=settings), path


@pytest.mark.parametrize(("becomes", "said"), [(gone, "is gone"), (another, "is another by now")])
def test_a_mesh_too_large_to_keep_is_told_when_it_is_not_that_of_the_recording(
    becomes: Callable[[Path], None], said: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_files, "_MOST", 10)
    with pytest.warns(UserWarning, match="of block.stl it keeps only digests"):
        recording, path = recorded(folder, tmp_path)
    assert kept_files.recorded_files(recording.metadata) == {str(path): str(path)}
    becomes(path)
    with pytest.warns(UserWarning, match=said):
        assert kept_files.recorded_files(recording.metadata) == {}


def test_the_page_draws_the_edges_and_sections_of_a_mesh_where_it_lies(folder: Path) -> None:
    robot, place = load_robot("rcrt1"), np.array((0.2, -0.2, -0.1))
    drawn = object_outline(
        {"kind": "mesh", "mesh.file": str(folder / "box.stl"), "place": tuple(place.tolist())}, robot
    )
    assert drawn.shape[1:] == (2, 3)
    offsets, half = drawn.reshape(-1, 3) - place, 0.5e-3 * np.array(BOX)
    np.testing.assert_allclose(np.ptp(offsets, axis=0), 2.0 * half, atol=1e-9)
    is_on = np.isclose(np.abs(offsets), half, atol=1e-9)
    assert is_on.any(axis=1).all()
    lengths = np.linalg.norm(drawn[:, 1] - drawn[:, 0], axis=1)
    assert lengths.sum() == pytest.approx((8.0 + 8.0) * half.sum())
    assert not len(object_outline({"kind": "mesh", "mesh.file": "none.stl"}, robot))
