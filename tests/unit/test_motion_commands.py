"""Motion commands: moves, speeds, steps and hold keep every limit, state and promise of the arm."""

import math
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from led_slave import LedSlave
from present import present
from teleop_core.base import ShapeError, build
from teleop_core.graph import DT, TICK_NS, topics
from teleop_core.graph.operation import State
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import load_robot
from teleop_core.robots.robot import Robot
from teleop_core.slave import motion_commands, pair
from teleop_core.slave.operation import OperationParameters
from teleop_core.slave.operation.faults import Fault
from teleop_core.slave.operation.states import Answer

ARM = load_robot("rcrt1")
# Well inside the limits and off the singularities.
MIDDLE = np.array([0.1, 1.7, 0.36, 0.2, 0.5, 0.1])
TIMEOUT_TICKS = 100
SMALL = np.array([0.05, -0.04, -0.02, 0.1, 0.06, -0.1])
# The lag is out of the way: what is shown is what was asked for.
DIRECT = {"reference_filter.is_on": False}


class Bench(LedSlave):
    """A slave at rest in the middle of its range, and the ticks it makes."""

    def __init__(self, name: str = "rcrt1", middle: Array = MIDDLE, **values: float | bool) -> None:
        given = {"robot": name, "start_speed": 1.0, "start": tuple(np.asarray(middle).tolist())} | DIRECT | values
        super().__init__(pair.SimulatedArm(build(pair.ArmParameters, given)))
        self.robot, self.motion, self.now_ns = self.slave.robot, self.slave.server.motion, 10**9
        self.run(1)
        while self.slave.server.operation["is_busy"]:
            self.run(100)
        self.run(200)

    def run(self, ticks: int) -> Array:
        """Setpoints (ticks, n)."""
        found = np.empty((ticks, self.slave.robot.n))
        for row in found:
            self.tick()
            row[:] = self.row["slave_setpoint_js"]
        return found

    @property
    def tip(self) -> Array:
        return self.robot.fk(self.setpoint)


@pytest.fixture
def bench() -> Any:
    return Bench()


def move_to_pose(motion: motion_commands.MotionCommands, T: Array) -> Any:
    """Move to where the tip has a pose, as a session does with move_cp."""
    found = motion.solve(T)
    return found if isinstance(found, tuple) else motion.move(found)


def insist_on_limits(robot: Robot, path: Array) -> None:
    """Speeds within the drives' and speed changes within twenty times what they can brake."""
    speed = np.diff(path, axis=0) / DT
    assert (np.abs(speed) <= present(robot.drives).speed_limit * (1 + 1e-9)).all()
    most = 20.0 * present(robot.drives).effort_limit / present(robot.drives).inertia
    assert (np.abs(np.diff(speed, axis=0)) / DT <= most * (1 + 1e-6)).all()
    assert (path >= robot.lower).all()
    assert (path <= robot.upper).all()


def test_a_move_goes_from_rest_to_rest_at_its_goal_and_tells_so(bench: Bench) -> None:
    answer, _ = bench.motion.move(MIDDLE + SMALL)
    assert answer is Answer.DONE
    np.testing.assert_array_equal(bench.motion.goal, MIDDLE + SMALL)
    path = bench.run(1)
    assert bench.slave.server.operation["is_busy"] == 1.0
    assert bench.motion.source == "move"
    path = np.vstack((path, bench.run(2000)))
    np.testing.assert_array_equal(path[-1], MIDDLE + SMALL)
    insist_on_limits(ARM, path)
    assert bench.slave.server.operation["is_busy"] == 0.0
    # Between two points joints go straight: every joint has done the same share of its way.
    shares = (path - MIDDLE) / SMALL
    np.testing.assert_allclose(shares, shares[:, :1] * np.ones(6), atol=1e-9)


