"""Height field: a table of heights as an object to touch, beside plane and sphere."""

from collections.abc import Iterator
from itertools import repeat
from pathlib import Path

import numpy as np
import pytest

import teleop_core as tc
from led_tip import assert_none_gains_energy
from teleop_console.world_nodes import object_outline
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.shapes.basis.heights import THICKNESS, read_heights
from teleop_core.shapes.height_field import HEIGHT_FIELD, HeightFieldParameters

SPACING = 2e-3
X, Y = np.meshgrid(SPACING * (np.arange(31) - 15.0), SPACING * (np.arange(25) - 12.0), indexing="ij")
TILT = np.array((0.3, -0.2))
BALL, DEEP = 0.05, -0.045  # radius of a ball, and height of its middle [m]
FIELDS = {
    "flat": np.zeros_like(X),
    "tilted": TILT[0] * X + TILT[1] * Y,
    "ball": DEEP + np.sqrt(BALL**2 - X**2 - Y**2),
    "waves": 1.5e-3 * np.sin(X / 4e-3) * np.cos(Y / 5e-3),
}
AWAY = 8e-3  # from the edges of a field [m]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Tables of heights, and a cache of its own."""
    made = tmp_path_factory.mktemp("heights")
    for name, heights in FIELDS.items():
        np.savetxt(made / f"{name}.csv", heights, delimiter=",")
        np.save(made / f"{name}.npy", heights)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TELEOP_KERNELS", str(Path.home() / ".cache" / "teleop_core" / "kernels"))
        patch.setenv("XDG_CACHE_HOME", str(made / "cache"))
        yield made


def field(folder: Path, name: str, ending: str = "csv", **more: float) -> HeightFieldParameters:
    """Parameters of a field."""
    return HeightFieldParameters(file=str(folder / f"{name}.{ending}"), **more)


def found(group: HeightFieldParameters, places: Array, part: tc.Shape = HEIGHT_FIELD) -> tuple[Array, Array]:
    """Distances (N,) and normals (N, 3) of an object at places (N, 3)."""
    normals, shape = np.zeros((len(places), 3)), part.numbers(group)
    distances = [part.distance(*row) for row in zip(places, repeat(shape), normals, strict=False)]
    return np.array(distances), normals


def near_surface(name: str, rng: np.random.Generator, count: int = 20_000) -> tuple[Array, Array, Array]:
    """Places (N, 3) to 3 mm from a surface and away from its edges; distances and normals there."""
    half = (0.5 * np.array((np.ptp(X), np.ptp(Y)))) - AWAY
    places = np.column_stack((rng.uniform(-half, half, (count, 2)), rng.uniform(-0.02, 0.02, count)))
    if name == "ball":
        ways = places - (0.0, 0.0, DEEP)
        size = np.linalg.norm(ways, axis=1)
        distances, normals = size - BALL, ways / size[:, None]
    else:
        slope = TILT if name == "tilted" else np.zeros(2)
        up = np.append(-slope, 1.0) / np.sqrt(1.0 + slope @ slope)
        distances, normals = places @ up, np.tile(up, (count, 1))
    is_near = np.abs(distances) < 3e-3
    return places[is_near], distances[is_near], normals[is_near]


@pytest.mark.parametrize(
    ("name", "distance", "angle"), [("flat", 6e-6, 0.1), ("tilted", 6e-6, 0.2), ("ball", 6e-6, 0.1)]
)
def test_a_field_has_distance_and_normal_of_its_plane_or_sphere_within_the_bounds(
    name: str, distance: float, angle: float, folder: Path
) -> None:
    places, wanted, outward = near_surface(name, np.random.default_rng(1))
    measured, normal = found(field(folder, name), places)
    assert len(places) > 1000
    assert np.abs(measured - wanted).max() < distance
    turn = 2.0 * np.arcsin(0.5 * np.linalg.norm(normal - outward, axis=1))
    assert np.degrees(turn.max()) < angle


