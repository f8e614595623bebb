"""RCRT-1 kinematics: published poses, misprints, four branches, singularities, limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop_core.kernels.geometry import Array, roll_pitch_yaw, rotation, transform
from teleop_core.robots import IkStatus, load_robot
from teleop_core.robots.arms.rcrt1_hardware import tendon_joint_angles, tendon_motor_angles

ARM = load_robot("rcrt1")
# Ten products of numbers of size one.
ROUNDING = 1e-14
DEGREE, MM = math.pi / 180.0, 1e-3
L6 = 0.037

# Spec section 8, case 7: joints (degrees, mm) and tip (mm) of the six published poses.
PUBLISHED = {
    1: ((45, 68.715, 350, 80.214, 80.214, 80.214), (210.9325, 261.7467, 123.5609)),
    2: ((45, 90, 375, 80.214, 80.214, 80.214), (244.2048, 295.0190, -6.1973)),
    3: ((-30, 110, 400, 45, 45, 45), (350.5808, -181.0459, -163.1406)),
    4: ((-30, 130, 350, 45, 45, 45), (248.5033, -122.1115, -255.9647)),
    5: ((-45, 143.715, 375, 80.214, 80.214, 80.214), (181.4317, -130.6174, -311.0181)),
    6: ((30, 130, 400, 45, 45, 45), (263.1740, 173.3056, -288.1041)),
}
# Case 8: fixed angles of the same poses (degrees).
ROLL_PITCH_YAW = {
    1: (-156.14, -57.086, 100.002),
    2: (175.521, -75.061, 130.521),
    3: (86.187, -17.976, 138.436),
    4: (78.699, -25.695, 158.349),
    5: (-28.917, -44.976, -109.500),
    6: (138.699, -25.695, 158.349),
}


def joints(theta1: int, theta2: float, d3: int, theta4: float, theta5: float, theta6: float) -> Array:
    """Joint vector from degrees and mm."""
    angles = np.array([theta1, theta2, 0.0, theta4, theta5, theta6]) * DEGREE
    angles[2] = d3 * MM
    return angles


def inside_limits(count: int, seed: int = 1) -> Array:
    rng = np.random.default_rng(seed)
    # 10 mm of d3 is left out: there the wrist centre is at the shoulder.
    low = np.where(np.arange(6) == 2, 0.01, ARM.lower)
    return rng.uniform(low, ARM.upper, (count, 6))


@st.composite
def legal_joints(draw: st.DrawFn) -> Array:
    shares = [draw(st.floats(0.0, 1.0)) for _ in range(6)]
    low = np.where(np.arange(6) == 2, 0.01, ARM.lower)
    return low + np.array(shares) * (ARM.upper - low)


def standard_link(theta: float, d: float, alpha: float, a4_32: float | None = None) -> Array:
    """Distal Denavit-Hartenberg matrix Rz(theta) Tz(d) Rx(alpha)."""
    out = transform(rotation("z", theta) @ rotation("x", alpha), np.array([0.0, 0.0, d]))
    if a4_32 is not None:
        out[2, 1] = a4_32
    return out


def denavit_hartenberg(q: Array, a4_32: float = -1.0) -> Array:
    quarter = math.pi / 2
    table = (
        (q[0], 0.0, -quarter, None),
        (q[1], 0.0, quarter, None),
        (0.0, q[2], 0.0, None),
        (q[3], 0.0, -quarter, a4_32),
        (q[4], 0.0, quarter, None),
        (q[5], L6, 0.0, None),
    )
    return np.linalg.multi_dot([standard_link(*row) for row in table])


def test_standard_table_gives_the_forward_kinematics() -> None:  # case 1
    for q in inside_limits(200):
        # 1e-12 is the bound of the case; lengths are in metres.
        assert np.allclose(denavit_hartenberg(q), ARM.fk(q), rtol=0, atol=1e-12)


def test_ranges_of_the_joints_are_those_of_table_6_2() -> None:
    for end, wanted in (
        (ARM.lower, joints(-80, 50, 0, -170, -80, -170)),
        (ARM.upper, joints(80, 160, 421, 170, 80, 170)),
    ):
        assert np.allclose(end, wanted, rtol=0, atol=ROUNDING)


def test_home_is_where_the_joint_table_puts_it() -> None:  # case 2
    pose = ARM.fk(ARM.home)
    # Half of the last digit given.
    assert np.allclose(pose[:3, 3] / MM, (420.3316, 0.0, -181.8937), rtol=0, atol=5e-5)
    assert np.allclose(pose[:3, :3], rotation("y", 113.4 * DEGREE), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(
    ("posture", "tip", "approach"),
    [
        ((0, 90, 300, 0, 0, 0), (337, 0, 0), (1, 0, 0)),  # case 3
        ((0, 90, 300, 0, 90, 0), (300, 0, -37), (0, 0, -1)),  # case 4
        ((0, 90, 300, 90, 90, 0), (300, 37, 0), (0, 1, 0)),  # case 5
    ],
)
def test_right_angled_postures_have_the_tip_where_a_ruler_would(
    posture: tuple[int, ...], tip: tuple[int, int, int], approach: tuple[int, int, int]
) -> None:
    pose = ARM.fk(joints(*posture))
    assert np.allclose(pose[:3, 3] / MM, tip, rtol=0, atol=1e-11)
    assert np.allclose(pose[:3, 2], approach, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("point", ROLL_PITCH_YAW)
def test_fixed_angles_of_the_published_poses_reproduce(point: int) -> None:  # case 8
    angles = roll_pitch_yaw(ARM.fk(joints(*PUBLISHED[point][0]))[:3, :3])
    # Half of the last digit given; -156.14 has two.
    tolerance = 5e-3 if point == 1 else 5.1e-4
    assert np.allclose(angles / DEGREE, ROLL_PITCH_YAW[point], rtol=0, atol=tolerance)


def test_four_branches_are_the_arm_behind_and_the_wrist_flipped() -> None:
    q = joints(30, 70, 300, 40, 50, 60)
    front, flipped, behind, _ = ARM.ik_all(ARM.fk(q))
    turn = math.pi
    assert np.allclose(front, q, rtol=0, atol=1e-12)
    assert np.allclose(flipped[3:] - q[3:], (-turn, -2 * q[4], -turn), rtol=0, atol=1e-12)
    assert np.allclose(behind[:3], (q[0] - turn, -q[1], q[2]), rtol=0, atol=1e-12)


def test_at_the_wrist_singularity_joint_4_keeps_its_value_and_joint_6_turns() -> None:  # case 11
    turned = ARM.home + np.array([0, 0, 0, 0, 0, 0.4])
    answer = ARM.ik(ARM.fk(turned))
    assert answer.status is IkStatus.NEAR_SINGULAR
    assert np.allclose(answer.q, turned, rtol=0, atol=1e-9)
    kept = ARM.home + np.array([0, 0, 0, 0.3, 0, 0.1])
    answer = ARM.ik(ARM.fk(turned), kept)
    assert answer.q[3] == 0.3
    assert math.isclose(answer.q[5], 0.1, abs_tol=1e-9)


def test_roll_that_joint_6_cannot_do_alone_at_the_wrist_singularity_is_shared_with_joint_4() -> None:
    rng = np.random.default_rng(4)
    for roll, seed4 in rng.uniform(ARM.lower[3], ARM.upper[3], (500, 2)):
        total = roll + rng.uniform(ARM.lower[5], ARM.upper[5])
        pose = ARM.fk(np.array([0.2, 1.8, 0.4, total, 0.0, 0.0]))
        answer = ARM.ik(pose, np.array([0.2, 1.8, 0.4, seed4, 0.0, 0.0]))
        assert answer.status is IkStatus.NEAR_SINGULAR
        assert answer.residual.max() < 1e-9


@pytest.mark.parametrize("size", [0.0, 5e-324, 1e-200, 1e200, 1.7e308])
@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0, 0, -1), (1, 1, 1)])
def test_smallest_and_largest_places_give_finite_joints(size: float, direction: tuple[int, int, int]) -> None:
    answer = ARM.ik(transform(np.eye(3), size * np.array(direction, dtype=float)))
    assert np.isfinite(answer.q).all()
    assert not np.isnan(answer.residual).any()


@pytest.mark.parametrize(
    ("posture", "joint", "bound"),
    [((85, 90, 300, 10, 20, 30), 0, 80), ((10, 165, 300, 10, 20, 30), 1, 160), ((10, 90, 300, 10, 85, 30), 4, 80)],
)
def test_pose_past_a_joint_limit_is_limited_and_stays_at_the_limit(
    posture: tuple[int, ...], joint: int, bound: int
) -> None:
    answer = ARM.ik(ARM.fk(joints(*posture)))
    assert answer.status is IkStatus.LIMITED
    assert math.isclose(answer.q[joint], bound * DEGREE, abs_tol=1e-12)
    assert answer.residual.max() > 1e-3


@given(st.floats(0.0, 0.05), legal_joints())
def test_shoulder_offset_keeps_the_inverse_an_inverse(offset: float, q: Array) -> None:
    # With an offset the wrist centre stays off the axis of joint 1.
    arm = load_robot("rcrt1", d2=offset, L6=0.05)
    pose = arm.fk(q)
    branches = arm.ik_all(pose)
    assert np.allclose(arm.fk(branches), pose, rtol=0, atol=1e-12)


@given(
    st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2),
    st.floats(0.1, 5.0),
    st.floats(-5.0, -0.1),
    st.floats(-3.0, 3.0),
)
def test_joint_angles_come_back_from_the_motor_angles(
    angles: list[float], ratio5: float, ratio6: float, coupling: float
) -> None:
    ratios = {"ratio5": ratio5, "ratio6": ratio6, "coupling": coupling}
    back = tendon_joint_angles(tendon_motor_angles(np.array(angles), **ratios), **ratios)
    # Products up to 15 divided by ratios down to 0.1.
    assert np.allclose(back, angles, rtol=0, atol=1e-12)
