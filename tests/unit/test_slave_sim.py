"""Slave simulator: exact where it can be, within its limits, calm at rest, safe on bad commands."""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

from led_slave import LedSlave
from present import present
from teleop_core.base import ParameterError, build
from teleop_core.graph import DT, TICK_NS
from teleop_core.graph.operation import State
from teleop_core.kernels import Array, pointer
from teleop_core.robots import drives, load_robot
from teleop_core.slave import commands, pair, slave_sim
from teleop_core.slave.controllers import CONTROLLERS
from teleop_core.slave.joints import integrate
from teleop_core.slave.operation import Answer, Fault, OperationParameters
from teleop_core.slave.parameters import ReferenceFilterParameters

ARM = load_robot("rcrt1")
DRIVES = present(ARM.drives)
AT_HOME = tuple(ARM.home.tolist())
COUNT = DRIVES.encoder_step
# Well inside the limits and off the singularities.
MIDDLE = np.array([0.1, 1.7, 0.36, 0.2, 0.5, 0.1])
TIMEOUT_TICKS = 100
JOINTS = (0, 2, 5)


def pid(**values: tuple[float, ...]) -> slave_sim.ControllerParameters:
    """Controller parameters with some of the PID's."""
    return build(slave_sim.ControllerParameters, {f"pid.{name}": value for name, value in values.items()})


class Bench(LedSlave):
    """A slave that begins at home."""

    def __init__(self, **values: Any) -> None:
        super().__init__(pair.SimulatedArm(pair.ArmParameters(**{"start": AT_HOME} | values)))

    def trace(self, command: Array | None, ticks: int) -> tuple[Array, Array]:
        """True joints (ticks, 6) and efforts (ticks, 6) under a constant command."""
        joints, efforts = np.empty((ticks, 6)), np.empty((ticks, 6))
        for i in range(ticks):
            self.tick(command)
            joints[i], efforts[i] = self.joints, self.row["slave_measured_js"][12:]
        return joints, efforts

    def go_to(self, goal: Array, ticks: int = 3000) -> None:
        start = self.row["slave_setpoint_js"].copy()
        for share in np.linspace(0.0, 1.0, ticks - 1000):
            self.tick(start + share * (goal - start))
        self.trace(goal, 1000)

    @property
    def joints(self) -> Array:
        return self.slave.simulated.arm.q.copy()


# Integration.

SPIN = pointer(drives.independent_acceleration, drives.ACCELERATION)


def one_tick_error(rate: float, steps: int) -> float:
    """Error of position and speed, relative to the start speed, of a joint that friction stops."""
    q, dq, effort = np.zeros(6), np.ones(6), np.full(6, 0.3 * rate)
    slave = slave_sim.SlaveSim(slave_sim.SlaveSimParameters())
    slave.parameters["viscous"], slave.parameters["coulomb"] = rate, 0.0
    integrate(SPIN, np.ones(6), slave.parameters, slave.state, slave.arm.contacts, steps, effort, q, dq, DT)
    exact = expm(np.array([[0, 1, 0], [0, -rate, 1], [0, 0, 0]]) * 1e-3) @ [0.0, 1.0, effort[0]]
    return max(abs(q[0] - exact[0]) / 1e-3, abs(dq[0] - exact[1]))


def test_error_against_the_exact_solution_falls_with_the_fourth_power_of_the_steps() -> None:
    errors = [one_tick_error(1000.0, steps) for steps in (1, 2, 4, 8, 16)]
    order = np.log2(np.divide(errors[:-1], errors[1:]))
    # Classical Runge-Kutta is of fourth order; large steps still carry the fifth.
    assert (order > 3.8).all()
    assert (order < 4.7).all()


def test_default_steps_resolve_the_stiffest_friction_of_the_arm() -> None:
    # Dry friction grows through zero speed like viscous friction of coulomb / friction_speed.
    rates = (DRIVES.viscous + DRIVES.coulomb / DRIVES.friction_speed) / DRIVES.inertia
    steps = pair.ArmParameters().integration_steps
    # Fifth-order term (rate h)^5 / 120 in each step of h = 1 ms / steps: 670/s makes 7e-5.
    bound = steps * (rates.max() * 1e-3 / steps) ** 5 / 120.0
    assert bound < 1e-4
    assert one_tick_error(rates.max(), steps) < bound


