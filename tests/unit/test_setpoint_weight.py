"""Setpoint weight of the PID: no step overshoots, on any axis, of any size, saturated or not."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.signal import lsim

from present import present
from teleop_core.base import build
from teleop_core.graph import DT, TICK_NS
from teleop_core.kernels import Array, kernel
from teleop_core.robots import load_robot
from teleop_core.robots.robot import Robot
from teleop_core.slave import pair, slave_sim
from teleop_core.slave.controllers.pid import PID, THIRD, PidParameters, pid_control, pid_step
from teleop_core.slave.parameters import ReferenceFilterParameters

ROBOTS = {name: load_robot(name) for name in ("rcrt1", "scara", "puma560", "stewart", "rps3")}
AXES = [("rcrt1", 0), ("rcrt1", 2), ("rcrt1", 5), ("scara", 2), ("puma560", 1), ("stewart", 0), ("rps3", 0)]
# The tick and the rate filter delay by 2 ms, which splits the triple pole a little.
SAMPLED = 1.5e-3


class Axis:
    """One axis of a drive table under its PID: exact between ticks, with limit and encoder."""

    def __init__(
        self, robot: Robot, axis: int, weight: float, *, is_limited: bool = True, is_rounded: bool = True
    ) -> None:
        drives = present(robot.drives)
        self.gains = PID.gains(PidParameters(setpoint_weight=weight), robot, drives.viscous)[[axis]]
        inertia, viscous = drives.inertia[axis], drives.viscous[axis]
        self.step = expm(DT * np.array([[0, 1, 0], [0, -viscous / inertia, 1 / inertia], [0] * 3]))
        self.limit = np.array([drives.effort_limit[axis] if is_limited else 1e300])
        self.count = drives.encoder_step[axis] if is_rounded else 0.0

    def answer(self, goal: float, ticks: int) -> Array:
        """Positions (ticks,) after a step of the setpoint from rest at 0."""
        trace = np.empty(ticks)
        answer(self.gains, self.step, self.limit, self.count, goal, trace)
        return trace


@kernel
def answer(gains: Any, step: Array, limit: Array, count: float, goal: float, trace: Array) -> None:
    """Write positions of one axis under the law, tick by tick; a count of 0 rounds nothing."""
    memory, effort, setpoint = np.zeros((1, 4)), np.zeros(1), np.full(1, goal)
    seen, zero, q, dq = np.zeros(1), np.zeros(1), 0.0, 0.0
    for k in range(trace.shape[0]):
        seen[0] = round(q / count) * count if count > 0.0 else q
        pid_control(gains, memory, setpoint, seen, zero, limit, DT, effort)
        ahead = step[0, 0] * q + step[0, 1] * dq + step[0, 2] * effort[0]
        dq = step[1, 0] * q + step[1, 1] * dq + step[1, 2] * effort[0]
        q = ahead
        trace[k] = q


@pytest.mark.parametrize(("name", "axis"), AXES)
def test_step_of_any_size_never_passes_its_goal(name: str, axis: int) -> None:
    robot = ROBOTS[name]
    count, whole = present(robot.drives).encoder_step[axis], robot.upper[axis] - robot.lower[axis]
    for size in (count, 10 * count, 1e3 * count, 0.01 * whole, 0.1 * whole, whole):
        for sign in (-1.0, 1.0):
            ends = sign * Axis(robot, axis, THIRD).answer(sign * size, 800)
            assert ends.max() <= size + max(count, SAMPLED * size)


@pytest.mark.parametrize(("name", "axis"), AXES)
def test_saturated_step_arrives_too(name: str, axis: int) -> None:
    robot = ROBOTS[name]
    whole = robot.upper[axis] - robot.lower[axis]
    trace = Axis(robot, axis, THIRD).answer(whole, 8000)
    assert abs(trace[-1] - whole) <= present(robot.drives).encoder_step[axis]
    largest_gain = Axis(robot, axis, THIRD).gains[0, 0] * THIRD
    assert largest_gain * whole > present(robot.drives).effort_limit[axis]  # it was saturated


@pytest.mark.parametrize(("name", "axis"), AXES)
def test_whole_setpoint_overshoots_by_a_fifth_as_its_zero_says(name: str, axis: int) -> None:
    free = {"is_limited": False, "is_rounded": False}
    whole, third = (Axis(ROBOTS[name], axis, b, **free).answer(1.0, 500) for b in (1.0, THIRD))
    assert 0.10 < whole.max() - 1.0 < 0.27
    assert third.max() - 1.0 < SAMPLED


@pytest.mark.parametrize(("name", "axis"), AXES)
def test_answer_with_a_third_is_that_of_two_poles(name: str, axis: int) -> None:
    robot = ROBOTS[name]
    pole = present(robot.drives).bandwidth[axis]
    found = Axis(robot, axis, THIRD, is_limited=False, is_rounded=False).answer(1.0, 300)
    times = np.arange(0, 301) * DT
    _, wanted, _ = lsim(([pole**2], [1.0, 2.0 * pole, pole**2]), np.ones(301), times)
    # Between one and three ticks late: hold, rate filter and the integral at the end of its tick.
    off = np.abs(found - wanted[1:])
    assert off.max() <= 3.0 * DT * pole / math.e


@settings(max_examples=50)
@given(st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=40), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_effort_is_that_of_the_textbook_s_weighted_law(setpoints: list[float], weight: float, place: float) -> None:
    kp, ki, kd = 50.0, 400.0, 2.0
    gains, memory, effort = np.array([[kp, ki, kd, weight]]), np.zeros((1, 4)), np.zeros(1)
    total, one = 0.0, np.ones(1)
    memory[0, 1] = place  # at rest there, with the setpoint at 0 so far
    for r in setpoints:
        pid_control(gains, memory, r * one, place * one, 0.0 * one, 1e9 * one, DT, effort)
        total += ki * (r - place) * DT
        # What the lag remembers of the time before, when the setpoint was 0.
        wanted = kp * (weight * r - place) + total
        assert math.isclose(effort[0], wanted, rel_tol=1e-9, abs_tol=1e-9)


@given(
    st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), min_size=1, max_size=60), st.sampled_from(range(6))
)
def test_whole_setpoint_is_the_law_without_weights_to_the_bit(pairs: list[tuple[float, float]], axis: int) -> None:
    robot = ROBOTS["rcrt1"]
    gains = PID.gains(PidParameters(), robot, present(robot.drives).viscous)[[axis]].copy()
    limit, memory, plain = present(robot.drives).effort_limit[[axis]], np.zeros((1, 4)), np.zeros(3)
    effort = np.empty(1)
    for setpoint, measured in pairs:
        pid_control(gains, memory, np.array([setpoint]), np.array([measured]), np.zeros(1), limit, DT, effort)
        same = pid_step(setpoint, measured, gains[0, :3].copy(), plain, 0.0, limit[0], DT)
        assert effort[0] == same
    assert np.array_equal(memory[0, :3], plain)


def test_without_integral_action_the_weight_leaves_the_law_as_it_is() -> None:
    efforts = []
    for weight in (1.0, THIRD):
        gains, memory, effort = np.array([[50.0, 0.0, 2.0, weight]]), np.zeros((1, 4)), np.zeros(1)
        a, b, c, d = np.array([[0.3], [0.1], [0.2], [9.0]])
        pid_control(gains, memory, a, b, c, d, DT, effort)
        efforts.append(effort[0])
    assert efforts[0] == efforts[1]


def slave_step_trace(name: Any, axis: Any, size: Any) -> Array:
    """Ways (ticks,) of an axis of the ideal plant after a step, with the reference filter off."""
    robot = ROBOTS[name]
    start = robot.home.copy()
    start[axis] = min(start[axis], robot.upper[axis] - size)
    slave = pair.SimulatedArm(
        pair.ArmParameters(
            robot=name,
            starts_at_home=True,
            gravity_compensation="all",
            interpolation="none",
            controller=build(slave_sim.ControllerParameters, {"kind": "pid", "pid.setpoint_weight": THIRD}),
            reference_filter=ReferenceFilterParameters(is_on=False),
        )
    )
    slave.simulated.arm.q[:] = start
    slave.simulated.state["measured"] = start
    for field in ("command", "filtered", "setpoint", "target"):
        slave.server.state[field] = start
    slave.signals["slave_measured_js"][: robot.n] = start
    slave.simulated.arm.memory[:] = 0.0
    PID.begin(slave.simulated.arm.memory, start, np.zeros(robot.n))
    row, reach = slave.signals, 0.099 * present(robot.drives).speed_limit[axis]
    ticks = int(800 + 1100 * size / present(robot.drives).speed_limit[axis])
    goal, trace = start.copy(), np.empty(ticks)
    for k in range(ticks):
        # As far as a command may be from the one before.
        goal[axis] = min(goal[axis] + reach, start[axis] + size)
        row["now_ns"] += TICK_NS
        row["slave_servo_jp"], row["slave_servo_jp_ns"] = goal, row["now_ns"]
        slave.step()
        assert row["command_status"] == 0
        trace[k] = slave.simulated.arm.q[axis] - start[axis]
    return trace


@pytest.mark.slow
@pytest.mark.parametrize(("name", "axis"), [(n, a) for n, a in AXES if n != "rps3" and a < 3])
def test_slave_passes_its_goal_by_no_more_than_what_dry_friction_leaves(name: Any, axis: Any) -> None:
    robot = ROBOTS[name]
    drives = present(robot.drives)
    count, whole = drives.encoder_step[axis], 0.9 * (robot.upper[axis] - robot.lower[axis])
    spring = 3.0 * drives.bandwidth[axis] ** 2 * drives.inertia[axis]
    for size in (count, 100 * count, 0.05 * whole, whole):
        over = slave_step_trace(name, axis, size).max() - size
        # Twice, for the inertia elsewhere is not that at home, on which the gains rest.
        assert over <= 2.0 * (count + drives.coulomb[axis] / spring)