def test_a_move_from_full_speed_brakes_first_and_jumps_in_nothing(bench: Bench) -> None:
    speed = 0.8 * present(ARM.drives).speed_limit * np.array([1, 0, 0, 0, 0, 0])
    path = []
    for _ in range(5):
        bench.motion.drive_joints(speed, bench.now_ns)
        path.append(bench.run(20))
    for goal, ticks in ((MIDDLE + 4.0 * SMALL, 150), (MIDDLE - SMALL, 4000)):  # a newer move takes over
        assert bench.motion.move(goal)[0] is Answer.DONE
        path.append(bench.run(ticks))
    joined = np.vstack(path)
    insist_on_limits(ARM, joined)
    np.testing.assert_array_equal(joined[-1], MIDDLE - SMALL)


def test_a_move_to_a_pose_brings_the_tip_there(bench: Bench) -> None:
    goal = bench.tip @ transform(rotation("x", 0.05), np.array([0.01, -0.005, 0.008]))
    assert move_to_pose(bench.motion, goal)[0] is Answer.DONE
    bench.run(3000)
    np.testing.assert_allclose(bench.tip, goal, atol=1e-12)


def test_a_pose_out_of_reach_is_refused_with_how_far_it_is(bench: Bench) -> None:
    before, goal = bench.setpoint, bench.tip
    goal[0, 3] += 3.0
    answer, text = move_to_pose(bench.motion, goal)
    assert answer is Answer.REFUSED
    assert float(present(re.search(r"nearer than ([\d.e+]+) mm", text))[1]) > 1000.0
    np.testing.assert_array_equal(bench.run(50)[-1], before)


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        (ARM.upper + 0.1, "theta1 = 1.496 is beyond its limits, -1.396 to 1.396"),
        (np.full(6, np.nan), "NaN"),
        (np.full(6, np.inf), "NaN or infinite"),
    ],
)
def test_goals_that_the_joints_cannot_have_are_refused(bench: Bench, goal: Array, why: str) -> None:
    answer, text = bench.motion.move(goal)
    assert answer is Answer.REFUSED
    assert why in text
    assert bench.slave.server.operation["is_busy"] == 0.0


@pytest.mark.parametrize("command", ["move", "move_by"])
def test_another_number_of_joints_is_wrong_use(bench: Bench, command: str) -> None:
    with pytest.raises(ShapeError, match=r"must have shape \(6,\), has \(5,\)"):
        getattr(bench.motion, command)(np.zeros(5))


@pytest.mark.parametrize("state", [State.DISABLED, State.PAUSED, State.FAULT])
def test_nothing_is_moved_outside_enabled(bench: Bench, state: State) -> None:
    bench.slave.server.request({"DISABLED": "disable", "PAUSED": "pause", "FAULT": "stop"}[state.name])
    before, now_ns = bench.run(500)[-1], bench.now_ns
    told = [
        bench.motion.move(MIDDLE + SMALL),
        bench.motion.move_by(SMALL),
        move_to_pose(bench.motion, bench.tip),
        bench.motion.drive_joints(SMALL, now_ns),
        bench.motion.drive_tip(SMALL, now_ns),
        bench.motion.servo(MIDDLE + 1e-3, now_ns),
        bench.motion.servo_by(1e-3 * SMALL, now_ns),
    ]
    assert {answer for answer, _ in told} == {Answer.REFUSED}
    assert all(state.name in text for _, text in told)
    np.testing.assert_array_equal(bench.run(100)[-1], before)


def test_before_homing_is_done_no_motion_command_is_taken() -> None:
    bench = Bench(**dict[str, Any]({"operation.starts_enabled": False}))
    bench.slave.server.request("enable")
    assert bench.motion.move(MIDDLE)[0] is Answer.REFUSED
    assert "home first" in bench.motion.drive_joints(SMALL, bench.now_ns)[1]
    bench.slave.server.request("home")
    bench.run(10)
    assert "homing" in bench.motion.move(MIDDLE)[1]
    assert "homing" in bench.motion.hold()[1]
    while bench.slave.server.operation["is_busy"]:
        bench.run(100)
    assert bench.motion.move(MIDDLE + SMALL)[0] is Answer.DONE


