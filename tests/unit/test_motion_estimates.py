"""Estimates of motion for control laws: no lag, the poles they claim, noise as the rule says."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lsim

from present import present
from teleop_core.graph.signals import DT
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.slave.controllers.disturbance_observer import DISTURBANCE_OBSERVER, DisturbanceObserverParameters
from teleop_core.slave.controllers.motion_estimates import (
    FRICTION_SHARE,
    MEMORY,
    SLOWEST_RATIO,
    approach,
    beyond,
    closeness,
    fading_of,
    follow,
    friction_of_setpoint,
    known_friction,
)

ARM = load_robot("rcrt1")
fadings = st.floats(0.5, 0.98)


def followed(values: Any, expected: float, fading: float) -> Array:
    """Estimates (N, 3) of a position, from rest at 0."""
    memory, rows = np.zeros(MEMORY), np.empty((len(values), 3))
    for k, value in enumerate(values):
        follow(memory, 0, value, expected, fading, DT)
        rows[k] = memory[:3]
    return rows


@given(fadings, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_constant_acceleration_is_followed_without_lag(fading: float, speed: float, acceleration: float) -> None:
    times = DT * np.arange(1, 3001)
    last = followed(speed * times + 0.5 * acceleration * times**2, 0.0, fading)[-1]
    end = times[-1]
    wanted = (speed * end + 0.5 * acceleration * end**2, speed + acceleration * end, acceleration)
    assert np.allclose(last, wanted, rtol=1e-6, atol=1e-6)


@given(fadings)
def test_error_of_the_estimates_dies_with_three_equal_poles(fading: float) -> None:
    def tick(state: Array) -> Array:
        memory = np.concatenate((state, np.zeros(MEMORY - 3)))
        follow(memory, 0, 0.0, 0.0, fading, DT)
        return memory[:3]

    scale = np.diag([1.0, 1.0 / DT, 1.0 / DT**2])  # positions of one size
    matrix = np.linalg.inv(scale) @ np.stack([tick(scale @ e) for e in np.eye(3)], axis=1)
    assert np.allclose(np.poly(matrix), np.poly([fading] * 3), rtol=0, atol=1e-9)


def test_disturbance_is_seen_through_a_filter_of_three_equal_poles() -> None:
    # Umeno and Hori's Q, 1 / (1 + s / pole)³, of a load that comes at once.
    pole, load, count = 100.0, 3.0, 200
    times = DT * np.arange(count)
    found = followed(0.5 * load * (times + DT) ** 2, 0.0, math.exp(-pole * DT))[:, 2]
    _, wanted, _ = lsim(([pole**3], np.poly([-pole] * 3)), np.full(count, load), times)
    # A tick and a half of a filter whose fastest slope is pole / 3.7.
    assert np.abs(found - wanted).max() <= 1.5 * load * pole * DT / 3.0
    assert math.isclose(found[-1], load, rel_tol=1e-4)


def test_expected_acceleration_is_no_disturbance() -> None:
    times = DT * np.arange(1, 101)
    found = followed(0.5 * 7.0 * times**2, 7.0, 0.8)
    assert np.allclose(found[:, 2], 0.0, rtol=0, atol=1e-9)
    assert np.allclose(found[:, 1], 7.0 * times, rtol=1e-9, atol=0)


def frictions(way: Array, most: float = 2.0, travel: float = 0.01) -> Array:
    memory = np.zeros(MEMORY)
    return np.array([friction_of_setpoint(memory, place, most, travel) for place in way])


ways = st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=30).map(np.array)


@given(ways)
def test_friction_fed_forward_never_exceeds_what_is_known_and_turns_with_the_way(way: Array) -> None:
    there, back = frictions(way), frictions(-way)
    assert (np.abs(there) <= 2.0).all()
    assert np.allclose(there, -back, rtol=0, atol=1e-12)


@given(ways, st.integers(2, 9))
def test_friction_fed_forward_depends_on_the_way_not_on_how_fast_it_is_made(way: Array, parts: int) -> None:
    whole = np.concatenate(([0.0], way))
    slow = np.concatenate([np.linspace(a, b, parts + 1)[1:] for a, b in zip(whole, way)])  # noqa: B905
    assert np.allclose(frictions(slow)[parts - 1 :: parts], frictions(way), rtol=0, atol=1e-9)


def test_friction_fed_forward_keeps_its_value_while_the_setpoint_rests() -> None:
    found = frictions(np.concatenate((np.linspace(0.0, 0.5, 50), np.full(100, 0.5))))
    assert (found[49:] == 2.0).all()


@given(st.floats(-10.0, 10.0), st.floats(1e-3, 1.0))
def test_far_setpoint_counts_as_nearer_and_near_ones_as_they_are(error: float, linear: float) -> None:
    near = approach(error, linear)
    assert abs(near) <= abs(error)
    assert near == error or abs(error) > linear
    assert math.copysign(1.0, near) == math.copysign(1.0, error)
    assert closeness(error, linear) == 1.0 or abs(error) > linear


@given(st.floats(1e-3, 1.0), st.floats(1.0, 100.0), st.floats(1e-6, 1e-3))
def test_approach_is_steady_and_grows(linear: float, times: float, more: float) -> None:
    a, b = (approach(linear * factor, linear) for factor in (times, times * (1.0 + more)))
    assert 0.0 < b - a <= linear * times * more * (1.0 + 1e-6)


@given(st.floats(-3.0, 3.0), st.floats(0.0, 2.0))
def test_dead_band_takes_its_width_off(value: float, room: float) -> None:
    assert math.isclose(abs(beyond(value, room)), max(abs(value) - room, 0.0), abs_tol=1e-15)


@pytest.mark.parametrize("axis", range(6))
def test_one_encoder_count_shakes_no_joint_loose(axis: int) -> None:
    # The law itself, at rest on its setpoint, with one count more or less measured.
    drives = present(ARM.drives)
    gains = DISTURBANCE_OBSERVER.gains(DisturbanceObserverParameters(dead_band=0.0), ARM, drives.viscous)
    zero, efforts = np.zeros(6), []
    for counts in (0.0, 1.0):
        memory, effort = np.zeros((6, DISTURBANCE_OBSERVER.memory)), np.empty(6)
        seen = zero.copy()
        seen[axis] = counts * drives.encoder_step[axis]
        DISTURBANCE_OBSERVER.control(
            gains, memory, zero.copy(), seen, zero.copy(), drives.effort_limit.copy(), DT, effort
        )
        efforts.append(effort[axis])
    change, friction = abs(efforts[1] - efforts[0]), known_friction(ARM)[axis]
    is_slowest = -math.log(gains[axis, 3]) / DT <= 1.001 * SLOWEST_RATIO * drives.bandwidth[axis]
    # Where filters may not be slower it is a little more, yet less than what friction holds.
    assert 0.0 < change <= (1.0 if is_slowest else 1.001 * FRICTION_SHARE) * friction


def test_filters_are_slower_where_encoders_are_coarse_for_the_friction_there_is() -> None:
    pole = present(ARM.drives).bandwidth.copy()
    fading = fading_of(ARM, pole, 3.5, stiffness=3.0, damping=3.0)
    bandwidth = -np.log(fading) / DT
    assert (bandwidth >= 2.0 * pole * (1.0 - 1e-9)).all()
    assert (bandwidth <= 3.5 * pole * (1.0 + 1e-9)).all()
    assert np.allclose(bandwidth[1:4], 3.5 * pole[1:4], rtol=1e-9, atol=0)  # friction is large there
    assert np.allclose(bandwidth[4:], 2.0 * pole[4:], rtol=1e-9, atol=0)