def test_more_steps_change_the_path_of_the_arm_less_and_less() -> None:
    slave, ends = slave_sim.SlaveSim(slave_sim.SlaveSimParameters()), []
    arm = slave.arm
    effort = np.array([2.0, -3.0, 5.0, 0.05, 0.03, 0.02])
    for steps in (1, 2, 4, 8):
        q, dq = MIDDLE.copy(), np.array([1.0, -1.0, 0.02, 1.0, -1.0, 1.0])
        for _ in range(100):
            integrate(
                arm.acceleration, arm.dynamics, slave.parameters, slave.state, arm.contacts, steps, effort, q, dq, DT
            )
        ends.append(q)
    in_counts = np.array([np.abs((b - a) / COUNT).max() for a, b in pairwise(ends)])
    # Where joints turn round, dry friction is steep: there the order shows from 4 steps on only.
    assert (in_counts[1:] < in_counts[:-1]).all()
    assert in_counts[2] < in_counts[1] / 8.0
    # The default of two steps is good to a tenth of what the encoders see.
    assert in_counts[1] < 0.1


# At rest.


@pytest.mark.parametrize("compensation", ["published", "all", "none"])
def test_arm_starts_in_balance_whatever_is_compensated(compensation: str) -> None:
    for command in (ARM.home, None):  # it holds home without any command too
        joints, _ = Bench(gravity_compensation=compensation).trace(command, 500)
        assert (np.abs(joints - ARM.home) <= COUNT).all()


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("sign", [-1, 1])
def test_step_through_the_filter_overshoots_by_less_than_a_count(joint: int, sign: int) -> None:
    bench, goal = Bench(), MIDDLE.copy()
    bench.go_to(MIDDLE)
    goal[joint] += sign * (0.004 if joint == 2 else 0.2)
    joints, _ = bench.trace(goal, 3000)
    beyond = sign * (joints[:, joint] - goal[joint])
    assert beyond.max() <= COUNT[joint]
    assert abs(joints[-1, joint] - goal[joint]) <= COUNT[joint]


def test_compensation_keeps_axis_2_nearer_to_a_moving_setpoint() -> None:
    squares = {}
    for compensation in ("none", "published"):
        # At constant speed and without friction, so that gravity is what has to be followed.
        none = (0.0,) * 6
        bench, square = Bench(gravity_compensation=compensation, viscous=none, coulomb=none), 0.0
        bench.go_to(MIDDLE)
        for k in range(3000):
            bench.tick(MIDDLE + np.array([0, 2e-4 * k, 0, 0, 0, 0]))
            if k > 1000:  # the start is an acceleration
                square += (bench.row["slave_measured_js"][1] - bench.setpoint[1]) ** 2
        squares[compensation] = square
    assert squares["published"] < 0.5 * squares["none"]


# Limits.


def test_command_filter_kicks_no_further_than_a_tick_at_full_speed() -> None:
    bench = Bench(operation=OperationParameters(acceleration_share=1000.0, tool_speed=10.0))
    bench.go_to(MIDDLE)
    before = bench.setpoint
    bench.tick(MIDDLE + 0.05 * DRIVES.speed_limit)
    # A tenth of the step passes the filter at once, cut to what the drive can move.
    step = np.abs(bench.setpoint - before)
    assert np.allclose(step, np.minimum(0.1 * 0.05, 1e-3) * DRIVES.speed_limit, rtol=1e-6, atol=0)


def test_setpoint_that_starts_to_move_kicks_the_drive_no_more_than_its_speed_does() -> None:
    bench = Bench()
    bench.go_to(MIDDLE)
    rest = bench.row["slave_measured_js"][12:].copy()
    gains = bench.slave.simulated.arm.gains.copy()
    speed = np.array([0.05, 0.05, 0.002, 0.05, 0.05, 0.05])
    efforts = []
    for k in range(1, 20):
        bench.tick(MIDDLE + speed * k * 1e-3)
        efforts.append(np.abs(bench.row["slave_measured_js"][12:] - rest))
    # Kd times the measured speed, which is at most the reference's and a count per tick.
    allowed = gains[:, 2] * (speed + 2.0 * COUNT / 1e-3) + gains[:, 0] * speed * 20e-3
    assert (np.array(efforts) <= allowed + DRIVES.coulomb).all()


