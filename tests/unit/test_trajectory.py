"""Joint-space cubics: the published case, rest at both ends, and the shortest time."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from teleop_core.kernels.geometry import Array
from teleop_core.robots.arms.rcrt1_dynamics import DRIVES
from teleop_core.slave.trajectory import cubic_move, shortest_move_time

# A handful of multiplications of numbers up to 100.
ROUNDING = 1e-12
joints = st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6).map(np.array)


def test_cubic_passes_the_published_places_and_speeds() -> None:  # case 24
    times = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    place, speed = cubic_move(np.array([0.0]), np.array([45.0]), 1.0, times)
    assert np.allclose(place[:, 0], [0.0, 7.03125, 22.5, 37.96875, 45.0], atol=ROUNDING)
    assert np.allclose(speed[:, 0], [0.0, 50.625, 67.5, 50.625, 0.0], atol=ROUNDING)


@given(joints, joints, st.floats(0.1, 20.0))
def test_moves_rest_at_both_ends_and_outside_them(start: Array, end: Array, move_time: float) -> None:
    times = np.array([-1.0, 0.0, move_time, move_time + 1.0])
    place, speed = cubic_move(start, end, move_time, times)
    assert np.allclose(place, [start, start, end, end], rtol=0.0, atol=ROUNDING)
    assert np.array_equal(speed, np.zeros((4, 6)))


@given(joints, joints, st.floats(0.1, 20.0))
def test_joints_keep_their_proportion_all_along(start: Array, end: Array, move_time: float) -> None:
    place, _ = cubic_move(start, end, move_time, np.linspace(0.0, move_time, 11))
    share = np.linspace(0.0, 1.0, 11)
    share = 3.0 * share**2 - 2.0 * share**3
    assert np.allclose(place, start + share[:, None] * (end - start), rtol=0.0, atol=ROUNDING)


def test_speed_is_the_slope_of_the_place() -> None:
    start, end, move_time, h = np.zeros(2), np.array([1.0, -2.0]), 1.7, 1e-5
    middle = np.linspace(0.1, 1.6, 16)
    before, after = (cubic_move(start, end, move_time, middle + d)[0] for d in (-h, h))
    _, speed = cubic_move(start, end, move_time, middle)
    # Central difference: h² a3 = 1e-10 of truncation, 1e-16 / h = 1e-11 of rounding.
    assert np.allclose((after - before) / (2.0 * h), speed, rtol=0.0, atol=1e-9)


@given(joints, joints)
def test_shortest_time_brings_one_joint_to_its_limit_and_none_beyond(start: Array, end: Array) -> None:
    move_time = shortest_move_time(start, end, DRIVES.speed_limit)
    if move_time < 1e-9:
        return
    _, speed = cubic_move(start, end, move_time, np.array([0.5 * move_time]))
    share = np.abs(speed[0]) / DRIVES.speed_limit
    assert math.isclose(share.max(), 1.0, rel_tol=ROUNDING)


def test_move_to_where_the_arm_is_takes_no_time_and_stays() -> None:
    here = np.array([0.3, -0.2])
    move_time = shortest_move_time(here, here, np.ones(2))
    place, speed = cubic_move(here, here, move_time, np.array([0.0, 1.0]))
    assert move_time == 0.0
    assert np.array_equal(place, [here, here])
    assert not speed.any()
