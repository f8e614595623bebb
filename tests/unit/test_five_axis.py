"""Five-axis arm: three conventions, four branches, the nearest attitude it can take."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from random_arms import table
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import IkStatus, load_robot
from teleop_core.robots.dh import DhTable, load_table
from teleop_core.robots.five_axis import pitch_and_roll
from ways import followed

ARM = load_robot("five_axis")
D1, A2, A3, D5 = ARM.geometry_row
ROUNDING = 1e-14
DT = 1e-3


def proximal_table(home_of_4: int) -> DhTable:
    """Table 3.4 of the thesis; its theta4 counted from a home position."""
    rows = [
        {"d": D1, "theta": "q"},
        {"alpha": -90, "theta": "q"},
        {"a": A2, "theta": "q"},
        {"a": A3, "theta": f"q {home_of_4:+d}"},
        {"alpha": -90, "theta": "q"},
        {"d": D5},
    ]
    return table(rows)


def random_joints(count: int = 100, seed: int = 1) -> Array:
    return np.random.default_rng(seed).uniform(ARM.lower, ARM.upper, (count, 5))


def test_h12_proximal_distal_and_closed_form_are_one_arm() -> None:
    proximal = proximal_table(0).robot()
    distal = load_table("config/robots/five_axis_standard.yaml").robot()
    for q in random_joints():
        assert np.abs(proximal.fk(q) - ARM.fk(q)).max() < ROUNDING
        assert np.abs(distal.fk(q) - ARM.fk(q)).max() < ROUNDING


def test_sheth_uicker_is_the_same_arm_up_to_a_fixed_roll_of_minus_90_degrees() -> None:
    table = load_table("config/robots/five_axis_sheth_uicker.yaml").robot()
    roll = transform(rotation("z", -math.pi / 2.0), np.zeros(3))
    for q in random_joints():
        ours = ARM.fk(q - (0.0, 0.0, 0.0, math.pi / 2.0, 0.0))
        assert (
            min(np.abs(table.fk(q) - ours @ roll).max(), np.abs(table.fk(q) @ roll - ours).max())
            < ROUNDING
        )


def test_joint_4_home_of_minus_90_points_the_tool_forward_and_the_printed_one_back() -> None:
    forward, back = (proximal_table(home).robot().fk(np.zeros(5)) for home in (-90, 90))
    assert np.abs(forward[:3, 2] - (1.0, 0.0, 0.0)).max() < ROUNDING
    assert np.abs(forward[:3, 3] - (A2 + A3 + D5, 0.0, D1)).max() < ROUNDING
    assert np.abs(back[:3, 2] - (-1.0, 0.0, 0.0)).max() < ROUNDING


def test_at_home_the_tool_points_straight_down() -> None:
    assert np.abs(ARM.fk(ARM.home)[:3, 2] - (0.0, 0.0, -1.0)).max() < ROUNDING
    assert ARM.task_mask == (True, True, True, False, True, True)


@pytest.mark.parametrize("tilt", [0.01, 0.3, 1.0])
def test_a_tilt_out_of_the_plane_is_left_as_residual_and_the_rest_followed(tilt: float) -> None:
    q = ARM.home.copy()
    pose = ARM.fk(q)
    # At home the direction that the arm lacks is the turn about the base's x axis.
    pose[:3, :3] = rotation("x", tilt) @ pose[:3, :3]
    result = ARM.ik(pose, q)
    assert result.status is IkStatus.FOLLOWED
    assert np.abs(result.q - q).max() < 1e-12
    assert result.residual[0] < 1e-12
    assert result.residual[1] == pytest.approx(tilt)
    assert len(ARM.ik_all(pose)) == 0


def test_no_other_attitude_of_the_arm_is_nearer_than_the_one_it_takes() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        turn = rotation("z", rng.uniform(-3, 3)) @ rotation("y", rng.uniform(-3, 3))
        wanted = turn @ rotation("x", rng.uniform(-3, 3))
        q1 = rng.uniform(-3, 3)
        psi, q5 = pitch_and_roll(transform(wanted, np.zeros(3)), q1, 0.0, 0.0)

        def miss(pitch: float, roll: float, q1: float = q1, wanted: Array = wanted) -> float:
            pose = ARM.fk(np.array([q1, 0.0, 0.0, pitch, roll]))
            return Rotation.from_matrix(pose[:3, :3].T @ wanted).magnitude()

        best = miss(psi, q5)
        grid = np.linspace(-math.pi, math.pi, 61)
        assert best <= min(miss(a, b) for a in grid for b in grid) + 1e-12
        # And it is a stationary point: small moves never help.
        for a, b in rng.uniform(-1e-4, 1e-4, (20, 2)):
            assert best <= miss(psi + a, q5 + b) + 1e-12


def test_poses_with_a_tilt_are_reached_in_position_from_any_seed() -> None:
    rng = np.random.default_rng(6)
    for q, seed in zip(random_joints(200), random_joints(200, seed=2), strict=True):
        pose = ARM.fk(q)
        pose[:3, :3] = pose[:3, :3] @ rotation("x", rng.uniform(-0.3, 0.3))
        result = ARM.ik(pose, seed)
        assert np.isfinite(result.q).all()
        if result.status in {IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR}:
            assert result.residual[0] < 1e-9


@pytest.mark.parametrize("y", [0.0, 1e-9, 1e-4, 1e-2])
def test_lines_over_the_base_axis_keep_speeds_and_go_on(y: float) -> None:
    x = np.concatenate((np.linspace(0.2, -0.2, 3000), np.full(4000, -0.2)))
    down = ARM.fk(ARM.home)[:3, :3]
    poses = np.array([transform(down, np.array([value, y, 0.3])) for value in x])
    seed = ARM.ik(poses[0]).q
    followed(ARM, poses, seed)


@pytest.mark.parametrize("reach", [1.001, 1.2])
def test_stretching_beyond_reach_and_back_ends_on_the_path(reach: float) -> None:
    q = np.array([0.2, -0.6, 1.0, -0.4, 0.3])
    pose = ARM.fk(q)
    far = pose[:3, 3].copy()
    far[:2] *= reach * (A2 + A3) / np.linalg.norm(far[:2])
    way = np.linspace(pose[:3, 3], far, 3000)
    points = np.concatenate((way, way[::-1], way[:1].repeat(1000, axis=0)))
    poses = np.array([transform(pose[:3, :3], p) for p in points])
    result = followed(ARM, poses, q)
    assert result.residual[-1].max() < 1e-9
