"""Virtual fixture: published wall, and a box whose force points back from edges and corners too."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from any_shape import depth_of
from teleop_core.coupling.fixtures import Fixture
from teleop_core.coupling.mapping.walls import wall_force
from teleop_core.kernels.geometry import Array
from teleop_core.shapes.box import BOX, BoxParameters

# Products of numbers up to four.
ROUNDING = 1e-12
WIDTH, STIFFNESS, LARGEST = 0.03, 3300.0, 3.3
CUBE = np.full(3, WIDTH)
places = st.tuples(*[st.floats(-0.05, 0.05)] * 3).map(np.array)


def penetration(offset: Any, size: Array = CUBE) -> tuple[Array, float]:
    length, way = depth_of(Fixture(BOX, BoxParameters(size=tuple(size.tolist()))), offset)
    return way, length


def force(position: ArrayLike, stiffness: float = STIFFNESS, largest: float = LARGEST, size: Array = CUBE) -> Array:
    depth, length = penetration(position, size)
    push = np.full(3, math.nan)
    wall_force(depth, length, stiffness, largest, push)
    return push


@pytest.mark.parametrize(("mm", "newton"), [(14.9, 0.0), (15.5, -1.65), (16.0, -3.3), (17.0, -3.3), (-15.5, 1.65)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_wall_pushes_with_the_published_force(mm: float, newton: float, axis: int) -> None:  # case 23
    position, expected = np.zeros(3), np.zeros(3)
    position[axis], expected[axis] = mm * 1e-3, newton
    assert np.allclose(force(position), expected, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("boundary", [0.015, 0.016])
def test_soft_wall_has_no_step_where_it_begins_and_where_it_is_full(boundary: float) -> None:
    before, after = force((boundary - 1e-9, 0, 0)), force((boundary + 1e-9, 0, 0))
    # 2 nm at 3300 N/m.
    assert np.abs(after - before).max() <= 6.7e-6


@pytest.mark.parametrize("stiffness", [STIFFNESS, math.inf])
@pytest.mark.parametrize("position", [(0, 0, 0), (0.015, 0, 0), (0.015, -0.015, 0.015)])
def test_inside_and_on_the_wall_there_is_no_force(stiffness: float, position: tuple[float, float, float]) -> None:
    assert not force(position, stiffness).any()


@given(places)
def test_force_never_exceeds_its_limit_and_points_back_to_the_box(position: Array) -> None:
    for stiffness in (STIFFNESS, math.inf):
        push = force(position, stiffness)
        depth, length = penetration(position)
        assert np.linalg.norm(push) <= LARGEST * (1.0 + ROUNDING)
        # Along the penetration, against it: right at edges and corners too.
        assert np.allclose(np.cross(push, depth), 0.0, atol=ROUNDING)
        assert push @ depth <= 0.0
        assert length == 0.0 or push @ depth < 0.0


@pytest.mark.parametrize("depth", [5e-324, 1e-308, 1e-160])
@pytest.mark.parametrize("stiffness", [STIFFNESS, math.inf])
def test_smallest_penetrations_give_finite_forces(depth: float, stiffness: float) -> None:
    out = np.full(3, math.nan)
    wall_force(np.array([depth, 0.0, 0.0]), depth, stiffness, LARGEST, out)
    assert np.isfinite(out).all()
    assert np.linalg.norm(out) <= LARGEST * (1.0 + ROUNDING)
