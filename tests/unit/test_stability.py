"""Stability: the boundary of one axis is the published one, ours lies next to it."""

import numpy as np
import pytest
from scipy.optimize import brentq

from teleop_core.graph.signals import DT
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.one_axis import Grip, exact_boundary, found_boundary, growth
from teleop_lab.experiments.sampled_wall import Wall, wall_growth
from teleop_lab.experiments.stability import DELAYS, GRIPS, STIFFEST, _note, calm_speed, chain_boundary, fastest
from teleop_lab.experiments.zwidth import BARE

MEDIUM = GRIPS["medium"]
PUBLISHED = {0.0: 24_200.0, 0.02: 708.0, 0.05: 394.0, 0.1: 318.0, 0.2: 301.0}
"""Of a hand of 0.25 kg held with 300 N/m and 12 N·s/m [N/m]."""


def largest_root(grip: Grip, delay: float, stiffness: float, dt: float = 1e-3) -> float:
    """Growth [1/s] of the hand before a spring whose force is held for a tick, by its matrix."""
    ticks = round(delay / dt)
    a = np.array([[0.0, 1.0], [-grip.stiffness / grip.mass, -grip.damping / grip.mass]])
    # Exact step of the hand under a constant force, by a Taylor series.
    whole, term, forced = np.eye(2), np.eye(2), dt * np.eye(2)
    for k in range(1, 12):
        term = term @ a * dt / k
        whole, forced = whole + term, forced + term * dt / (k + 1)
    b = forced @ np.array([0.0, 1.0 / grip.mass])
    size = 2 + ticks
    step = np.zeros((size, size))
    step[:2, :2] = whole
    if ticks:
        step[:2, -1] = b
        step[2, 0] = -stiffness
        for i in range(3, size):
            step[i, i - 1] = 1.0
    else:
        step[:2, 0] -= stiffness * b
    return np.log(np.abs(np.linalg.eigvals(step)).max()) / dt


@pytest.mark.parametrize("delay", DELAYS)
def test_the_exact_boundary_is_the_published_one(delay: float) -> None:
    assert exact_boundary(MEDIUM, delay) == pytest.approx(PUBLISHED[delay], rel=5e-3)


@pytest.mark.parametrize("grip", GRIPS.values(), ids=GRIPS)
@pytest.mark.parametrize("delay", DELAYS)
def test_the_exact_boundary_is_where_the_roots_of_the_sampled_hand_leave_the_circle(grip: Grip, delay: float) -> None:
    exact = exact_boundary(grip, delay)
    assert largest_root(grip, delay, 0.98 * exact) < 0.0 < largest_root(grip, delay, 1.02 * exact)


@pytest.mark.parametrize("grip", [MEDIUM, BARE], ids=["in a hand", "bare"])
@pytest.mark.parametrize("late", [0, 1, 10, 20, 50, 100, 200])
def test_our_device_stands_a_wall_that_is_late_as_stiff_as_its_exact_axis_within_two_percent(
    grip: Grip, late: int
) -> None:
    near = exact_boundary(grip, 1e-3 * late)
    exact = brentq(lambda k: largest_root(grip, 1e-3 * late, k), 0.9 * near, 1.1 * near, rtol=1e-3)
    below, above = (wall_growth(grip, Wall(share * exact, 0.0, late)) for share in (0.98, 1.02))
    assert below < 0.0 < above


@pytest.mark.parametrize("grip", GRIPS.values(), ids=GRIPS)
@pytest.mark.parametrize("delay", DELAYS)
def test_our_hand_and_mapping_swing_up_where_an_axis_that_is_a_tick_later_does(grip: Grip, delay: float) -> None:
    exact = exact_boundary(grip, delay + DT)
    assert growth(grip, delay, 0.98 * exact) < 0.0 < growth(grip, delay, 1.02 * exact)


def test_the_boundary_that_is_found_lies_where_nothing_grows() -> None:
    found = found_boundary(MEDIUM, 0.02)
    assert abs(growth(MEDIUM, 0.02, found)) < 0.05
    assert growth(MEDIUM, 0.02, 0.97 * found) < 0.0 < growth(MEDIUM, 0.02, 1.03 * found)


def test_force_throws_a_hand_above_its_boundary_but_not_with_a_tank_or_by_a_soft_spring() -> None:
    bench, force = Bench(), ("position_force", "none")
    calm = calm_speed(bench, MEDIUM)
    found = chain_boundary(bench, MEDIUM, 0.05, force, calm)
    assert 600.0 < found < 1200.0
    for way in (("position_force", "tank"), ("position_position", "none"), ("position_force", "tdpa")):
        assert chain_boundary(bench, MEDIUM, 0.05, way, calm) == STIFFEST
    below, above = (fastest(bench, MEDIUM, 0.05, share * found, force) for share in (0.5, 2.0))
    assert above > 2.0 * below


def test_a_boundary_above_that_of_a_shorter_delay_is_marked_as_not_found() -> None:
    found = {("firm", 0.0): (9000.0,), ("firm", 0.02): (700.0,), ("firm", 0.05): (2000.0,), ("firm", 0.1): (50_000.0,)}
    notes = [_note(found, "firm", delay, 0) for delay in DELAYS[:4]]
    assert notes == ["", "", "no boundary: session too short", "stiffest tried"]
