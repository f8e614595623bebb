"""Control laws beside PID and PD: they reach, rest, learn, know the model, and do not wind up."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from led_slave import LedSlave
from present import present
from teleop_core.base import build
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.robots.robot import Robot
from teleop_core.slave import pair, slave_sim
from teleop_core.slave.controllers import CONTROLLERS, Controller, adaptive, register_controller
from teleop_core.slave.controllers.computed_torque import COMPUTED_TORQUE
from teleop_core.slave.controllers.motion_estimates import known_friction
from teleop_core.slave.parameters import ReferenceFilterParameters
from teleop_lab.experiments.joint_steps import answer_to_steps

LAWS = ("friction_compensation", "computed_torque", "adaptive", "disturbance_observer")
ARM = load_robot("rcrt1")
COUNT = present(ARM.drives).encoder_step
STEADY = {"hardware.without": ("wandering",)}
UNFILTERED = ReferenceFilterParameters(is_on=False)


def slave(
    law: str,
    plant: str = "hardware",
    faults: Any = None,
    own: Mapping[str, float | tuple[float, ...]] | None = None,
    robot: str = "rcrt1",
    **values: Any,
) -> pair.SimulatedArm:
    """A slave at home under a law with parameters ``own``, on a plant with ``faults``."""
    return pair.SimulatedArm(
        pair.ArmParameters(
            robot=robot,
            starts_at_home=True,
            controller=build(slave_sim.ControllerParameters, {"kind": law, **(own or {})}),
            plant=build(slave_sim.PlantParameters, {"kind": plant, **(faults or {})}),
            **values,
        )
    )


def run(arm: pair.SimulatedArm, way: Array) -> Array:
    """Setpoints, measured joints and efforts (N, n) along commands (N, n), one a tick."""
    rows = LedSlave(arm).along(way)
    return np.array((rows["slave_setpoint_js"], *np.split(rows["slave_measured_js"], 3, axis=1)))[[0, 1, 3]]


def smooth(start: Array, goal: Array, ticks: int, rest: int) -> Array:
    """Minimum-jerk way from start to goal, and a rest there."""
    s = np.linspace(0.0, 1.0, ticks)[:, None]
    way = start + (goal - start) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return np.concatenate((way, np.tile(goal, (rest, 1))))


def inside(robot: Robot, share: float, rng: np.random.Generator) -> Array:
    """A goal some way from home, inside the limits."""
    span = share * (robot.upper - robot.lower)
    return np.clip(robot.home + rng.uniform(-span, span), robot.lower, robot.upper)


# Rest.


@pytest.mark.parametrize("law", LAWS)
def test_arm_that_sticks_comes_to_rest_at_the_nearest_count_and_stays(law: str) -> None:
    rng = np.random.default_rng(7)
    for _ in range(3):
        goal = inside(ARM, 0.04, rng)
        arm = slave(law, faults=STEADY)
        setpoint, measured, _ = run(arm, smooth(ARM.home, goal, 1500, 9000))
        last = measured[-2000:]
        assert (np.ptp(last, axis=0) < 0.5 * COUNT).all()  # no limit cycle: no count changes
        # A count beyond the nearest one, for what friction holds while the integral creeps.
        assert (np.abs(last[-1] - setpoint[-1]) <= 1.6 * COUNT).all()


@pytest.mark.parametrize("law", LAWS)
def test_step_without_a_filter_overshoots_by_no_more_than_a_twentieth_on_the_hardware(law: str) -> None:
    parameters = pair.ArmParameters(
        starts_at_home=True,
        interpolation="none",
        reference_filter=UNFILTERED,
        controller=build(slave_sim.ControllerParameters, {"kind": law}),
        plant=build(slave_sim.PlantParameters, {"kind": "hardware"}),
    )
    answer = answer_to_steps(parameters)
    assert (answer.overshoot <= 0.05).all()
    assert answer.rest_error <= 34e-6


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["stewart", "three_finger_hand"])
def test_law_brings_every_kind_of_robot_to_its_goal(law: str, name: str) -> None:
    robot = load_robot(name)
    goal = inside(robot, 0.01, np.random.default_rng(3))
    setpoint, measured, efforts = run(slave(law, robot=name), smooth(robot.home, goal, 800, 1500))
    off = np.abs(measured[-500:] - setpoint[-500:]).max(axis=0)
    assert (off <= 3.0 * present(robot.drives).encoder_step).all()
    assert (np.abs(efforts) <= present(robot.drives).effort_limit).all()


# Tracking.


def circling(ticks: int, speed: float = 1.0) -> Array:
    """Joints that all move at once, smoothly from rest, a few times to and fro."""
    t = 1e-3 * np.arange(ticks)[:, None]
    size = np.array([0.25, 0.2, 0.008, 0.4, 0.3, 0.3])
    rate = speed * np.array([2.1, 1.7, 2.3, 2.9, 3.1, 2.5])
    toward = np.array([1.0, -1.0, 1.0, 1.0, 1.0, 1.0])
    toward = np.where(ARM.home >= ARM.upper, -1.0, np.where(ARM.home <= ARM.lower, 1.0, toward))
    begin = np.minimum(t, 1.0) ** 2 * (3.0 - 2.0 * np.minimum(t, 1.0))
    return ARM.home + begin * toward * size * 0.5 * (1.0 - np.cos(rate * t))


def tracking_error(arm: pair.SimulatedArm, way: Any = None, **_: object) -> Array:
    """Root mean square of the error of each joint (n,) [counts], after the first second."""
    setpoint, measured, _ = run(arm, circling(5000) if way is None else way)
    return np.sqrt(np.mean(((measured - setpoint)[1000:] / COUNT) ** 2, axis=0))


@pytest.mark.parametrize("law", LAWS)
def test_every_law_tracks_the_joints_that_stick_better_than_pid(law: str) -> None:
    better, before = (tracking_error(slave(kind)) for kind in (law, "pid"))
    # Axes 1 to 3 carry the tip; the wrist's filters are as slow as its encoders are coarse.
    assert (better[:3] < 0.5 * before[:3]).all()


FRICTIONLESS: dict[str, Any] = {"plant": "ideal", "coulomb": (0.0,) * 6}


def test_true_model_leaves_nothing_to_correct_where_there_is_no_dry_friction() -> None:
    by_model = tracking_error(slave("computed_torque", **FRICTIONLESS))
    by_joint = tracking_error(
        slave("friction_compensation", own={"friction_compensation.friction_share": 0.0}, **FRICTIONLESS)
    )
    # Rounding of the encoders is 0.3 counts; efforts are held for a tick.
    assert (by_model[:3] < 1.5).all()
    assert by_joint[2] > 2.0 * by_model[2]  # whose gravity changes as axis 2 turns


def test_friction_that_is_fed_forward_is_most_of_the_error_that_friction_makes() -> None:
    name = "friction_compensation.friction_share"
    without, with_it = (
        tracking_error(slave("friction_compensation", faults=STEADY, own={name: share})) for share in (0.0, 0.8)
    )
    assert (with_it[:2] < 0.6 * without[:2]).all()


def test_observer_takes_the_weight_that_the_model_lacks_off_the_rest() -> None:
    # A static moment of 0.0135 kg·m that no law knows: 0.13 N·m at most on axis 2.
    faults = {"hardware.without": ("wandering", "sticking")}
    level = ARM.home.copy()
    level[1] = 0.5 * math.pi
    arm = slave("disturbance_observer", faults=faults)
    setpoint, measured, _ = run(arm, smooth(ARM.home, level, 3000, 3000))
    assert abs(measured[-1, 1] - setpoint[-1, 1]) <= 1.1 * COUNT[1]


# Adaptive.


def test_adaptive_law_learns_the_friction_there_is() -> None:
    arm = slave("adaptive", faults=STEADY, own={"adaptive.friction_share": 0.4})
    run(arm, circling(12000))
    known = 0.4 * known_friction(ARM)
    learned = known + arm.simulated.arm.memory[:, adaptive._MORE_FRICTION]
    # Bounded at twice what it began with; the amplifier's bias and the weight are load instead.
    assert np.allclose(learned[:2], np.minimum(known_friction(ARM), 2.0 * known)[:2], rtol=0.25)


def test_adaptive_law_stays_within_its_bounds_whatever_it_is_asked_for() -> None:
    rng = np.random.default_rng(11)
    arm = slave("adaptive", own={"adaptive.rate": 7.0}, reference_filter=UNFILTERED)
    reach = 0.05 * present(ARM.drives).speed_limit
    way = np.clip(ARM.home + np.cumsum(rng.uniform(-reach, reach, (3000, 6)), axis=0) * 0.2, ARM.lower, ARM.upper)
    _, _, efforts = run(arm, way)
    memory, drives = arm.simulated.arm.memory, ARM.drives
    assert np.isfinite(efforts).all()
    assert (np.abs(memory[:, adaptive._MORE_INERTIA]) <= 0.5 * present(drives).inertia).all()
    assert (np.abs(memory[:, adaptive._MORE_VISCOUS]) <= present(drives).viscous).all()
    assert (np.abs(memory[:, adaptive._MORE_FRICTION]) <= 0.8 * known_friction(ARM) * (1 + 1e-12)).all()
    assert (np.abs(memory[:, adaptive._LOAD]) <= present(drives).effort_limit).all()


# Saturation.


@pytest.mark.parametrize("law", ["friction_compensation", "computed_torque", "adaptive"])
def test_blocked_joint_winds_nothing_up(law: str) -> None:
    part = CONTROLLERS.find(law)
    gains = part.gains(part.parameters(), ARM, present(ARM.drives).viscous)
    memory, effort, limit = (np.zeros((6, part.memory)), np.empty(6), present(ARM.drives).effort_limit.copy())
    feedforward = np.zeros(part.feedforward(6))
    if part.uses_model:
        feedforward[12:] = np.diag(present(ARM.drives).inertia).ravel()
    far, zero = 0.2 * np.ones(6), np.zeros(6)
    table = np.array(gains, order="C")
    for _ in range(5000):
        part.control(table, memory, far, zero, feedforward, limit, 1e-3, effort)
    assert (effort > 0.5 * limit).all()
    before = memory.copy()
    for _ in range(5000):
        part.control(table, memory, far, zero, feedforward, limit, 1e-3, effort)
    kept = {"friction_compensation": [9], "computed_torque": [9], "adaptive": [9, 10, 11, 12]}[law]
    assert np.array_equal(memory[:, kept], before[:, kept])


# The model as an argument.


def test_law_gets_the_model_that_is_known_behind_the_gravity_that_is_compensated(own_parts: None) -> None:
    seen = []

    def control(*arrays: Any) -> None:
        feedforward, effort = arrays[4], arrays[-1]
        seen.append(np.array(feedforward))
        effort[:] = 0.0

    register_controller(
        Controller("looking", COMPUTED_TORQUE.parameters, COMPUTED_TORQUE.gains, control, uses_model=True)
    )
    arm = slave("looking", gravity_compensation="all", trials="small")
    arm.step()
    found = next(one for one in reversed(seen) if len(one) == 48)
    gravity = np.empty(6)
    at = np.array(arm.simulated.state["measured"])
    present(ARM.dynamics).gravity(at, present(ARM.dynamics).parameters.copy(), gravity)
    assert np.array_equal(found[:6], gravity)
    assert np.allclose(found[6:12], gravity, rtol=0, atol=1e-9)  # at rest: bias is gravity
    ddq = np.empty(6)
    present(ARM.dynamics).acceleration(
        at,
        np.zeros(6),
        found[12:].reshape(6, 6) @ np.ones(6) + found[6:12],
        present(ARM.dynamics).parameters.copy(),
        ddq,
    )
    assert np.allclose(ddq, 1.0, rtol=1e-9, atol=0)


def test_law_that_does_not_ask_for_the_model_gets_gravity_alone(own_parts: None) -> None:
    lengths = []

    def control(*arrays: Any) -> None:
        feedforward, effort = arrays[4], arrays[-1]
        lengths.append(len(feedforward) - len(effort))
        effort[:] = 0.0

    register_controller(Controller("short", COMPUTED_TORQUE.parameters, COMPUTED_TORQUE.gains, control))
    slave("short", trials="small").step()
    assert set(lengths) == {0}