@pytest.mark.parametrize("event", ["pause", "disable", "stop"])
def test_a_state_that_stops_a_move_drops_it_for_good(bench: Bench, event: str) -> None:
    bench.motion.move(MIDDLE + 4.0 * SMALL)
    bench.run(200)
    bench.slave.server.request(event)
    stopped = bench.run(1000)[-1]
    for cure in ("reset", "enable", "resume", "enable"):
        bench.slave.server.request(cure)
    assert bench.slave.server.state["state"] == State.ENABLED
    np.testing.assert_array_equal(bench.run(500)[-1], stopped)


def test_joints_run_at_the_speed_asked_for_until_the_timeout_then_brake(bench: Bench) -> None:
    speed = np.array([0.1, -0.05, 0.01, 0.2, 0.1, -0.1])
    for _ in range(10):
        bench.motion.drive_joints(speed, bench.now_ns)
        path = bench.run(50)
    np.testing.assert_allclose(np.diff(path[-10:], axis=0) / DT, np.tile(speed, (9, 1)), atol=1e-9)
    assert bench.motion.source == "velocity"
    silent = bench.run(500)
    moved = np.abs(np.diff(silent, axis=0)).max(axis=1) > 0.0
    braking = np.max(np.abs(speed) * present(ARM.drives).inertia / present(ARM.drives).effort_limit) / DT
    # 50 ticks of the timeout were over when the listening began.
    assert TIMEOUT_TICKS - 52 <= np.flatnonzero(moved)[-1] <= TIMEOUT_TICKS - 48 + braking
    assert bench.motion.source == "nothing"


def test_speeds_beyond_the_drives_are_cut_in_proportion(bench: Bench) -> None:
    wild = 50.0 * present(ARM.drives).speed_limit * np.array([1, 0.5, 0, 0, 0, 0])
    bench.motion.drive_joints(wild, bench.now_ns)
    path = np.vstack((MIDDLE, bench.run(90)))
    insist_on_limits(ARM, path)
    speed = np.diff(path, axis=0)[-1] / DT
    np.testing.assert_allclose(speed[:2], present(ARM.drives).speed_limit[:2] * [1.0, 0.5], rtol=1e-9)


@pytest.mark.parametrize("axis", range(6))
def test_the_tip_runs_along_its_twist_and_no_other_way(bench: Bench, axis: int) -> None:
    twist = np.zeros(6)
    twist[axis] = 0.02 if axis < 3 else 0.1
    start = bench.tip
    for _ in range(4):
        bench.motion.drive_tip(twist, bench.now_ns)
        bench.run(50)
    before = bench.tip
    bench.motion.drive_tip(twist, bench.now_ns)
    bench.run(50)
    went = (bench.tip[:3, 3] - before[:3, 3]) / (50 * DT)
    turned = (bench.tip[:3, :3] @ before[:3, :3].T - np.eye(3)) / (50 * DT)
    spin = 0.5 * np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    np.testing.assert_allclose(went, twist[:3], atol=2e-5)
    np.testing.assert_allclose(spin, twist[3:], atol=2e-4)
    assert np.linalg.norm(start[:3, 3] - before[:3, 3]) < 0.006


def test_a_tip_driven_to_the_end_of_a_joint_stops_on_its_line(bench: Bench) -> None:
    direction = ARM.jacobian(MIDDLE)[:3, 2]  # d3 outward, 61 mm before its end
    start, line = bench.tip[:3, 3], direction / np.linalg.norm(direction)
    path = []
    for _ in range(60):
        bench.motion.drive_tip(np.concatenate((0.1 * line, np.zeros(3))), bench.now_ns)
        path.append(bench.run(50))
    joined = np.vstack(path)
    insist_on_limits(ARM, joined)
    assert ARM.upper[2] - joined[-1, 2] < 1e-3
    way = bench.tip[:3, 3] - start
    assert np.linalg.norm(way - line * (way @ line)) < 2e-3


