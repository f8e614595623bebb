"""Mobility: the counts of the lectures and the thesis."""

import pytest

from teleop_machines import mobility


@pytest.mark.parametrize(
    ("space", "links", "joints", "freedoms", "expected"),
    [
        pytest.param(mobility.PLANAR, 4, 4, 4, 1, id="P1 four-bar"),
        pytest.param(6, 8, 9, 15, 3, id="P2 3-RPS"),
        pytest.param(6, 11, 12, 18, 6, id="P3 three-fingered hand"),
        pytest.param(6, 14, 18, 36, 6, id="P4 Stewart, universal and spherical"),
        pytest.param(6, 14, 18, 30, 0, id="Stewart, universal at both ends"),
        pytest.param(mobility.PLANAR, 4, 3, 3, 3, id="planar 3R"),
        pytest.param(6, 7, 6, 6, 6, id="PUMA 6R"),
    ],
)
def test_the_count_gives_the_published_freedoms(
    space: int, links: int, joints: int, freedoms: int, expected: int
) -> None:
    assert mobility.degrees_of_freedom(links, joints, freedoms, space=space) == expected


def test_parallel_axes_counted_in_space_look_overconstrained() -> None:
    assert mobility.degrees_of_freedom(4, 4, 4) == -2


@pytest.mark.parametrize(("joints", "freedoms", "expected"), [(4, 1, 3), (9, 3, 6)])
def test_passive_joints_are_those_without_a_motor(joints: int, freedoms: int, expected: int) -> None:
    # P5: four-bar and 3-RPS.
    assert mobility.passive_joints(joints, freedoms) == expected


@pytest.mark.parametrize(("links", "joints", "expected"), [(10, 10, 1), (5, 5, 1), (14, 18, 5)])
def test_independent_loops_of_mma_parallelogram_and_stewart_platform(links: int, joints: int, expected: int) -> None:
    # H13 and P6.
    assert mobility.independent_loops(links, joints) == expected
