"""SCARA: the lecture's numbers, both elbows, the sign of d3."""

import math

import numpy as np
import pytest

from random_arms import table
from teleop_core.kernels.geometry import rotation, transform
from teleop_core.robots import IkStatus, load_robot
from teleop_core.robots.dh import load_table
from ways import followed

ARM = load_robot("scara")
ROUNDING = 1e-14
DEGREE = math.pi / 180.0
PRINTED = 5e-7
DT = 1e-3


def test_the_product_of_the_table_is_the_lectures() -> None:
    arm = load_table("config/robots/scara.yaml").robot()
    rng = np.random.default_rng(1)
    for q in rng.uniform(ARM.lower, ARM.upper, (100, 4)):
        p = (
            0.4 * math.cos(q[0]) + 0.3 * math.cos(q[0] + q[1]),
            0.4 * math.sin(q[0]) + 0.3 * math.sin(q[0] + q[1]),
            -q[2],
        )
        expected = transform(rotation("z", q[0] + q[1] + q[3]), np.array(p))
        assert np.abs(ARM.fk(q) - expected).max() < ROUNDING
        assert np.abs(arm.fk(q) - expected).max() < ROUNDING


def test_d9_numbers_and_the_other_elbow() -> None:
    q = np.array([25.0 * DEGREE, 50.0 * DEGREE, 0.12, -30.0 * DEGREE])
    pose = ARM.fk(q)
    assert np.abs(pose[:3, 3] - (0.440169, 0.458825, -0.12)).max() < PRINTED
    assert math.atan2(pose[1, 0], pose[0, 0]) == pytest.approx(45.0 * DEGREE, abs=ROUNDING)
    first, second = ARM.ik_all(pose)
    assert np.abs(first - q).max() < 1e-12
    other = (67.377701, -50.0, 0.12, 27.622299)
    scale = np.array([DEGREE, DEGREE, 1.0, DEGREE])
    assert np.abs(second / scale - other).max() < PRINTED


def test_a_positive_d3_lowers_the_tool() -> None:
    up, down = (ARM.fk([0.1, 0.2, d3, 0.0])[2, 3] for d3 in (0.05, 0.15))
    assert down == pytest.approx(up - 0.1)


def test_h11_proximal_and_distal_tables_of_the_thesis_are_one_arm() -> None:
    # Singh 2014, tables 3.1 and 3.3: theta2 and d3 change sign, d2 = d5 = 0.
    distal = [
        {"a": 0.4, "alpha": 180, "d": 0.3, "theta": "q"},
        {"a": 0.3, "theta": "q"},
        {"d": "q", "lower": -1, "upper": 1},
        {"d": 0.05, "theta": "q"},
    ]
    proximal = [
        {"d": 0.3, "theta": "q"},
        {"a": 0.4, "theta": "q"},
        {"a": 0.3, "d": "q", "lower": -1, "upper": 1},
        {"alpha": 180, "d": 0.05, "theta": "q"},
    ]
    sheth_uicker = [
        {"a": 0.4, "alpha": 180, "c": 0.3, "gamma": "q"},
        {"a": 0.3, "gamma": "q"},
        {"c": "q", "lower": -1, "upper": 1},
        {"c": 0.05, "gamma": "q"},
    ]
    one, two = table(distal, "standard").robot(), table(proximal).robot()
    three = table(sheth_uicker, "sheth_uicker").robot()
    for q in np.random.default_rng(2).uniform(-1.0, 1.0, (50, 4)):
        assert np.abs(one.fk(q) - two.fk(q * (1, -1, -1, 1))).max() < ROUNDING
        assert np.abs(one.fk(q) - three.fk(q)).max() < ROUNDING


def test_tilt_is_left_as_residual_and_the_rest_is_followed() -> None:
    q = np.array([0.3, 0.8, 0.1, -0.4])
    pose = ARM.fk(q)
    pose[:3, :3] = pose[:3, :3] @ rotation("x", 0.2)
    result = ARM.ik(pose, q)
    assert result.status is IkStatus.FOLLOWED
    assert np.abs(result.q - q).max() < 1e-12
    assert result.residual[0] < 1e-12
    assert result.residual[1] == pytest.approx(0.2)
    assert ARM.task_mask == (True, True, True, False, False, True)


def test_a_height_beyond_the_slide_is_limited_not_unreachable() -> None:
    pose = ARM.fk([0.3, 0.8, 0.2, 0.0])
    pose[2, 3] = -0.25
    result = ARM.ik(pose)
    assert result.status is IkStatus.LIMITED
    assert result.residual[0] == pytest.approx(0.05)
    assert result.q[2] == 0.2


def test_the_tool_turns_on_over_a_whole_turn_without_unwinding() -> None:
    q = ARM.home.copy()
    turns = np.linspace(-math.pi, math.pi, 4001)
    poses = np.array([transform(rotation("z", a), ARM.fk(q)[:3, 3]) for a in turns])
    seed = ARM.ik(poses[0], q - (0.0, 0.0, 0.0, 3.0)).q
    result = ARM.follow(poses, seed, DT)
    assert result.residual.max() < 1e-9
    assert result.q[-1, 3] - result.q[0, 3] == pytest.approx(2.0 * math.pi, abs=1e-9)


@pytest.mark.parametrize("y", [0.0, 1e-9, 1e-3, 0.1, 0.3])
def test_lines_beside_the_column_keep_speeds_and_go_on(y: float) -> None:
    x = np.concatenate((np.linspace(0.5, -0.5, 4000), np.full(2000, -0.5)))
    poses = np.array([transform(np.eye(3), np.array([value, y, -0.1])) for value in x])
    seed = ARM.ik(poses[0]).q
    followed(ARM, poses, seed)
