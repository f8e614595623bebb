"""Scenarios of touch: ``wall`` and ``contour`` from approach to retreat, by force and by score."""

from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.kernels.geometry import Array

WALL, BALL, RADIUS = 0.24, np.array((0.25, -0.2357, -0.105)), 0.03
STIFFNESS = {"wall": 20_000.0, "contour": 1000.0}


@pytest.fixture(scope="module", params=STIFFNESS)
def session(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, tc.Recording, Array, Array]:
    """Name of a scenario, its recording, forces (N, 3) [N] and places (N, 3) [m] of the tip."""
    recording = tc.run(request.param, out=tmp_path_factory.mktemp(request.param) / "bag")
    force, place = recording["slave/true_cf"], recording["slave/true_cp"]
    # A force holds until the next one is sent.
    last = np.searchsorted(force.stamp_ns, place.stamp_ns, side="right") - 1
    assert last.min() >= 0
    return request.param, recording, force.values[last, :3], place.values[:, :3]


def normals(name: str, places: Array) -> tuple[Array, Array]:
    """Ways (N, 3) out of the object, and distances (N,) [m] of places outside it."""
    if name == "wall":
        return np.tile((1.0, 0.0, 0.0), (len(places), 1)), places[:, 0] - WALL
    ways = places - BALL
    distances = np.linalg.norm(ways, axis=1)
    return ways / distances[:, None], distances - RADIUS


def test_the_tip_approaches_slides_in_one_touch_and_retreats(session: tuple[str, tc.Recording, Array, Array]) -> None:
    name, _, force, place = session
    is_touching: Any = force.any(axis=1)
    begin, end = np.flatnonzero(is_touching)[[0, -1]]
    assert is_touching[begin : end + 1].all()
    assert 4000 < begin < end < len(force) - 1000
    outside = normals(name, place)[1]
    assert outside[0] > 5e-3
    assert outside[-1] > 5e-3


def test_it_slides_along_the_surface_as_far_as_the_hand_leads_it(
    session: tuple[str, tc.Recording, Array, Array],
) -> None:
    name, _, force, place = session
    way = place[force.any(axis=1)]
    if name == "wall":
        assert np.ptp(way[:, 2]) > 0.025
        assert np.ptp(way[:, 1]) > 0.015
    else:
        angle = np.arctan2(way[:, 0] - BALL[0], way[:, 2] - BALL[2])
        assert np.ptp(angle) > np.radians(70.0)
        assert np.ptp(way[:, 1]) < 1e-3


def test_the_push_is_that_of_the_surface_within_its_friction(session: tuple[str, tc.Recording, Array, Array]) -> None:
    name, _, force, place = session
    out, outside = normals(name, place)
    along = np.einsum("ij,ij->i", force, out)
    across = np.linalg.norm(force - along[:, None] * out, axis=1)
    # The damper's share of the force is damping times speed.
    assert np.abs(along - STIFFNESS[name] * np.maximum(-outside, 0.0)).max() < 0.06 * along.max()
    friction = {"wall": 0.4, "contour": 0.6}[name]
    assert (across <= friction * along + 1e-9).all()
    assert np.median(across[along > 0.0]) > 0.2 * friction * np.median(along[along > 0.0])


def test_while_it_slides_the_push_is_even(session: tuple[str, tc.Recording, Array, Array]) -> None:
    name, _, force, _ = session
    size = np.linalg.norm(force, axis=1)
    begin, end = np.flatnonzero(size)[[0, -1]]
    sliding = size[begin + 1500 : end - 1500]
    low, high = {"wall": (4.5, 8.0), "contour": (0.6, 0.95)}[name]
    assert low < sliding.min() < sliding.max() < high


def test_the_score_tells_the_touch(session: tuple[str, tc.Recording, Array, Array]) -> None:
    _, recording, force, _ = session
    score, size = recording.score(), np.linalg.norm(force, axis=1)
    assert score.value("touch.count") == 1
    assert score.value("touch.peak_n") == pytest.approx(size.max(), rel=1e-6)
    assert score.value("touch.share") == pytest.approx(np.mean(size > 0.0), abs=0.01)
