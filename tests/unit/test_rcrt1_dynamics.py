"""RCRT-1 dynamics: published weights, inertia, the drive table."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import ArrayLike

from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.robots.arms import rcrt1_dynamics
from teleop_core.robots.arms.rcrt1_dynamics import DRIVES, LINKS, link_row

# Entries are sums of a few products of numbers up to ten.
ROUNDING = 1e-13
DEGREE = math.pi / 180.0
ROW = link_row()


def inertia(q: Sequence[float] | Array, row: Array = ROW) -> Array:
    out = np.empty((3, 3))
    rcrt1_dynamics.inertia_matrix(np.asarray(q, dtype=float), row, out)
    return out


def gravity(q: ArrayLike, row: Array = ROW) -> Array:
    out, joints = np.empty(6), np.zeros(6)
    joints[:3] = q
    rcrt1_dynamics.gravity_effort(joints, row, out)
    return out


@pytest.mark.parametrize(
    ("theta2", "g3z", "torque"),
    [(113.4, -0.264245, -1.4084), (113.4, 0.264245, -5.1625), (90.0, -0.264245, -1.8141), (90.0, 0.264245, -5.9046)],
)
def test_gravity_torque_is_the_published_one_for_both_readings_of_g3z(theta2: float, g3z: float, torque: float) -> None:
    # Case 25; half of the last digit given.
    effort = gravity((0.0, theta2 * DEGREE, 0.421), link_row(G3z=g3z))
    assert math.isclose(effort[1], torque, abs_tol=5e-5)


def test_gravity_at_home_pulls_joint_3_out_with_the_published_force() -> None:  # case 25
    effort = gravity((0.0, 113.4 * DEGREE, 0.421))
    assert math.isclose(effort[2], -3.0740, abs_tol=5e-5)
    assert not effort[[0, 3, 4, 5]].any()


def test_static_moment_of_the_four_bar_adds_to_axis_2() -> None:
    effort = gravity((0.0, math.pi / 2, 0.3), link_row(m2b_L0b=0.02))
    added = effort[1] - gravity((0.0, math.pi / 2, 0.3))[1]
    assert math.isclose(added, -9.81 * 0.02, abs_tol=ROUNDING)


def test_inertia_of_the_drive_table_is_that_of_the_arm_at_home() -> None:
    at_home = np.diag(inertia(load_robot("rcrt1").home))
    # The table rounds to three or four digits.
    assert np.allclose(DRIVES.inertia[:3], at_home, rtol=5e-3, atol=0)
    assert np.array_equal(DRIVES.inertia[3:], [LINKS["J4"], LINKS["J5"], LINKS["J6"]])


def test_encoder_steps_are_the_published_resolutions() -> None:  # case 15
    degrees = DRIVES.encoder_step[[0, 1, 3, 4, 5]] / DEGREE
    # Half of the last printed digit.
    assert np.allclose(degrees[:2], 1.0e-3, rtol=0, atol=5e-8)
    assert np.allclose(degrees[2:], (1.247e-3, 2.313e-3, 2.313e-3), rtol=0, atol=6e-7)
    assert math.isclose(DRIVES.encoder_step[2] / 1e-3, 1.316e-4, abs_tol=5e-8)


def test_tip_resolution_at_full_reach_is_the_published_one() -> None:  # case 15
    turning = 460.0 * DRIVES.encoder_step[:2]
    combined = math.sqrt(turning @ turning + (DRIVES.encoder_step[2] / 1e-3) ** 2)
    assert np.allclose(turning, 8.029e-3, rtol=0, atol=5e-7)
    assert math.isclose(combined, 11.355e-3, abs_tol=5e-7)


def test_speed_limits_are_those_of_the_motors() -> None:
    degrees = DRIVES.speed_limit[[0, 1, 3, 4, 5]] / DEGREE
    assert np.allclose(degrees, (180.0, 180.0, 421.3, 781.6, 781.6), rtol=0, atol=0.05)
    assert math.isclose(DRIVES.speed_limit[2] / 1e-3, 61.99, abs_tol=5e-3)


def test_force_limit_of_joint_3_is_what_its_torque_lifts_through_the_screw() -> None:
    diameter, lead, friction = 7e-3, 1e-3, 0.01687
    lifting = diameter / 2 * (lead + friction * math.pi * diameter)
    factor = lifting / (math.pi * diameter - friction * lead)
    assert math.isclose(factor, 2.184e-4, abs_tol=5e-8)
    assert math.isclose(DRIVES.effort_limit[2], 0.0056 / factor, rel_tol=1e-3)
    # Moving mass of motor and screw, 6.627e-7 kg·m² through the lead.
    assert math.isclose(LINKS["J3"], 6.627e-7 * (2 * math.pi / lead) ** 2, rel_tol=1e-12)


def test_drives_hold_the_arm_against_gravity_everywhere() -> None:
    rng = np.random.default_rng(5)
    arm = load_robot("rcrt1")
    for q in rng.uniform(arm.lower[:3], arm.upper[:3], (500, 3)):
        assert (np.abs(gravity(q)) < DRIVES.effort_limit).all()
