"""Inverse kinematics as a stage: its branch, the wrist singularity, speeds, limits and restarts."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from present import present
from teleop_core.coupling.mapping.inverse_kinematics import InverseKinematics, InverseKinematicsParameters
from teleop_core.graph import TICK_NS, topics
from teleop_core.kernels.geometry import Array, pose_from_transform, rotation, transform
from teleop_core.robots import IkStatus, load_robot

ARM = load_robot("rcrt1")
SPEED = present(ARM.drives).speed_limit
STEP = SPEED * 1e-3
# What a command asks for that comes alone, or first.
ALONE = SPEED * 0.45
# Within the speed limit: products of it with 1e-3, subtracted from joints of size one.
STEP_ROUNDING = 1e-15
START = np.array([0.1, 1.7, 0.35, 0.2, 0.0, 0.1])


class Stage:
    """Inverse kinematics with a slave that follows it at once, or stands still."""

    def __init__(self, **values: Any) -> None:
        self.ik = InverseKinematics(InverseKinematicsParameters(**values))
        self.row = self.ik.signals
        self.row["slave_setpoint_js"] = ARM.home

    def step(self, pose: Array, *, gap_ns: int = TICK_NS, does_follow: bool = True) -> Array:
        row = self.row
        row["slave_servo_cp_ns"] += gap_ns
        pose_from_transform(np.ascontiguousarray(pose), row["slave_servo_cp"])
        self.ik.step()
        if does_follow:
            row["slave_setpoint_js"] = row["slave_servo_jp"]
            row["slave_setpoint_js_ns"] = row["slave_servo_cp_ns"]
        return row["slave_servo_jp"].copy()

    def settle(self, pose: Array, steps: int = 3000) -> Array:
        """Joints after the arm had time to go to a pose."""
        for _ in range(steps):
            joints = self.step(pose)
        return joints

    @property
    def status(self) -> IkStatus:
        return IkStatus(int(self.reach("status")))

    def reach(self, name: str) -> float:
        return self.row["slave_reach"][topics.SLAVE_REACH.columns.index(name)]

    @property
    def residual(self) -> Array:
        """Distance [m] and angle [rad] that the answer leaves (2,)."""
        return np.array([self.reach("position_residual"), self.reach("rotation_residual")])


def pass_by(distance: float, tool_speed: float, roll: float = 0.0) -> Array:
    """Poses (N, 4, 4), 1 ms apart, whose tool axis passes the wrist singularity at a distance.

    The tool turns by 0.8 rad at ``tool_speed`` [rad/s] about its own y axis, rolled by ``roll``;
    in the middle it is ``distance`` [rad] beside the singularity.
    """
    middle, poses = ARM.fk(START), []
    for turn in np.linspace(0.4, -0.4, round(0.8 / tool_speed * 1e3)):
        tilt = rotation("z", roll) @ rotation("y", turn) @ rotation("x", distance)
        poses.append(middle @ transform(tilt @ rotation("z", -roll), np.zeros(3)))
    return np.array(poses)


@pytest.mark.parametrize(("about", "sign"), [("x", -1), ("y", 1), ("y", -1), ("z", 1)])
def test_tool_turns_away_from_home_and_back_without_a_flip(about: str, sign: int) -> None:
    stage, middle = Stage(), ARM.fk(ARM.home)
    middle[:3, 3] *= 0.9
    stage.settle(middle)
    here = stage.step(middle)
    turns = sign * 0.6 * np.sin(np.linspace(0.0, math.pi, 3000))
    for turn in turns:
        joints = stage.step(middle @ transform(rotation(about, turn), np.zeros(3)))
        assert stage.status in {IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR, IkStatus.LIMITED}
        # A flip would take joint 4 to the other side, more than a right angle away.
        assert abs(joints[3]) <= math.pi / 2 + 1e-3
    # Joint 4 is free on the singularity; its sum with joint 6 is not.
    back = stage.settle(middle, 1000)
    assert math.isclose(back[3] + back[5], here[3] + here[5], abs_tol=1e-9)
    assert np.allclose(np.delete(back, (3, 5)), np.delete(here, (3, 5)), rtol=0, atol=1e-9)


@pytest.mark.parametrize("tool_speed", [0.2, 0.5, 2.0])
@pytest.mark.parametrize("distance", [0.0, 1e-9, 1e-4, 1e-3])
def test_close_to_the_singularity_joint_5_goes_through_zero_and_motion_goes_on_within_speeds(
    distance: float, tool_speed: float
) -> None:
    stage, poses = Stage(), pass_by(distance, tool_speed)
    first = last = stage.settle(poses[0])
    worst = 0.0
    for pose in poses:
        before, last = last, stage.step(pose)
        assert (np.abs(last - before) <= STEP + STEP_ROUNDING).all()
        worst = max(worst, stage.residual[1])
    assert first[4] > 0.4
    assert last[4] < -0.4
    assert abs(last[3] - first[3]) < 0.02
    assert stage.residual.max() < 1e-9
    # The tool passes through the singularity instead of beside it: at most 2.5 distances off.
    assert worst <= 2.5 * distance + 1e-12


@pytest.mark.parametrize("distance", [5e-3, 0.02])
def test_further_beside_the_singularity_the_tool_lags_and_catches_up(distance: float) -> None:
    # Joints 4 and 6 have room for the half turn that following this path would take.
    stage, poses = Stage(), pass_by(distance, 0.5, roll=1.5)
    last = stage.settle(poses[0])
    worst = 0.0
    for pose in poses:
        before, last = last, stage.step(pose)
        assert (np.abs(last - before) <= STEP + STEP_ROUNDING).all()
        worst = max(worst, stage.residual[1])
    # Joint 4 needs half a turn, 0.43 s, in which the tool goes on by 0.21 rad.
    assert 0.5 * distance < worst < 0.21
    stage.settle(poses[-1], 500)
    assert stage.residual.max() < 1e-9


@pytest.mark.parametrize("seed", range(2))
def test_noise_of_the_gimbal_at_home_does_not_drive_joint_4_away(seed: int) -> None:
    # There the tool's direction, which joint 4 turns to, is noise alone; at its limit of 170
    # degrees joint 4 would later keep the tool off its pose.
    rng, stage, home = np.random.default_rng(seed), Stage(), ARM.fk(ARM.home)
    home[:3, 3] *= 0.98
    stage.step(ARM.fk(ARM.home))  # a stream begins where the slave is
    for angles in np.clip(1e-3 * rng.standard_normal((5000, 3)), -2e-3, 2e-3):
        turn = rotation("x", angles[0]) @ rotation("y", angles[1]) @ rotation("z", angles[2])
        joints = stage.step(home @ transform(turn, np.zeros(3)))
    assert abs(joints[3]) < 0.3
    # What it lets through instead is the noise itself.
    assert stage.residual[1] < 4e-3


def test_pose_far_away_is_limited_and_approached_at_full_speed_of_one_joint() -> None:
    stage: Any
    stage, goal = Stage(), ARM.fk(np.array([1.0, 1.6, 0.3, 0.5, 0.6, 0.7]))
    stage.settle(ARM.fk(START))
    before = stage.step(ARM.fk(START))
    after = stage.step(goal)
    assert stage.status is IkStatus.LIMITED
    assert stage.residual.max() > 0.1
    assert math.isclose((np.abs(after - before) / STEP).max(), 1.0, rel_tol=1e-9)
    stage.settle(goal)
    now: IkStatus = stage.status
    assert now is IkStatus.FOLLOWED


def test_pose_out_of_reach_is_unreachable_and_the_arm_points_there() -> None:
    stage, goal = Stage(), ARM.fk(START)
    goal[:3, 3] *= 2.0
    stage.settle(goal)
    assert stage.status is IkStatus.UNREACHABLE
    assert stage.row["slave_servo_jp"][2] == ARM.upper[2]
    assert stage.residual[0] > 0.3


def test_share_of_the_speed_limits_is_kept_and_a_new_one_holds_from_the_next_pose() -> None:
    stage, goal = Stage(speed_share=0.25), ARM.fk(np.array([1.0, 1.6, 0.3, 0.5, 0.6, 0.7]))
    last = stage.step(ARM.fk(ARM.home))
    assert np.allclose(last, ARM.home, rtol=0, atol=1e-12)  # poses travel as quaternions
    for _ in range(100):
        joints = stage.step(goal)
        assert (np.abs(joints - last) <= 0.25 * STEP + STEP_ROUNDING).all()
        last = joints
    stage.ik.retune(InverseKinematicsParameters(speed_share=0.1))
    joints = stage.step(goal)
    assert math.isclose((np.abs(joints - last) / STEP).max(), 0.1, rel_tol=1e-9)


def test_slave_that_stands_still_is_where_solutions_start_again() -> None:
    stage, goal = Stage(), ARM.fk(np.array([1.0, 1.6, 0.3, 0.5, 0.6, 0.7]))
    stage.settle(ARM.fk(START))
    held = stage.row["slave_setpoint_js"].copy()
    for _ in range(150):
        joints = stage.step(goal, does_follow=False)
    # After the timeout of 0.1 s every answer is one step from the slave's setpoint.
    assert (np.abs(joints - held) <= STEP + STEP_ROUNDING).all()


def test_commands_slower_than_the_timeout_go_on_from_each_other_for_twice_their_period() -> None:
    stage, goal = Stage(), ARM.fk(START + np.array([0.6, 0, 0, 0, 0, 0]))
    stage.settle(ARM.fk(START))
    slow: Any = {"gap_ns": 150_000_000, "does_follow": False}
    answers = [stage.step(goal, **slow)[0] for _ in range(4)]
    one, held = SPEED[0] * 0.15, START[0]
    # The fourth is asked for when the setpoint is three periods older than the command before.
    assert answers == pytest.approx([held + one, held + 0.6, held + 0.6, held + one])


def test_restart_beside_the_flipped_branch_stays_on_it() -> None:
    flipped = START + np.array([0, 0, 0, 0, -0.5, 0])
    stage = Stage()
    stage.row["slave_setpoint_js"] = flipped
    joints = stage.step(ARM.fk(flipped), gap_ns=10**9)
    assert np.allclose(joints, flipped, rtol=0, atol=1e-9)


def test_reset_starts_from_where_the_slave_is() -> None:
    stage = Stage()
    stage.settle(ARM.fk(START))
    stage.ik.reset()
    stage.row["slave_setpoint_js"] = ARM.home
    joints = stage.step(ARM.fk(START), does_follow=False)
    assert (np.abs(joints - ARM.home) <= ALONE + STEP_ROUNDING).all()


@pytest.mark.parametrize("bad", [[math.nan, 1.0], [math.inf, 1.0], [0.4, 1.01]])
def test_pose_that_is_not_finite_or_whose_quaternion_is_not_unit_holds_the_joints(bad: list[float]) -> None:
    stage = Stage()
    before = stage.settle(ARM.fk(START))
    stage.row["slave_servo_cp"][0] = bad[0]
    stage.row["slave_servo_cp"][3:] *= bad[1]
    stage.row["slave_servo_cp_ns"] += TICK_NS
    stage.ik.step()
    assert np.array_equal(stage.row["slave_servo_jp"], before)
    assert stage.reach("status") == -1


poses = st.tuples(*[st.floats(-1e3, 1e3)] * 3, *[st.floats(-3.2, 3.2)] * 3)


@given(st.lists(poses, min_size=1, max_size=20))
def test_any_poses_give_finite_joints_within_limits_and_speeds(wanted: list[tuple[float, ...]]) -> None:
    stage = Stage()
    last, most = ARM.home, ALONE
    for x, y, z, a, b, c in wanted:
        turn = rotation("z", a) @ rotation("y", b) @ rotation("x", c)
        joints = stage.step(transform(turn, np.array([x, y, z])))
        assert np.isfinite(joints).all()
        assert np.isfinite(stage.residual).all()
        assert ((joints >= ARM.lower) & (joints <= ARM.upper)).all()
        assert (np.abs(joints - last) <= most + STEP_ROUNDING).all()
        last, most = joints, STEP


def smooth_poses(seed: int, count: int = 500) -> tuple[Array, Array]:
    """Poses of a smooth joint path inside the limits."""
    rng = np.random.default_rng(seed)
    middle, times = 0.5 * (ARM.lower + ARM.upper), np.arange(count) * 1e-3
    phases, rates = rng.uniform(0.0, 6.3, 6), rng.uniform(0.2, 0.8, 6)
    swing = np.array([0.8, 0.4, 0.05, 1.0, 0.6, 1.0]) * np.sin(np.outer(times, rates) + phases)
    return middle + swing, ARM.fk(middle + swing)


def test_path_of_a_batch_is_that_of_the_stage() -> None:
    joints, path = smooth_poses(3)
    together = ARM.follow(path, joints[0])
    stage = Stage()
    stage.ik.arguments[2].seed[:] = joints[0]
    stage.row["slave_setpoint_js"] = joints[0]
    alone = np.array([stage.step(pose) for pose in path])
    # The stage's poses pass through quaternions, which joint 4 sees over sin(theta5).
    assert np.allclose(together.q, alone, rtol=0, atol=1e-9)