bounded_joints = st.tuples(*[st.floats(-1.0, 1.0)] * 6).map(np.array)


@given(st.lists(bounded_joints, min_size=1, max_size=10))
@settings(max_examples=20)
def test_drives_and_setpoint_keep_their_limits_under_any_commands(shares: list[Array]) -> None:
    bench, last = Bench(), ARM.home.copy()
    for share in shares:
        command = bench.slave.server.state["command"] + 0.099 * share * DRIVES.speed_limit
        for _ in range(50):
            bench.tick(command)
            setpoint, effort = bench.setpoint, bench.row["slave_measured_js"][12:]
            assert (np.abs(effort) <= DRIVES.effort_limit).all()
            assert (np.abs(setpoint - last) <= DRIVES.speed_limit * 1e-3 + 1e-15).all()
            assert ((setpoint >= ARM.lower) & (setpoint <= ARM.upper)).all()
            # Beyond its rated speed a motor gives nothing after another tenth.
            assert (np.abs(bench.slave.simulated.arm.dq) <= 1.1 * DRIVES.speed_limit).all()
            assert np.isfinite(bench.joints).all()
            last = setpoint


@pytest.mark.parametrize("joint", JOINTS)
def test_long_move_runs_at_the_speed_limit_and_recovers_without_windup(joint: int) -> None:
    bench, goal, fastest = Bench(), MIDDLE.copy(), 0.0
    bench.go_to(MIDDLE)
    target = min(MIDDLE[joint] + 0.5 * DRIVES.speed_limit[joint], ARM.upper[joint] - 1e-3)
    for _ in range(900):
        goal[joint] = min(goal[joint] + 1e-3 * DRIVES.speed_limit[joint], target)
        bench.tick(goal)
        fastest = max(fastest, abs(bench.slave.simulated.arm.dq[joint]))
    joints, _ = bench.trace(goal, 1500)
    assert fastest <= 1.1 * DRIVES.speed_limit[joint]
    assert np.abs(joints[:, joint]).max() <= target + COUNT[joint]
    assert abs(joints[-1, joint] - target) <= COUNT[joint]


def test_integral_stays_bounded_while_an_overload_holds_the_arm_back() -> None:
    # A friction far above the rated torque, as of an arm that is caught: the setpoint goes, it cannot.
    told = OperationParameters(reported=("tracking", "tip", "effort"))
    bench = Bench(operation=told)
    bench.slave.simulated.parameters["coulomb"][0] = 20.0
    goal = ARM.home + np.array([0.2, 0, 0, 0, 0, 0])
    bench.trace(goal, 5000)
    integral = abs(bench.slave.simulated.arm.memory[0, 0])
    assert integral <= DRIVES.effort_limit[0]
    bench.slave.simulated.parameters["coulomb"][0] = DRIVES.coulomb[0]
    joints, _ = bench.trace(goal, 2000)
    assert abs(joints[-1, 0] - goal[0]) <= COUNT[0]
    # An eighth of the way at most: a tenth of a second of full torque before it brakes.
    assert joints[:, 0].max() <= goal[0] + 0.25 * 0.2


def test_an_effort_that_was_a_fault_is_none_any_more_after_a_reset() -> None:
    others = OperationParameters(reported=("tracking", "tip", "overspeed"))
    bench = Bench(operation=others)
    bench.slave.simulated.parameters["coulomb"][0] = 20.0  # as of an arm that is caught
    goal = ARM.home + np.array([0.2, 0, 0, 0, 0, 0])
    bench.trace(goal, 5000)
    assert bench.slave.server.operation["fault"] == Fault.EFFORT
    assert bench.slave.server.state["full_ns"].max() == 0
    bench.slave.simulated.parameters["coulomb"][0] = DRIVES.coulomb[0]
    for command in ("reset", "enable"):
        answer, text = bench.slave.server.request(command)
        assert answer is Answer.DONE, text
    for _ in range(500):
        bench.tick(goal)
    assert bench.slave.server.operation["state"] == State.ENABLED