def test_next_to_a_singularity_joints_keep_their_limits() -> None:
    straight = MIDDLE.copy()
    straight[4] = 1e-4  # axes 4 and 6 of the wrist nearly in line
    bench = Bench(middle=straight)
    path = []
    for _ in range(20):
        bench.motion.drive_tip([0, 0, 0, 0.5, 0.5, 0.5], bench.now_ns)
        path.append(bench.run(50))
    insist_on_limits(ARM, np.vstack(path))


def test_a_robot_that_cannot_turn_its_tip_does_of_a_twist_what_it_can() -> None:
    robot = load_robot("planar_3r")
    middle = 0.5 * (robot.start + robot.home)
    bench = Bench("planar_3r", middle=middle)
    before = bench.tip
    for _ in range(4):
        assert bench.motion.drive_tip([0.02, 0, 0, 0.1, 0, 0], bench.now_ns)[0] is Answer.DONE
        path = bench.run(50)
    assert np.isfinite(path).all()
    assert bench.tip[0, 3] - before[0, 3] > 0.002


def test_a_running_stream_is_not_taken_over_by_a_speed_and_a_speed_not_by_a_stream(bench: Bench) -> None:
    for _ in range(20):
        bench.tick(MIDDLE + 1e-4)
    answer, text = bench.motion.drive_joints(SMALL, bench.now_ns)
    assert answer is Answer.REFUSED
    assert "stream of servo_jp" in text
    bench.run(TIMEOUT_TICKS + 1)  # the stream falls silent
    assert bench.motion.drive_joints(SMALL, bench.now_ns)[0] is Answer.DONE
    driven = bench.run(20)[-1]
    bench.tick(MIDDLE)
    ahead = np.sign(SMALL) * (bench.setpoint - driven)
    assert (ahead > 0.0).all()


def test_a_move_takes_over_from_a_stream_which_is_followed_again_afterwards(bench: Bench) -> None:
    for _ in range(20):
        bench.tick(MIDDLE)
    bench.motion.move(MIDDLE + SMALL)
    bench.tick(MIDDLE)
    while bench.slave.server.operation["is_busy"]:
        bench.tick(MIDDLE)
    np.testing.assert_array_equal(bench.setpoint, MIDDLE + SMALL)
    for _ in range(200):
        bench.tick(MIDDLE + 0.99 * SMALL)
    np.testing.assert_allclose(bench.setpoint, MIDDLE + 0.99 * SMALL, atol=1e-9)


def test_after_a_move_no_command_is_in_force(bench: Bench) -> None:
    bench.tick(MIDDLE)
    bench.run(1)
    assert bench.slave.signals["slave_setpoint_js_ns"] > topics.NO_COMMAND_NS
    bench.motion.move(MIDDLE + SMALL)
    bench.run(2000)
    assert bench.slave.signals["slave_setpoint_js_ns"] == topics.NO_COMMAND_NS
    np.testing.assert_array_equal(bench.setpoint, MIDDLE + SMALL)


def test_steps_add_up_from_the_setpoint_on_within_one_tick_too(bench: Bench) -> None:
    bench.motion.move_by(SMALL)
    bench.run(2000)
    np.testing.assert_allclose(bench.setpoint, MIDDLE + SMALL, atol=1e-12)
    for ticks in (0, 5):
        for _ in range(50):
            bench.motion.servo_by(0.001 * SMALL, bench.now_ns + TICK_NS)
            bench.run(ticks)
        bench.run(200)
    np.testing.assert_allclose(bench.setpoint, MIDDLE + 1.1 * SMALL, atol=1e-12)


