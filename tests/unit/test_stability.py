"""Stability: gains that let errors grow at the control rate are refused before they are taken."""

import numpy as np
import pytest

from teleop_core.errors import ParameterError
from teleop_core.parameters import build
from teleop_core.slave.slave_sim import SlaveSim, SlaveSimParameters


def slave(**values):
    named = {name.replace("__", "."): value for name, value in values.items()}
    return SlaveSim(build(SlaveSimParameters, {"robot": "rcrt1", "starts_at_home": True} | named))


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


def test_stiff_friction_is_taken_with_enough_steps():
    needed = 5.0
    with pytest.raises(ParameterError):
        slave(viscous=(0.0, 0.0, 0.0, needed, 0.0, 0.0), integration_steps=1)
    slave(viscous=(0.0, 0.0, 0.0, needed, 0.0, 0.0), integration_steps=50)


def test_refused_gains_leave_the_slave_as_it_was():
    one, other = slave(), slave()
    bad = build(SlaveSimParameters, {
        "robot": "rcrt1", "starts_at_home": True, "controller.pid.bandwidth": (500.0,) * 6
    })  # fmt: skip
    good = build(SlaveSimParameters, {"robot": "rcrt1", "starts_at_home": True})
    with pytest.raises(ParameterError):
        one.retune(bad)
    one.retune(good)  # as the node does
    for k in range(500):
        for arm in (one, other):
            row = arm.signals
            row["now_ns"] = row["slave_servo_jp_ns"] = 10**9 + k * 10**6
            row["slave_servo_jp"] = arm.robot.home + 1e-4 * k
            arm.step()
    assert np.array_equal(one.signals["slave_measured_js"], other.signals["slave_measured_js"])