# Encoders.


def test_readings_are_whole_counts_within_half_a_count_of_the_joints() -> None:
    bench = Bench()
    for k in range(300):
        before = bench.joints
        bench.tick(ARM.home - 1e-3 * k * 0.5 * DRIVES.speed_limit)
        counts = bench.row["slave_measured_js"][:6] / COUNT
        # Up to 5e6 counts, known to 1e-9 of one.
        assert np.abs(counts - np.round(counts)).max() < 1e-8
        off = np.abs(bench.row["slave_measured_js"][:6] - before)
        assert (off <= 0.5 * COUNT * (1 + 1e-9)).all()


def test_poses_are_those_of_setpoint_and_readings() -> None:
    bench = Bench()
    bench.go_to(MIDDLE)
    row = bench.row
    read, read_ns = row["slave_measured_js"][:6].copy(), int(row["slave_measured_js_ns"])
    bench.tick(MIDDLE)
    for joints, pose in ((bench.setpoint, row["slave_setpoint_cp"]), (read, row["slave_measured_cp"])):
        assert np.allclose(ARM.fk(joints)[:3, 3], pose[:3], rtol=0, atol=1e-15)
    assert row["now_ns"] - read_ns == TICK_NS


def test_measured_speed_is_that_of_the_encoders_through_a_low_pass_of_5_ms() -> None:
    rows, rest = wander(Bench()), np.round(ARM.home / COUNT) * COUNT
    rate = np.diff(rows["slave_measured_js"][:, :6], axis=0, prepend=rest[np.newaxis]) / DT
    share = DT / (DT + 5e-3)
    expected = lfilter([share], [1.0, share - 1.0], rate, axis=0)
    # Speeds of a count per tick, summed over the filter's memory.
    assert np.abs(rows["slave_measured_js"][:, 6:12] - expected).max() < 1e-12
    assert np.abs(expected).max() > 1e-3


# Commands.


def test_command_is_fresh_until_the_timeout_and_stale_after_it() -> None:
    bench = Bench()
    assert bench.tick(ARM.home) is commands.CommandStatus.FRESH
    statuses = [bench.tick() for _ in range(TIMEOUT_TICKS + 1)]
    assert statuses == [commands.CommandStatus.FRESH] * TIMEOUT_TICKS + [commands.CommandStatus.STALE]


def test_lone_command_is_reached_and_held() -> None:
    bench = Bench(operation=OperationParameters(longest_outage=0.0))
    bench.go_to(MIDDLE)
    for _ in range(TIMEOUT_TICKS + 1):
        bench.tick()
    goal = MIDDLE + 0.01 * DRIVES.speed_limit
    bench.tick(goal)
    for _ in range(3000):
        status = bench.tick()
    assert status is commands.CommandStatus.STALE
    assert np.allclose(bench.setpoint, goal, rtol=0, atol=1e-12)
    assert (np.abs(bench.joints - goal) <= COUNT).all()


@pytest.mark.parametrize("joint", JOINTS)
def test_jump_is_refused_counted_and_not_followed(joint: int) -> None:
    bench, calm = Bench(), Bench()
    bench.go_to(MIDDLE)
    calm.go_to(MIDDLE)
    jump = MIDDLE.copy()
    jump[joint] += 0.1001 * DRIVES.speed_limit[joint]
    assert bench.tick(jump) is commands.CommandStatus.REFUSED
    assert bench.slave.server.refused == 1
    calm.tick()
    assert np.array_equal(bench.setpoint, calm.setpoint)
    assert np.array_equal(bench.joints, calm.joints)
    assert calm.tick(MIDDLE + 0.0999 * DRIVES.speed_limit) is commands.CommandStatus.FRESH


