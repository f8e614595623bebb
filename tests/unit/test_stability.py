"""Stability: gains that let errors grow at the control rate are refused before they are taken."""

from dataclasses import replace

import numpy as np
import pytest

from teleop_core.base.errors import ParameterError
from teleop_core.base.parameters import build
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array
from teleop_core.robots import ROBOTS, load_robot
from teleop_core.slave.controllers import CONTROLLERS, register_controller
from teleop_core.slave.controllers.source_pid import SOURCE_PID
from teleop_core.slave.pair import ArmParameters, SimulatedArm
from teleop_core.slave.plants import PLANTS


def slave(**values):
    named = {name.replace("__", "."): value for name, value in values.items()}
    return SimulatedArm(build(ArmParameters, {"robot": "rcrt1", "starts_at_home": True} | named))


@pytest.mark.parametrize(
    "values",
    [
        {"viscous": (1000.0,) * 6},
        {"controller__pid__bandwidth": (300.0,) * 6},
        {"controller__pid__bandwidth": (60.0, 60.0, 60.0, 500.0, 80.0, 80.0)},
    ],
    ids=["stiff friction", "too fast", "one joint too fast"],
)
def test_loops_in_which_an_error_grows_are_refused(values):
    with pytest.raises(ParameterError, match="stable at 1000 Hz"):
        slave(**values)


def test_the_joint_that_runs_away_is_named():
    with pytest.raises(ParameterError, match="joint 4"):
        slave(controller__pid__bandwidth=(60.0, 60.0, 60.0, 500.0, 80.0, 80.0))


def test_friction_that_is_stiff_for_the_steps_is_one_that_the_drive_cannot_follow_with_more():
    stiff = (0.0, 0.0, 0.0, 5.0, 0.0, 0.0)
    with pytest.raises(ParameterError, match="stable at 1000 Hz"):
        slave(viscous=stiff, integration_steps=1)
    with pytest.raises(ParameterError, match=r"comes back.*joint 4"):
        slave(viscous=stiff, integration_steps=50)


def test_refused_gains_leave_the_slave_as_it_was():
    one, other = slave(), slave()
    bad = build(ArmParameters, {
        "robot": "rcrt1", "starts_at_home": True, "controller.pid.bandwidth": (500.0,) * 6
    })  # fmt: skip
    good = build(ArmParameters, {"robot": "rcrt1", "starts_at_home": True})
    with pytest.raises(ParameterError):
        one.retune(bad)
    assert one.simulated.parameters["steps"] == other.simulated.parameters["steps"]
    one.retune(good)
    for k in range(500):
        for arm in (one, other):
            row = arm.signals
            row["now_ns"] = row["slave_servo_jp_ns"] = 10**9 + k * 10**6
            row["slave_servo_jp"] = arm.robot.home + 1e-4 * k
            arm.step()
    assert np.array_equal(one.signals["slave_measured_js"], other.signals["slave_measured_js"])


def unbounded_integral():
    """The source's law as it is printed: nothing bounds its integral."""

    @kernel
    def control(
        gains: Array, memory: Array, setpoint: Array, measured: Array, feedforward: Array,
        limit: Array, dt: float, effort: Array,
    ) -> None:  # fmt: skip
        for i in range(effort.shape[0]):
            error = setpoint[i] - measured[i]
            memory[i, 0] += gains[i, 1] * dt * error
            change = (error - memory[i, 1]) / dt
            memory[i, 1] = error
            effort[i] = gains[i, 0] * error + memory[i, 0] + gains[i, 2] * change + feedforward[i]

    return replace(SOURCE_PID, name="unbounded", control=control)


def test_a_loop_that_runs_away_after_a_stop_from_full_speed_is_refused():
    law = unbounded_integral()
    register_controller(law)
    try:
        with pytest.raises(ParameterError, match=r"comes back.*joint 3"):
            slave(controller__kind=law.name)
    finally:
        CONTROLLERS.remove(law.name)


@pytest.mark.slow
@pytest.mark.parametrize("robot", [name for name in ROBOTS.names() if load_robot(name).drives])
def test_every_law_comes_back_from_full_speed_on_every_robot_and_plant(robot):
    for law in CONTROLLERS.names():
        for plant in PLANTS.names():
            slave(robot=robot, controller__kind=law, plant__kind=plant)


@pytest.mark.parametrize("law", CONTROLLERS.names())
def test_gains_that_follow_nothing_are_refused(law):
    weak = {f"controller__{law}__bandwidth": (0.1,) * 6}
    with pytest.raises(ParameterError, match="comes back"):
        slave(controller__kind=law, **weak)


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"coulomb": (1e9,) * 6}, "effort of its drive"),
        ({"coulomb": (0.0, 0.0, 26.0, 0.0, 0.0, 0.0)}, "below 25.6 for joint 3"),
        ({"plant__hardware__bias": (0.0, 1e3, 0.0, 0.0, 0.0, 0.0), "plant__kind": "hardware"},
         "joint 2"),
    ],
    ids=["beyond all drives", "just beyond one", "bias alone"],
)  # fmt: skip
def test_friction_that_no_drive_moves_is_refused(values, reason):
    with pytest.raises(ParameterError, match=reason):
        slave(**values)


def test_dry_friction_too_stiff_for_the_integrator_is_refused_and_taken_with_more_steps():
    dry = (0.0, 0.0, 0.0, 0.1, 0.0, 0.0)
    with pytest.raises(ParameterError, match="raise integration_steps"):
        slave(coulomb=dry, integration_steps=1)
    slave(coulomb=dry, integration_steps=20)


def test_a_law_that_does_not_come_back_is_taken_where_small_errors_alone_are_tried():
    weak = {"controller__pid__bandwidth": (0.1,) * 6}
    slave(**weak, trials="small")
    with pytest.raises(ParameterError, match="comes back"):
        slave(**weak)
