"""Teaching examples beside the MMA: conventions agree, the parallelogram closes (H10-H13)."""

import math

import numpy as np
import pytest
import roboticstoolbox as rtb

from teleop_core.kernels.geometry import Array
from teleop_core.robots.arms.dh import DhRow, DhTable
from teleop_machines.mma_models import JOINTS, LINKS, joints_of_model
from teleop_machines.mobility import PLANAR, degrees_of_freedom, independent_loops

EXACT = 1e-12
QUARTER = 0.5 * math.pi


def distal(rows: list[tuple[float, float, float, float]]) -> Array:
    """Product of standard D-H rows (a, alpha, d, theta), by roboticstoolbox."""
    links = [rtb.RevoluteDH(a=a, alpha=alpha, d=d) for a, alpha, d, _ in rows]
    return rtb.DHRobot(links).fkine([theta for *_, theta in rows]).A


def proximal(rows: list[tuple[float, float, float, float]]) -> Array:
    """Product of modified D-H rows (a, alpha, d, theta), by our tables."""
    return product("modified", ("a", "alpha", "d", "theta"), rows)


def sheth_uicker(rows: list[tuple[float, float, float, float]]) -> Array:
    """Product of rows (gamma with the joint's theta, a, c, alpha), b and beta zero."""
    return product("sheth_uicker", ("gamma", "a", "c", "alpha"), rows)


def product(
    convention: str,
    symbols: tuple[str, str, str, str],
    rows: list[tuple[float, float, float, float]],
) -> Array:
    table = DhTable(
        name="teaching",
        convention=convention,
        rows=tuple(DhRow(constants=dict(zip(symbols, row, strict=True))) for row in rows),
    )
    pose = np.eye(4)
    for step in table.link_transforms(np.empty(0)):
        pose = pose @ step
    return pose


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def test_scara_is_the_same_in_distal_and_proximal_rows(rng: np.random.Generator) -> None:  # H11
    for _ in range(50):
        t1, t2, t4 = rng.uniform(-math.pi, math.pi, 3)
        a1, a2, d1, d3, d4 = rng.uniform(0.05, 0.5, 5)
        left = distal([(a1, math.pi, d1, t1), (a2, 0, 0, t2), (0, 0, d3, 0), (0, 0, d4, t4)])
        right = proximal(
            [(0, 0, d1, t1), (a1, 0, 0, -t2), (a2, 0, -d3, 0), (0, math.pi, d4, t4), (0, 0, 0, 0)]
        )
        assert np.abs(left - right).max() < EXACT


def test_scara_is_the_same_in_the_sheth_uicker_notation(rng: np.random.Generator) -> None:  # H11
    for _ in range(50):
        t1, t2, t4 = rng.uniform(-math.pi, math.pi, 3)
        a1, a2, d1, d3, d4 = rng.uniform(0.05, 0.5, 5)
        left = distal([(a1, math.pi, d1, t1), (a2, 0, 0, t2), (0, 0, d3, 0), (0, 0, d4, t4)])
        right = sheth_uicker([(t1, a1, d1, math.pi), (t2, a2, 0, 0), (0, 0, d3, 0), (t4, 0, d4, 0)])
        assert np.abs(left - right).max() < EXACT


def test_five_axis_arm_is_the_same_in_distal_and_proximal_rows(
    rng: np.random.Generator,
) -> None:  # H12
    for _ in range(50):
        t = rng.uniform(-math.pi, math.pi, 5)
        a2, a3, d1, d5 = rng.uniform(0.05, 0.5, 4)
        left = distal(
            [(0, -QUARTER, d1, t[0]), (a2, 0, 0, t[1]), (a3, 0, 0, t[2]),
             (0, -QUARTER, 0, t[3]), (0, 0, d5, t[4])]
        )  # fmt: skip
        right = proximal(
            [(0, 0, d1, t[0]), (0, -QUARTER, 0, t[1]), (a2, 0, 0, t[2]), (a3, 0, 0, t[3]),
             (0, -QUARTER, 0, t[4]), (0, 0, d5, 0)]
        )  # fmt: skip
        assert np.abs(left - right).max() < EXACT


def closing(theta_1: float, theta_base: float) -> tuple[float, float]:
    """Passive angles of the teaching parallelogram, eqs. 3.33 and 3.34."""
    theta_2 = theta_base - theta_1
    return theta_2, math.pi - theta_2


def test_teaching_parallelogram_closes_with_the_corrected_home(
    rng: np.random.Generator,
) -> None:  # H10
    theta_2, theta_3 = closing(0.0, math.radians(-120.0))
    assert math.isclose(theta_2, math.radians(-120.0))
    assert math.isclose(theta_3, math.radians(300.0))
    for first, second in rng.uniform(0.05, 0.5, (50, 2)):
        over = distal([(first, 0, 0, 0.0), (second, 0, 0, theta_2), (first, 0, 0, theta_3)])
        direct = distal([(second, 0, 0, math.radians(-120.0))])
        assert np.abs(over[:3, 3] - direct[:3, 3]).max() < EXACT


def test_teaching_parallelogram_with_the_printed_home_stays_open() -> None:  # H10
    angles = np.radians([0.0, -30.0, -60.0])
    over = distal([(a, 0, 0, t) for a, t in zip((0.3, 0.2, 0.3), angles, strict=True)])
    direct = distal([(0.2, 0, 0, math.radians(-120.0))])
    assert np.linalg.norm(over[:3, 3] - direct[:3, 3]) > 0.1


def test_parallelogram_closes_for_every_pair_of_its_two_drives(
    rng: np.random.Generator,
) -> None:  # H10
    for theta_1, theta_base in rng.uniform(-math.pi, math.pi, (50, 2)):
        theta_2, theta_3 = closing(theta_1, theta_base)
        over = distal([(0.3, 0, 0, theta_1), (0.2, 0, 0, theta_2), (0.3, 0, 0, theta_3)])
        direct = distal([(0.2, 0, 0, theta_base)])
        assert np.abs(over[:3, 3] - direct[:3, 3]).max() < EXACT


def test_handle_and_parallelogram_have_one_loop_each() -> None:  # H13
    assert independent_loops(LINKS, JOINTS) == 1
    assert independent_loops(links=5, joints=5) == 1


def test_handle_has_seven_freedoms() -> None:  # H13
    # Counted in the plane of its loop, where all ten joints turn about one axis each.
    planar_loop = PLANAR * independent_loops(LINKS, JOINTS)
    assert JOINTS - planar_loop == len(joints_of_model(np.zeros(7), "B")) == 7
    assert degrees_of_freedom(links=5, joints=5, joint_freedoms=5, space=PLANAR) == 2