def test_slave_resumes_when_the_command_comes_back_near() -> None:
    bench = Bench()
    bench.go_to(MIDDLE)
    for _ in range(300):
        bench.tick(MIDDLE + 0.5 * DRIVES.speed_limit)
    near = MIDDLE + 0.01 * DRIVES.speed_limit
    assert bench.tick(near) is commands.CommandStatus.FRESH
    bench.trace(near, 2000)
    assert (np.abs(bench.joints - near) <= COUNT).all()


def test_refused_commands_do_not_count_as_fresh_ones() -> None:
    bench = Bench()
    bench.tick(ARM.home)
    far = ARM.home - 0.5 * DRIVES.speed_limit
    statuses = {bench.tick(far) for _ in range(TIMEOUT_TICKS + 10)}
    assert statuses == {commands.CommandStatus.REFUSED}
    assert bench.tick() is commands.CommandStatus.STALE


@pytest.mark.parametrize(("joint", "bad"), [(0, math.nan), (2, math.inf), (4, -math.inf), (5, 1e300)])
def test_command_that_is_no_number_is_refused_and_harms_nothing(joint: int, bad: float) -> None:
    bench = Bench()
    bench.tick(ARM.home)
    command = ARM.home.copy()
    command[joint] = bad
    assert bench.tick(command) is commands.CommandStatus.REFUSED
    assert bench.slave.server.refused == 1
    joints, efforts = bench.trace(ARM.home, 200)
    assert (np.abs(joints - ARM.home) <= COUNT).all()
    assert np.isfinite(efforts).all()


def test_old_stamps_are_not_taken_again() -> None:
    bench = Bench()
    bench.go_to(MIDDLE)
    bench.tick(MIDDLE + 0.05 * DRIVES.speed_limit, stamp_ns=bench.now_ns - 10 * TICK_NS)
    assert np.array_equal(bench.slave.server.state["command"], MIDDLE)


def test_stamps_from_the_future_and_of_a_clock_that_was_ahead_do_not_shut_out_those_after_them() -> None:
    """Messages that go back come here only after a silence, or from who starts anew."""
    bench, later_ns = Bench(), 3600 * 10**9
    bench.go_to(MIDDLE)
    bench.tick(MIDDLE, stamp_ns=bench.now_ns + later_ns)
    state = bench.slave.server.state
    assert bench.slave.server.refused == 1
    for share in (0.05, -0.05):
        goal = MIDDLE + share * DRIVES.speed_limit
        bench.tick(goal)
        assert np.array_equal(state["target"], goal)
        state["seen_ns"] = bench.now_ns + later_ns


def test_command_outside_the_limits_is_followed_up_to_them() -> None:
    bench = Bench()
    bench.tick(ARM.home + np.array([0, 0, 1e-3, 0, 0, 0]))
    assert bench.slave.server.state["command"][2] == ARM.upper[2]


def test_stamp_of_the_command_in_force_is_passed_on() -> None:
    bench = Bench()
    bench.tick(ARM.home, stamp_ns=1234)
    assert bench.row["slave_setpoint_js_ns"] == 1234
    bench.tick(ARM.home + DRIVES.speed_limit, stamp_ns=5678)
    assert bench.row["slave_setpoint_js_ns"] == 1234


# Repeating and retuning.


def wander(bench: Bench) -> NDArray[np.void]:
    ticks = np.arange(800)[:, None]
    swing = np.sin(1e-3 * ticks * np.array([2, 3, 1, 5, 4, 6]))
    return bench.along(ARM.home - 0.02 * DRIVES.speed_limit * (1.0 + swing) * np.minimum(1.0, ticks / 400))


def test_the_same_commands_and_a_reset_repeat_the_motion_to_the_bit() -> None:
    bench = Bench()
    first = wander(bench)
    assert np.array_equal(first, wander(Bench()))
    bench.slave.reset()
    bench.now_ns = 0
    bench.row["slave_servo_jp_ns"] = 0
    second = wander(bench)
    for name in ("slave_setpoint_js", "slave_measured_js", "slave_measured_cp"):
        assert np.array_equal(first[name], second[name]), name


