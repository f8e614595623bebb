"""Link errors: the arm as built against products of matrices, and the chains it is built from."""

import math

import numpy as np
import pytest

from present import present
from random_arms import standard_link
from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import dh_kernels
from teleop_core.robots import link_errors, load_robot, robot_from_table
from teleop_core.robots.arms.as_chain import chain_of, true_chain
from teleop_core.robots.robot import Robot

CHAINS = ("rcrt1", "puma560", "scara", "planar_3r", "five_axis")
# Every joint of the standard convention, with and without lengths, offset and slide.
TABLE = {
    "name": "mixed",
    "convention": "standard",
    "rows": [
        {"theta": "q + 0.3", "d": 0.2, "a": 0.1, "alpha": -1.2},
        {"theta": "-q", "a": 0.4},
        {"d": "q", "theta": 0.2, "alpha": 1.57, "lower": 0.0, "upper": 0.3},
        {"theta": "q", "d": 0.05, "a": 0.02, "alpha": 0.4},
    ],
}


def tip(row: Array, q: Array) -> Array:
    T = np.empty((4, 4))
    dh_kernels.fk(q, row, T)
    return T


def joints(robot: Robot, rng: np.random.Generator) -> Array:
    return rng.uniform(robot.lower, robot.upper)


@pytest.mark.parametrize("name", CHAINS)
def test_an_arm_without_errors_is_the_robot(name: str) -> None:
    robot, rng = load_robot(name), np.random.default_rng(1)
    row = present(true_chain(robot, link_errors.LinkErrors.none(robot.n)))
    for _ in range(50):
        q = joints(robot, rng)
        # Lengths up to 2.3 m; a few roundings each.
        assert np.allclose(tip(row, q), robot.fk(q), rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", CHAINS)
def test_changed_lengths_of_the_robot_are_those_of_its_chain(name: str) -> None:
    drawn = load_robot(name)
    symbol = next(iter(drawn.geometry))
    robot = load_robot(name, **{symbol: 0.123})
    row = present(true_chain(robot, link_errors.LinkErrors.none(robot.n)))
    assert np.allclose(tip(row, robot.home), robot.fk(robot.home), rtol=0, atol=1e-15)
    assert not np.allclose(tip(row, robot.home), drawn.fk(robot.home), rtol=0, atol=1e-3)


def test_errors_of_the_rcrt1_are_those_of_its_published_table() -> None:
    robot, rng = load_robot("rcrt1"), np.random.default_rng(2)
    right = math.pi / 2
    for _ in range(20):
        q, e = joints(robot, rng), rng.normal(0.0, 0.01, (4, 6))
        theta = np.array([q[0], q[1], 0.0, *q[3:]]) + e[3]
        d = np.array([0.0, 0.0, q[2], 0.0, 0.0, 0.037]) + e[2]
        alpha = np.array([-right, right, 0.0, -right, right, 0.0]) + e[1]
        expected = np.eye(4)
        for i in range(6):
            expected = expected @ standard_link(theta[i], d[i], e[0, i], alpha[i])
        row = present(true_chain(robot, link_errors.LinkErrors.from_vector(e.ravel())))
        assert np.allclose(tip(row, q), expected, rtol=0, atol=1e-14)


def test_errors_of_a_table_are_those_of_its_rows() -> None:
    robot, rng = robot_from_table(TABLE), np.random.default_rng(3)
    for _ in range(20):
        q, e = joints(robot, rng), rng.normal(0.0, 0.02, (4, 4))
        theta = np.array([q[0] + 0.3, -q[1], 0.2, q[3]]) + e[3]
        d = np.array([0.2, 0.0, q[2], 0.05]) + e[2]
        a, alpha = np.array([0.1, 0.4, 0.0, 0.02]) + e[0], np.array([-1.2, 0, 1.57, 0.4]) + e[1]
        expected = np.eye(4)
        for i in range(4):
            expected = expected @ standard_link(theta[i], d[i], a[i], alpha[i])
        row = present(true_chain(robot, link_errors.LinkErrors.from_vector(e.ravel())))
        assert np.allclose(tip(row, q), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("name", "symbol", "error"),
    [
        ("puma560", "a2", "a2"), ("puma560", "d3", "d3"), ("puma560", "d4", "d4"),
        ("puma560", "a3", "a3"), ("scara", "a1", "a1"), ("scara", "a2", "a2"),
        ("planar_3r", "l2", "a2"), ("planar_3r", "l3", "a3"), ("five_axis", "d1", "d1"),
        ("five_axis", "d5", "d5"), ("rcrt1", "L6", "d6"), ("rcrt1", "d2", "d2"),
    ],
)  # fmt: skip
def test_an_error_of_a_length_is_another_length(name: str, symbol: str, error: str) -> None:
    robot, rng = load_robot(name), np.random.default_rng(4)
    longer = load_robot(name, **{symbol: robot.geometry[symbol] + 0.01})
    row = present(true_chain(robot, link_errors.LinkErrors.of(robot, {error: 0.01})))
    q = joints(robot, rng)
    assert np.allclose(tip(row, q), longer.fk(q), rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", CHAINS)
def test_a_joint_offset_is_another_joint_vector(name: str) -> None:
    robot, rng = load_robot(name), np.random.default_rng(5)
    chain = present(chain_of(robot))
    for i, kind in enumerate(chain.kinds):
        q = joints(robot, rng)
        moved = q.copy()
        moved[i] += math.copysign(0.01, kind)
        error = {f"{'theta' if abs(kind) < 1.5 else 'd'}{i + 1}": 0.01}
        row = present(true_chain(robot, link_errors.LinkErrors.of(robot, error)))
        assert np.allclose(tip(row, q), robot.fk(moved), rtol=0, atol=1e-14)


def test_every_transform_between_axes_has_a_common_normal() -> None:
    rng = np.random.default_rng(6)
    for _ in range(200):
        theta, d, a, alpha, turn, slide = rng.uniform(-1.5, 1.5, 6)
        S = standard_link(turn, slide, 0.0, 0.0)
        F = standard_link(theta, d, a, alpha) @ S
        # Alpha near 0 leaves the place of the normal to rounding over its sine.
        assert np.allclose(link_errors.next_axis_motion(F), S, rtol=0, atol=1e-13 / abs(math.sin(alpha)))


@pytest.mark.parametrize("alpha", [0.0, math.pi])
def test_parallel_axes_have_their_normal_where_the_link_is(alpha: float) -> None:
    S = standard_link(0.4, 0.0, 0.0, 0.0)
    F = standard_link(0.7, 0.2, 0.3, alpha) @ S
    assert np.allclose(link_errors.next_axis_motion(F), S, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", ["stewart", "mma", "rps3", "three_finger_hand", "four_bar"])
def test_robots_that_are_no_chain_have_none(name: str) -> None:
    robot = load_robot(name)
    assert true_chain(robot, link_errors.LinkErrors.none(robot.n)) is None


def test_names_and_vectors_are_in_one_order() -> None:
    names = link_errors.error_names(2)
    assert names == ("a1", "a2", "alpha1", "alpha2", "d1", "d2", "theta1", "theta2")
    errors = link_errors.LinkErrors.from_vector(np.arange(8.0))
    assert np.array_equal(errors.vector, np.arange(8.0))
    assert errors.named()["d2"] == 5.0
    assert "a1" not in errors.named()