def test_steps_are_taken_after_references_of_the_topic(bench: Bench) -> None:
    for _ in range(20):
        bench.tick(MIDDLE)
    old_ns = int(bench.slave.signals["slave_servo_jp_ns"])
    bench.run(TIMEOUT_TICKS + 1)  # the stream falls silent
    for _ in range(10):
        bench.motion.servo_by(0.001 * SMALL, bench.now_ns + TICK_NS // 2)
        bench.run(1)
        bench.slave.signals["slave_servo_jp_ns"] = old_ns  # as a node does that heard nothing new
    bench.run(200)
    np.testing.assert_allclose(bench.setpoint, MIDDLE + 0.01 * SMALL, atol=1e-12)


def test_references_by_command_are_followed_as_those_of_the_topic() -> None:
    one, other = Bench(), Bench()
    for share in np.linspace(0.0, 0.2, 200):
        one.tick(MIDDLE + share * SMALL)
        other.motion.servo(MIDDLE + share * SMALL, other.now_ns + TICK_NS)
        other.run(1)
        np.testing.assert_array_equal(one.setpoint, other.setpoint)


@pytest.mark.parametrize("kind", ["move", "speed", "lone"])
def test_hold_brakes_what_moves_and_stays(bench: Bench, kind: str) -> None:
    if kind == "move":
        bench.motion.move(MIDDLE + 4.0 * SMALL)
    elif kind == "speed":
        bench.motion.drive_joints(SMALL, bench.now_ns)
    else:
        bench.tick(MIDDLE + 0.1 * SMALL)
    path = [bench.run(30)]
    assert bench.motion.hold()[0] is Answer.DONE
    path.append(bench.run(500))
    joined = np.vstack(path)
    insist_on_limits(ARM, joined)
    held = joined[-1]
    np.testing.assert_array_equal(bench.run(500)[-1], held)
    assert np.abs(held - MIDDLE).max() > 1e-5
    assert np.abs(held - bench.motion.goal).max() == 0.0


def test_after_a_pause_the_arm_stays_where_it_came_to_rest(bench: Bench) -> None:
    for share in np.linspace(0.0, 1.0, 200):
        bench.tick(MIDDLE + share * SMALL)
    bench.slave.server.request("pause")
    rest = bench.run(1000)[-1]
    assert np.abs(rest - MIDDLE - SMALL).max() > 1e-6  # braking takes it past the last reference
    bench.slave.server.request("resume")
    np.testing.assert_array_equal(bench.run(200)[-1], rest)


STREAMS: dict[str, Callable[[Bench, Array], motion_commands.Told]] = {
    "interpolate_jp": lambda bench, step: bench.motion.servo(bench.setpoint + step, bench.now_ns + TICK_NS),
    "servo_jr": lambda bench, step: bench.motion.servo_by(step, bench.now_ns + TICK_NS),
    "servo_jv": lambda bench, step: bench.motion.drive_joints(100.0 * step, bench.now_ns),
    "servo_cv": lambda bench, step: bench.motion.drive_tip(10.0 * step, bench.now_ns),
}


@pytest.mark.parametrize("intruder", STREAMS)
@pytest.mark.parametrize("owner", ["servo_jp", *STREAMS])
def test_beside_a_stream_each_command_of_another_is_refused_and_moves_nothing(owner: str, intruder: str) -> None:
    if owner == intruder:
        return
    alone, beside = Bench(), Bench()
    for k in range(60):
        for bench in (alone, beside):
            if bench is beside and k >= 5:
                told = STREAMS[intruder](bench, -1e-2 * SMALL)
                assert told[0] is Answer.REFUSED
                assert f"stream of {owner}" in told[1]
            if owner == "servo_jp":
                bench.tick(bench.setpoint + 1e-3 * SMALL)
            else:
                assert STREAMS[owner](bench, 1e-3 * SMALL)[0] is Answer.DONE
                bench.run(1)
    assert np.abs(alone.setpoint - MIDDLE).max() > 1e-5
    np.testing.assert_array_equal(alone.setpoint, beside.setpoint)


@pytest.mark.parametrize("owner", STREAMS)
def test_beside_a_stream_of_commands_servo_jp_moves_nothing(owner: str) -> None:
    alone, beside = Bench(), Bench()
    for k in range(60):
        for bench in (alone, beside):
            assert STREAMS[owner](bench, 1e-3 * SMALL)[0] is Answer.DONE
            bench.tick(MIDDLE - SMALL if bench is beside and k >= 5 else None)
    np.testing.assert_array_equal(alone.setpoint, beside.setpoint)


@pytest.mark.parametrize("age", [5.1, 60.0, 1000.0, -1.1])
def test_a_command_of_a_wrong_age_moves_nothing_whether_first_or_later(bench: Bench, age: float) -> None:
    late_ns, before = round(age * 1e9), bench.setpoint
    bench.now_ns += 2000 * 10**9
    bench.run(1)
    answer, text = present(bench.motion.refusal_of_age(bench.now_ns - late_ns, bench.now_ns))
    assert answer is Answer.REFUSED
    assert f"{abs(age):.3g} s" in text
    for _ in range(50):
        bench.tick(MIDDLE + SMALL, bench.now_ns - late_ns)
    assert bench.slave.server.refused >= 50
    np.testing.assert_array_equal(bench.setpoint, before)


def test_a_command_without_a_stamp_or_a_little_old_is_taken(bench: Bench) -> None:
    assert bench.motion.refusal_of_age(0, bench.now_ns) is None
    for age in (0.0, 3.0, -0.9):
        assert bench.motion.refusal_of_age(bench.now_ns - round(age * 1e9), bench.now_ns) is None


@pytest.mark.parametrize("size", [1e155, 1e307, np.finfo(float).max])
def test_speeds_that_no_arm_has_are_refused_and_the_arm_goes_on(bench: Bench, size: float) -> None:
    for axis in range(6):
        wild = np.zeros(6)
        wild[axis] = size
        for drive in (bench.motion.drive_tip, bench.motion.drive_joints):
            answer, text = drive(wild, bench.now_ns)
            assert answer is Answer.REFUSED
            assert "as fast as the arm can move" in text
    assert np.isfinite(bench.run(200)).all()
    assert bench.motion.drive_joints(SMALL, bench.now_ns)[0] is Answer.DONE


def test_a_setpoint_that_is_no_number_is_neither_sent_nor_kept_and_reset_ends_the_fault(bench: Bench) -> None:
    before = bench.setpoint
    bench.motion.drive_joints(SMALL, bench.now_ns)
    bench.slave.server.state["drive"] = np.nan
    np.testing.assert_array_equal(bench.run(1)[-1], before)
    bench.run(500)
    assert bench.slave.server.operation["fault"] == Fault.SETPOINT
    for cure in ("reset", "enable"):
        assert bench.slave.server.request(cure)[0] is Answer.DONE
    assert bench.motion.move(MIDDLE + SMALL)[0] is Answer.DONE
    np.testing.assert_array_equal(bench.run(3000)[-1], MIDDLE + SMALL)


def test_a_reset_takes_the_measured_position_within_the_limits_of_drives_and_tool() -> None:
    bench = Bench(**dict[str, Any]({"operation.tool_speed": 0.05}))
    server, row = bench.slave.server, bench.row
    server.request("stop")
    bench.run(300)
    stands = row["slave_measured_js"].copy()
    stands[0] += 0.02  # as an arm that is held by its brakes

    def run(ticks: int) -> Array:
        found = np.empty((ticks, 6))
        for setpoint in found:
            row["now_ns"] += TICK_NS
            row["slave_measured_js"], row["slave_measured_js_ns"] = stands, row["now_ns"]
            server.step()
            setpoint[:] = row["slave_setpoint_js"]
        return found

    held = run(10)
    assert abs(held[-1, 0] - stands[0]) > 0.01
    server.request("reset")
    path = np.vstack((held, run(2000)))
    assert (np.abs(np.diff(path, axis=0)) / DT <= present(ARM.drives).speed_limit * (1 + 1e-9)).all()
    tips = np.array([ARM.fk(q)[:3, 3] for q in path])
    assert (np.linalg.norm(np.diff(tips, axis=0), axis=1) / DT <= server.parameters["tool_speed"] * (1 + 1e-6)).all()
    assert np.abs(path[-1] - stands[:6]).max() <= present(ARM.drives).encoder_step.max() + 1e-3


MAGNITUDES = st.one_of(
    st.just(1.0), st.floats(-3.0, 308.0).map(lambda power: 10.0**power), st.just(np.finfo(float).max)
)
COMMANDS = st.lists(
    st.tuples(
        st.sampled_from(
            ["move", "move_by", "pose", "joints", "tip", "step", "reference", "hold", "stream", "pause", "resume",
             "stop", "reset", "enable", "home", "disable"]
        ),
        st.tuples(st.lists(st.floats(-1.0, 1.0, width=32), min_size=6, max_size=6), MAGNITUDES).map(
            lambda drawn: [drawn[1] * number for number in drawn[0]]
        ),
        st.integers(1, 120),
    ),
    min_size=1,
    max_size=12,
)  # fmt: skip


@cache
def shared() -> Bench:
    """Bench of all examples: each begins it anew."""
    return Bench(**dict[str, Any]({"operation.longest_outage": 0.0}))


@settings(max_examples=60, deadline=None)
@given(commands=COMMANDS)
def test_whatever_is_commanded_no_step_exceeds_the_limits_of_the_drives(
    commands: list[tuple[str, list[float], int]],
) -> None:
    bench, path = shared(), []
    bench.slave.reset()
    path.append(bench.run(3))
    for name, numbers, ticks in commands:
        wild: Any = np.array(numbers)
        now_ns, motion = bench.now_ns, bench.motion
        if name == "stream":
            bench.tick(bench.setpoint + 0.02 * wild)
            path.append(bench.setpoint[None])
        elif name in {"move", "move_by", "pose", "joints", "tip", "step", "reference", "hold"}:
            acts: dict[str, Callable[[], object]] = {
                "move": lambda: motion.move(bench.setpoint + wild),
                "move_by": lambda: motion.move_by(wild),
                "reference": lambda: motion.servo(bench.setpoint + 0.1 * wild, now_ns),
                "pose": lambda: move_to_pose(motion, bench.tip @ transform(rotation("z", wild[3]), 0.1 * wild[:3])),
                "joints": lambda: motion.drive_joints(20.0 * wild, now_ns),
                "tip": lambda: motion.drive_tip(5.0 * wild, now_ns),
                "step": lambda: motion.servo_by(0.1 * wild, now_ns),
                "hold": motion.hold,
            }
            with np.errstate(over="ignore"):  # of the test's own products
                acts[name]()
        else:
            bench.slave.server.request(name)
        path.append(bench.run(ticks))
    joined = np.vstack(path)
    speed = np.diff(joined, axis=0) / DT
    assert (np.abs(speed) <= present(ARM.drives).speed_limit * (1 + 1e-9)).all()
    assert ((joined >= ARM.lower) & (joined <= ARM.upper)).all()
    tips = np.array([ARM.fk(q)[:3, 3] for q in joined[::10]])
    most = bench.slave.server.parameters["tool_speed"] * 10 * DT
    assert (np.linalg.norm(np.diff(tips, axis=0), axis=1) <= most * (1 + 1e-6)).all()
    assert math.isfinite(np.abs(joined).sum())


def test_the_parameters_that_bound_motion_are_those_of_the_operation() -> None:
    slow = build(OperationParameters, {"tool_speed": 0.01})
    assert slow.tool_speed == 0.01
    bench = Bench(**dict[str, Any]({"operation.tool_speed": 0.01}))
    bench.motion.drive_tip([0.5, 0, 0, 0, 0, 0], bench.now_ns)
    tips = np.array([ARM.fk(q)[:3, 3] for q in bench.run(95)])
    fastest = np.linalg.norm(np.diff(tips, axis=0), axis=1).max() / DT
    assert 0.005 < fastest <= 0.01 * (1 + 1e-6)