@pytest.mark.parametrize(
    "values",
    [
        {"gravity_compensation": "none"},
        {"gravity_compensation": "all"},
        {"viscous": tuple(2.0 * DRIVES.viscous)},
        {"controller": pid(bandwidth=tuple((0.8 * DRIVES.bandwidth).tolist()))},
        {"reference_filter": ReferenceFilterParameters(is_on=False)},
        {"integration_steps": 8},
    ],
)
def test_retuning_at_rest_moves_the_arm_by_a_few_counts_at_most(values: Mapping[str, Any]) -> None:
    bench = Bench()
    bench.go_to(MIDDLE)
    bench.slave.retune(pair.ArmParameters(**values))
    joints, _ = bench.trace(MIDDLE, 1000)
    # Friction and gravity stay held by what holds them; sixteen counts are 0.1 mm at the tip.
    assert (np.abs(joints - MIDDLE) <= 16 * COUNT).all()


@pytest.mark.parametrize("bandwidth", [(10.0,) * 6, tuple((0.5 * DRIVES.bandwidth).tolist())])
def test_gains_that_change_in_motion_make_no_step_of_effort(bandwidth: tuple[float, ...]) -> None:
    bench = Bench(start=tuple(MIDDLE.tolist()))
    bench.go_to(MIDDLE)
    way = np.array([0.05, 0.05, 0.01, 0.05, 0.05, 0.05])

    def moved(count: int) -> Array:
        """Efforts (count, n) while all joints swing, which they begin where they are fastest."""
        efforts = []
        for _ in range(count):
            bench.tick(MIDDLE + way * np.sin(np.pi * 1e-9 * (bench.now_ns - begin_ns)))
            efforts.append(bench.slave.simulated.arm.effort.copy())
        return np.array(efforts)

    begin_ns = bench.now_ns
    before = moved(4000)[-40:]
    damping = bench.slave.simulated.arm.gains[:, 2].copy()
    bench.slave.retune(pair.ArmParameters(start=tuple(MIDDLE.tolist()), controller=pid(bandwidth=bandwidth)))
    step = np.abs(moved(3) - before.mean(axis=0)).max(axis=0)
    # What the integrators held against the derivatives; steps of encoders are in the rest.
    assert (step < 0.12 * damping * np.pi * way).all()


@pytest.mark.parametrize("law", CONTROLLERS.names())
def test_gains_that_change_before_the_first_tick_count_from_the_begin(law: str) -> None:
    soft = {"start": AT_HOME, "controller.kind": law}
    soft |= {f"controller.{law}.bandwidth": tuple((0.5 * DRIVES.bandwidth).tolist())}
    changed = pair.SimulatedArm(build(pair.ArmParameters, soft | {f"controller.{law}.bandwidth": ()}))
    changed.retune(build(pair.ArmParameters, soft))
    made = pair.SimulatedArm(build(pair.ArmParameters, soft))
    for k in range(200):
        for slave in (changed, made):
            slave.signals["now_ns"] = slave.signals["slave_servo_jp_ns"] = (k + 1) * TICK_NS
            slave.signals["slave_servo_jp"] = slave.robot.home - 1e-5 * k
            slave.step()
    assert changed.signals["slave_measured_js"].tolist() == made.signals["slave_measured_js"].tolist()


def test_refused_retuning_changes_nothing() -> None:
    bench: Any = Bench()
    before, gains = bench.slave.simulated.parameters.copy(), bench.slave.simulated.arm.gains.copy()
    wrong = pair.ArmParameters(viscous=(1.0,) * 6, controller=pid(kp=(1.0,) * 5))
    with pytest.raises(ParameterError):
        bench.slave.retune(wrong)
    assert bench.slave.simulated.parameters == before
    assert np.array_equal(bench.slave.simulated.arm.gains, gains)


def test_a_sample_is_answered_between_ticks_as_a_tick_answers_it_to_the_bit() -> None:
    bench = Bench()
    for _ in range(3):
        bench.tick(MIDDLE)
    server = bench.slave.server
    row = server.signals
    row["slave_measured_js"][:6], row["slave_measured_js_ns"] = MIDDLE, 10**10
    server.step()
    stepped = row["slave_measured_cp"].tobytes()
    row["slave_measured_cp"] = 0.0
    server.answer_measured()
    assert row["slave_measured_cp"].tobytes() == stepped