def test_between_heights_the_surface_is_that_of_a_cubic_spline_of_others(folder: Path) -> None:
    """Natural at the ends, as ours."""
    from scipy.interpolate import CubicSpline

    data = (folder / "waves.npy").read_bytes()
    points = read_heights(Path("waves.npy"), data, SPACING, 1e-3).points
    rows, columns = 4 * 30 + 1, 4 * 24 + 1
    top = points[: rows * columns].reshape(rows, columns, 3)
    x, y = top[:, 0, 0], top[0, :, 1]
    along = CubicSpline(X[:, 0], FIELDS["waves"], axis=0, bc_type="natural")(x)
    wanted = CubicSpline(Y[0], along, axis=1, bc_type="natural")(y)
    np.testing.assert_allclose(top[..., 2], wanted, atol=1e-15)


def test_the_block_is_a_closed_mesh_for_a_library_of_others(folder: Path) -> None:
    import trimesh

    heights = FIELDS["waves"]
    data = (folder / "waves.npy").read_bytes()
    mesh = trimesh.Trimesh(*read_heights(Path("waves.npy"), data, SPACING, 1e-3), process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    floor = mesh.bounds[0, 2]
    assert floor == pytest.approx(heights.min() - THICKNESS, abs=2e-4)
    mean = mesh.volume / (np.ptp(X) * np.ptp(Y))
    assert mean == pytest.approx(-floor, abs=1e-4)  # waves have a mean near zero
    assert found(field(folder, "waves"), np.array([(0.0, 0.0, floor - 5e-3)]))[0] > 4.9e-3


def test_rows_are_places_along_x_and_both_formats_say_the_same(folder: Path) -> None:
    places = np.array([(0.01, 0.0, 3e-3), (0.0, 0.01, -2e-3)])
    for ending in ("csv", "npy"):
        distances, _ = found(field(folder, "tilted", ending), places)
        np.testing.assert_allclose(distances, 0.0, atol=1e-8)


def test_the_normal_turns_without_a_kink_where_triangles_and_cells_meet(folder: Path) -> None:
    x = np.linspace(-0.02, 0.02, 8001)
    height = 1.5e-3 * np.sin(x / 4e-3)
    _, normal = found(field(folder, "waves"), np.column_stack((x, 0.0 * x, height - 2e-4)))
    rate = np.linalg.norm(np.diff(normal, axis=0), axis=1) / np.diff(x)
    sharpest = 1.5e-3 / 4e-3**2  # curvature of the waves [1/m]
    assert rate.max() < 1.6 * sharpest
    assert np.abs(np.diff(rate)).max() < 0.02 * sharpest


@pytest.mark.parametrize("friction", [0.0, 0.6])
def test_no_motion_gains_energy_from_a_field(friction: float, folder: Path) -> None:
    """Tips that are led around closed ways through it, also across its edges."""
    rng, share = np.random.default_rng(5), np.linspace(0.0, 1.0, 3001)

    def loop() -> Array:
        way = sum((1.0 - np.cos(2.0 * np.pi * k * share))[:, None] * rng.normal(size=3) for k in range(1, 5))
        return way / np.abs(way).max() * (0.05, 0.04, 0.02) + (0.0, 0.0, 0.008)

    assert_none_gains_energy((loop() for _ in range(40)), "height_field", field(folder, "waves"), friction)


def test_the_page_draws_the_field_where_it_lies(folder: Path) -> None:
    place = np.array((0.2, -0.2, -0.1))
    values = {"kind": "height_field", "height_field.file": str(folder / "ball.csv")}
    drawn = object_outline(values | {"place": tuple(place.tolist())}, load_robot("rcrt1"))
    offsets = drawn.reshape(-1, 3) - place
    np.testing.assert_allclose(np.ptp(offsets[:, :2], axis=0), (np.ptp(X), np.ptp(Y)), atol=1e-9)
    assert offsets[:, 2].max() == pytest.approx(FIELDS["ball"].max(), abs=1e-6)
