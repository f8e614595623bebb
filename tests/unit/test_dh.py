"""Denavit-Hartenberg tables: conventions, reading, and chains as robots."""

import math
from typing import Any

import numpy as np
import pytest

from random_arms import table
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import IkStatus, load_robot
from teleop_core.robots.arms.dh import load_table
from ways import stepped

ROUNDING, REACHED = 1e-14, 1e-9
TABLES = ("rcrt1", "scara", "five_axis_standard", "five_axis_sheth_uicker")


def modified_link(alpha: float, a: float, d: float, theta: float) -> Array:
    """Equation (10) of the lecture."""
    ca, sa, ct, st = math.cos(alpha), math.sin(alpha), math.cos(theta), math.sin(theta)
    return np.array([[ct, -st, 0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d], [0, 0, 0, 1]])


def test_d1_a_modified_row_is_equation_10() -> None:
    for alpha, a, d, theta in np.random.default_rng(1).uniform(-2.0, 2.0, (100, 4)):
        chain = table([{"alpha": alpha, "a": a, "d": d, "theta": "q"}], angles="radians")
        assert np.abs(chain.link_transforms([theta])[0] - modified_link(alpha, a, d, theta)).max() < (ROUNDING)


@pytest.mark.parametrize(("convention", "link"), [("standard", "RevoluteDH"), ("modified", "RevoluteMDH")])
def test_roboticstoolbox_builds_the_same_chain(convention: str, link: str) -> None:
    import roboticstoolbox as rtb  # takes seconds

    rng = np.random.default_rng(2)
    numbers = rng.uniform(-1.5, 1.5, (6, 3))
    rows = [{"alpha": k, "a": a, "d": d, "theta": "q"} for k, a, d in numbers]
    ours = table(rows, convention, angles="radians").robot()
    theirs = rtb.DHRobot([getattr(rtb, link)(alpha=k, a=a, d=d) for k, a, d in numbers])
    for q in rng.uniform(-3.0, 3.0, (50, 6)):
        assert np.abs(ours.fk(q) - theirs.fkine(q).A).max() < 1e-12
        assert np.abs(ours.jacobian(q) - theirs.jacob0(q)).max() < 1e-12


@pytest.mark.parametrize("name", TABLES)
def test_example_tables_load_and_their_rows_multiply_to_the_pose(name: str) -> None:
    chain = load_table(f"config/robots/{name}.yaml")
    robot, rng = chain.robot(), np.random.default_rng(3)
    for q in rng.uniform(robot.lower, robot.upper, (20, robot.n)):
        pose = np.eye(4)
        for link in chain.link_transforms(q):
            pose = pose @ link
        assert np.abs(robot.fk(q) - pose).max() < ROUNDING
    assert len(chain.joints) == robot.n


def test_the_rcrt1_table_is_the_closed_form_arm() -> None:
    ours, arm = load_table("config/robots/rcrt1.yaml").robot(), load_robot("rcrt1")
    for q in np.random.default_rng(7).uniform(arm.lower, arm.upper, (50, 6)):
        assert np.abs(ours.fk(q) - arm.fk(q)).max() < ROUNDING
        assert np.abs(ours.jacobian(q) - arm.jacobian(q)).max() < ROUNDING


def test_a_chain_that_is_searched_finds_poses_from_seeds_nearby_and_nearly_always_from_home() -> None:
    robot, rng = load_table("config/robots/rcrt1.yaml").robot(), np.random.default_rng(5)
    q = rng.uniform(robot.lower, robot.upper, (300, robot.n))
    seeds = np.clip(q + 0.1 * rng.standard_normal(q.shape), robot.lower, robot.upper)
    for given, share in ((seeds, 0.99), (None, 0.97)):
        result: Any = robot.ik(robot.fk(q), given)
        reached = np.isin(result.status, (IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR))
        assert reached.mean() > share  # a few poses beside a limit may stop there
        assert ((result.q >= robot.lower) & (result.q <= robot.upper)).all()
        assert result.residual[reached].max() < REACHED
    far = robot.ik(transform(np.eye(3), np.array([20.0, 0.0, 0.0])))
    assert far.status in {IkStatus.UNREACHABLE, IkStatus.LIMITED}
    assert np.isfinite(far.q).all()


def test_paths_of_a_chain_keep_their_steps_and_pass_the_straight_wrist() -> None:
    robot = load_table("config/robots/rcrt1.yaml").robot()
    q = robot.start.copy()
    q[4] = 0.0
    straight = robot.fk(q)
    poses = [straight @ transform(rotation("y", a), np.zeros(3)) for a in np.linspace(0.4, -0.4, 1000)]
    found, statuses = stepped(robot, poses, robot.ik(poses[0]).q, 0.01)
    assert set(statuses) <= {IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR}
    assert np.abs(robot.fk(found[-1]) - poses[-1]).max() < REACHED


def test_signs_offsets_limits_and_homes_are_read_in_the_table_unit() -> None:
    chain = table(
        [
            {"theta": "-q + 30", "lower": -90, "upper": 45, "home": 10, "name": "yaw"},
            {"a": 0.2, "d": "q-0.1", "lower": 0.2, "upper": 0.4},
        ]
    )
    yaw, slide = chain.joints
    assert (yaw.name, yaw.sign, slide.name, slide.sign) == ("yaw", -1.0, "q2", 1.0)
    assert np.allclose([yaw.lower, yaw.upper, yaw.home], np.radians([-90, 45, 10]), atol=1e-15)
    assert slide.home == pytest.approx(0.3)
    pose = chain.robot().fk([math.radians(30.0), 0.3])
    assert np.abs(pose - transform(np.eye(3), np.array([0.2, 0.0, 0.2]))).max() < ROUNDING
