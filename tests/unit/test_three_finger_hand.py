"""Three-fingered hand: fingers both ways, contact points and object pose both ways, grasps."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import IkStatus, load_robot
from teleop_core.robots.robot import Robot
from teleop_machines import hand_fingers, three_finger_hand
from ways import stepped

SOLVED = 1e-9


@pytest.fixture(scope="module")
def robot() -> Any:
    return load_robot("three_finger_hand")


@pytest.fixture(scope="module")
def hand(robot: Robot) -> Any:
    return three_finger_hand.Hand(robot.geometry)


def moves(
    robot: Robot, rng: np.random.Generator, count: int, shift: float = 0.006, turn: float = 0.25
) -> Iterator[Array]:
    """Object poses around home."""
    T = robot.fk(robot.home)
    for _ in range(count):
        R = T[:3, :3].copy()
        for axis in "xyz":
            R = R @ rotation(axis, rng.uniform(-turn, turn))
        yield transform(R, T[:3, 3] + rng.uniform(-shift, shift, 3))


def test_finger_of_the_specification() -> None:
    point = hand_fingers.finger_point(np.radians(20.0), np.radians(35.0), np.radians(-50.0), (1.0, 0.6, 0.4))
    assert np.allclose(point, [1.764613, 0.642266, 0.240618], atol=6e-7)


@pytest.mark.parametrize("finger", [1, 2, 3])
def test_every_finger_solution_touches_the_point_and_the_original_is_among_them(finger: int) -> None:
    hand, rng = three_finger_hand.Hand({"l31": 0.02, "l12": 0.06}), np.random.default_rng(2)
    counts = set()
    assert hand.finger_solutions(finger, [1.0, 0.0, 0.0]).shape == (0, 3)  # out of reach
    for q in rng.uniform(-3.0, 3.0, (500, 9)):
        point = hand.contact_points(q)[finger - 1]
        solutions = hand.finger_solutions(finger, point)
        counts.add(len(solutions))
        own = q[3 * finger - 3 : 3 * finger]
        for joints in solutions:
            whole = np.zeros(9)
            whole[3 * finger - 3 : 3 * finger] = joints
            assert np.allclose(hand.contact_points(whole)[finger - 1], point, atol=1e-12)
        # Near straight a rounding of the point bends the finger by its square root.
        assert np.abs(np.exp(1j * solutions) - np.exp(1j * own)).max(axis=1).min() < 1e-6
    assert counts <= {2, 4}
    assert 4 in counts


def test_object_pose_and_contact_points_are_inverse_to_each_other(robot: Robot, hand: three_finger_hand.Hand) -> None:
    rng = np.random.default_rng(3)
    for T in moves(robot, rng, 50, shift=0.5, turn=3.0):
        points = hand.contacts_of(T)
        sides = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
        assert np.allclose(sides, robot.geometry["side"], atol=1e-15)
        assert np.allclose(hand.object_pose(points), T, atol=1e-12)


def test_all_sixty_four_branches_appear_for_long_outer_links() -> None:
    long = {f"l{i}{k}": v for i in (1, 2, 3) for k, v in ((1, 0.01), (2, 0.09), (3, 0.08))}
    robot = load_robot("three_finger_hand", **long, side=0.06)
    assert len(robot.ik_all(robot.fk(robot.home))) == 64


def test_inverse_follows_the_object_next_to_the_seed(robot: Robot, hand: three_finger_hand.Hand) -> None:
    rng = np.random.default_rng(5)
    for T in moves(robot, rng, 300):
        result = robot.ik(T)
        assert result.status == IkStatus.FOLLOWED
        assert np.allclose(robot.fk(result.q), T, atol=SOLVED)
        assert np.abs(hand.slip(result.q)).max() < SOLVED
        inside = [q for q in robot.ik_all(T) if (q >= robot.lower).all() and (q <= robot.upper).all()]
        nearest = min(np.abs(q - robot.home).max() for q in inside)
        assert math.isclose(np.abs(result.q - robot.home).max(), nearest, abs_tol=SOLVED)


def test_fingers_spread_too_far_cannot_hold_and_say_so(robot: Robot, hand: three_finger_hand.Hand) -> None:
    actuated = np.array([[-1.3, 0.5], [1.3, 0.5], [0.0, -1.5]])
    result = hand.hold(actuated, np.zeros(3))
    assert result.status == three_finger_hand.Grasp.CANNOT_HOLD
    assert np.isfinite(result.q).all()
    assert result.residual > 1e-3


@pytest.mark.parametrize("out", [0.02, 0.04, 0.1])
def test_a_path_to_straight_fingers_and_back_returns_to_the_same_grasp(robot: Robot, out: float) -> None:
    # The end is held, so that joints which lagged behind at the straight finger catch up.
    shares = [*np.sin(np.linspace(0.0, math.pi, 3000)), *np.zeros(300)]
    path = np.repeat(robot.fk(robot.home)[None], len(shares), axis=0)
    path[:, 0, 3] += out * np.array(shares)
    found, statuses = stepped(robot, path, robot.home, 0.02)
    assert np.allclose(found[-1], robot.home, atol=1e-6)
    assert (IkStatus.UNREACHABLE in statuses) == (out > 0.03)


@pytest.mark.parametrize("beside", [0.0, 1e-6, -1e-6, 0.003])
def test_a_path_over_a_finger_axis_keeps_its_steps_and_goes_on(beside: float) -> None:
    # Contact 1 passes over the axis of joint 1 of finger 1 and comes back.
    robot = load_robot("three_finger_hand")
    base = np.array([0.0, -robot.geometry["d"], robot.geometry["h"]])
    home = robot.fk(robot.home)
    corner = three_finger_hand.Hand(robot.geometry).contacts_of(home)[0]
    over = base + np.array([-0.01, beside, -0.04]) - corner
    shares = np.array([*np.sin(np.linspace(0.0, math.pi, 3000)), *np.zeros(300)])
    path = np.repeat(home[None], len(shares), axis=0)
    path[:, :3, 3] += shares[:, None] * over
    found, _ = stepped(robot, path, robot.home, 0.02)
    assert np.allclose(robot.fk(found[-1]), home, atol=1e-6)
