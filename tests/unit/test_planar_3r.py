"""Planar 3R: the lecture's products, both elbows, passing the stretched arm."""

import math

import numpy as np
import pytest

from teleop_core.kernels.geometry import rotation, transform
from teleop_core.robots import IkStatus, load_robot
from teleop_core.robots.dh import load_table
from ways import followed

ARM = load_robot("planar_3r", l1=1.0, l2=0.8, l3=0.5)
ROUNDING = 1e-14
DEGREE = math.pi / 180.0
PRINTED = 5e-7  # half of the last digit of the spec's numbers
DT = 1e-3


def test_d2_products_of_the_table_are_the_lectures() -> None:
    table = load_table("config/robots/planar_3r.yaml")
    for q in np.random.default_rng(1).uniform(-3.0, 3.0, (100, 3)):
        t1, t12, t123 = np.cumsum(q)
        links = table.link_transforms(q)
        third = links[0] @ links[1] @ links[2]
        p3 = (math.cos(t1) + 0.8 * math.cos(t12), math.sin(t1) + 0.8 * math.sin(t12), 0.0)
        assert np.abs(third - transform(rotation("z", t123), np.array(p3))).max() < ROUNDING
        tool = np.array(p3) + 0.5 * np.array([math.cos(t123), math.sin(t123), 0.0])
        assert np.abs(ARM.fk(q) - transform(rotation("z", t123), tool)).max() < ROUNDING
        assert np.abs(table.robot().fk(q) - ARM.fk(q)).max() < ROUNDING


def test_d3_numbers_and_the_other_elbow() -> None:
    q = np.array([30.0, 45.0, -60.0]) * DEGREE
    pose = ARM.fk(q)
    assert np.abs(pose[:2, 3] - (1.556044, 1.402150)).max() < PRINTED
    assert math.atan2(pose[1, 0], pose[0, 0]) == pytest.approx(15.0 * DEGREE, abs=ROUNDING)
    wrist = load_robot("planar_3r", l3=0.0).fk(q)
    assert np.abs(wrist[:2, 3] - (1.073081, 1.272741)).max() < PRINTED
    solutions = ARM.ik_all(pose)
    assert np.abs(solutions[0] - q).max() < 1e-12
    assert np.abs(solutions[1] / DEGREE - (69.7298, -45.0, -9.7298)).max() < 5e-5


def test_height_and_tilt_are_left_as_residual_and_the_rest_is_followed() -> None:
    q = np.array([0.4, 0.9, -0.5])
    pose = ARM.fk(q)
    pose[2, 3] = 0.25
    lifted = ARM.ik(pose, q)
    assert lifted.status is IkStatus.FOLLOWED
    assert np.abs(lifted.q - q).max() < 1e-12
    assert lifted.residual[0] == pytest.approx(0.25)
    tilted = ARM.fk(q)
    tilted[:3, :3] = tilted[:3, :3] @ rotation("y", 0.3)
    result = ARM.ik(tilted, q)
    assert result.residual[1] == pytest.approx(0.3)
    assert len(ARM.ik_all(tilted)) == 0
    assert ARM.task_mask == (True, True, False, False, False, True)


def test_points_outside_the_ring_have_no_branch() -> None:
    for x in (0.5 + 1.8 + 1e-6, 0.5 + 0.2 - 1e-6):
        pose = transform(np.eye(3), np.array([x, 0.0, 0.0]))
        assert len(ARM.ik_all(pose)) == 0
        assert ARM.ik(pose).status is IkStatus.UNREACHABLE
    for x in (0.5 + 1.8 - 1e-6, 0.5 + 0.2 + 1e-6):
        assert len(ARM.ik_all(transform(np.eye(3), np.array([x, 0.0, 0.0])))) == 2


@pytest.mark.parametrize("lateral", [0.0, 1e-9, 1e-3, 0.05])
def test_stretching_out_and_back_keeps_speeds_and_ends_on_the_path(lateral: float) -> None:
    out = np.linspace(1.6, 2.5, 3000)
    x = np.concatenate((out, out[::-1], np.full(1000, out[0])))
    poses = np.array([transform(np.eye(3), np.array([value, lateral, 0.0])) for value in x])
    seed = ARM.ik(poses[0]).q
    result = followed(ARM, poses, seed)
    assert result.residual[-1].max() < 1e-9
    # Beyond reach the nearest point of the ring is held.
    beyond = result.residual[2999, 0]
    assert beyond == pytest.approx(math.hypot(2.0, lateral) - 1.8, abs=1e-6)


@pytest.mark.parametrize("lateral", [0.0, 1e-9, 1e-3, 0.1, 0.19, 0.21])
def test_crossing_the_hole_in_the_middle_keeps_speeds_and_goes_on(lateral: float) -> None:
    wrist_x = np.concatenate((np.linspace(0.6, -0.6, 4000), np.full(3000, -0.6)))
    poses = np.array([transform(np.eye(3), np.array([x + 0.5, lateral, 0.0])) for x in wrist_x])
    seed = ARM.ik(poses[0], [0.0, 2.0, 0.0]).q
    followed(ARM, poses, seed)


def test_equal_links_folded_onto_the_axis_keep_the_seed_of_joint_1() -> None:
    arm = load_robot("planar_3r", l1=0.5, l2=0.5, l3=0.0)
    result = arm.ik(np.eye(4), [0.7, 2.5, 0.0])
    assert result.q[0] == pytest.approx(0.7)
    assert np.isfinite(result.q).all()
