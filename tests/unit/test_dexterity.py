"""Dexterity: singular values, manipulability and the workspace sampler."""

import math
from pathlib import Path

import numpy as np
import pytest

from teleop_core.robots import dexterity, load_robot


def test_manipulability_of_the_puma_is_the_closed_form_determinant() -> None:
    # Wrist and arm decouple, so |det J| = a2 |u| (forearm part of the elbow) |sin q5|.
    arm, rng = load_robot("puma560"), np.random.default_rng(1)
    a2, a3, _, d4 = arm.geometry.values()
    for q in rng.uniform(arm.lower, arm.upper, (50, 6)):
        u = a2 * math.cos(q[1]) + a3 * math.cos(q[1] + q[2]) - d4 * math.sin(q[1] + q[2])
        bend = d4 * math.cos(q[2]) + a3 * math.sin(q[2])
        expected = abs(a2 * u * bend * math.sin(q[4]))
        assert dexterity.manipulability(arm, q) == pytest.approx(expected, abs=1e-14)


def test_scara_is_measured_in_the_four_directions_it_controls() -> None:
    arm = load_robot("scara")
    q = np.array([0.3, 1.1, 0.1, 0.0])
    assert dexterity.singular_values(arm, q).shape == (4,)
    assert dexterity.manipulability(arm, q) == pytest.approx(0.4 * 0.3 * math.sin(1.1), abs=1e-15)


def test_a_stretched_arm_has_no_manipulability() -> None:
    arm = load_robot("planar_3r")
    assert dexterity.manipulability(arm, [0.0, 0.0, 0.0]) < 1e-15


def test_lengths_weigh_linear_against_angular_speed() -> None:
    arm = load_robot("rcrt1")
    q = arm.home + 0.1
    assert dexterity.manipulability(arm, q, 0.1) == pytest.approx(1e3 * dexterity.manipulability(arm, q))


def test_samples_lie_in_the_annulus_that_the_arm_can_reach() -> None:
    arm = load_robot("scara")
    points, values = dexterity.sample_workspace(arm, 2000, np.random.default_rng(3))
    radius = np.hypot(points[:, 0], points[:, 1])
    assert points.shape == (2000, 3)
    assert values.shape == (2000,)
    assert radius.max() <= 0.7
    # The elbow stops at 150 degrees.
    shortest = math.sqrt(0.4**2 + 0.3**2 + 2 * 0.4 * 0.3 * math.cos(math.radians(150.0)))
    assert radius.min() >= shortest
    assert points[:, 2].min() >= -0.2
    assert points[:, 2].max() <= 0.0


def test_the_csv_holds_every_sample_with_all_digits(tmp_path: Path) -> None:
    points, values = dexterity.sample_workspace(load_robot("puma560"), 20, np.random.default_rng(7))
    dexterity.write_workspace_csv(tmp_path / "puma.csv", points, values)
    header, *rows = (tmp_path / "puma.csv").read_text().splitlines()
    assert header == ",".join(dexterity.COLUMNS)
    assert np.array_equal(np.array([row.split(",") for row in rows], float)[:, :3], points)
    assert np.array_equal(np.array([row.split(",") for row in rows], float)[:, 3], values)
