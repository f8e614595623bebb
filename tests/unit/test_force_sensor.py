"""Force sensor: noise, bias, bandwidth and the tool's weight, each against what its number says."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import teleop_core as tc
from palpation import pressed
from present import present
from teleop_core.kernels.geometry import Array
from teleop_core.session import configuration, virtual
from teleop_core.slave.pair import ArmParameters, SimulatedArm
from teleop_core.slave.slave_sim import SlaveSim

TICKS = 2000


def arm(*texts: str, robot: str = "rcrt1") -> SlaveSim:
    """A simulated arm that nobody leads."""
    given = [f"robot={robot}", "trials=small", *texts]
    return SlaveSim(configuration.configure("free_motion", settings=given).group("slave_sim"))


def told(stage: SlaveSim, ticks: int = TICKS) -> Array:
    """What its sensor tells (N, 6) and what is true (N, 6)."""
    rows = np.empty((2, ticks, 6))
    for k in range(ticks):
        stage.step()
        rows[:, k] = stage.signals["slave_measured_cf"], stage.signals["slave_true_cf"]
    return rows


@given(force=st.floats(1e-3, 5.0), torque=st.floats(1e-4, 0.5), seed=st.integers(0, 99))
@settings(max_examples=5, deadline=None)
def test_noise_has_the_stated_standard_deviation_and_no_mean(force: float, torque: float, seed: int) -> None:
    texts = (f"force_noise={force}", f"torque_noise={torque}", f"seed={seed}")
    measured, true = told(arm(*texts))
    assert not true.any()
    stated = np.repeat((force, torque), 3)
    # Five standard errors of mean and standard deviation of so many samples.
    assert np.all(np.abs(measured.mean(0)) < 5.0 * stated / math.sqrt(TICKS))
    np.testing.assert_allclose(measured.std(0), stated, rtol=5.0 / math.sqrt(2.0 * TICKS))
    assert np.abs(np.corrcoef(measured.T) - np.eye(6)).max() < 5.0 / math.sqrt(TICKS)
    after = (measured[1:] * measured[:-1]).mean(0) / measured.var(0)
    assert np.abs(after).max() < 5.0 / math.sqrt(TICKS)


def test_noise_is_the_same_for_one_seed_and_another_for_another() -> None:
    stage = arm("force_noise=0.1", "seed=7")
    first = told(stage, 1500)[0]
    stage.reset()
    np.testing.assert_array_equal(told(stage, 1500)[0], first)
    np.testing.assert_array_equal(told(arm("force_noise=0.1", "seed=7"), 1500)[0], first)
    assert not np.any(told(arm("force_noise=0.1", "seed=8"), 100)[0] == first[:100], axis=0)[:3].any()


def test_noise_does_not_depend_on_how_many_ticks_are_made_at_once() -> None:
    texts = ["force_noise=0.1", "operator=line", "duration=1.0"]
    blocks: Any = []
    for counts in ((1500,), (1, 700, 799)):
        session = virtual.VirtualTime(configuration.configure("free_motion", settings=texts))
        parts = [session.run(count)["slave_measured_cf"].copy() for count in counts]
        blocks.append(np.concatenate(parts))
    np.testing.assert_array_equal(*blocks)


@pytest.mark.parametrize("hertz", [1.0, 20.0, 300.0])
def test_a_step_of_force_comes_through_as_the_exponential_of_the_bandwidth(hertz: float) -> None:
    stage = arm(f"force_bandwidth={hertz}")
    stage.step()
    stage.signals["slave_true_cf"] = [1.0, -2.0, 3.0, 0.5, 0.0, -0.25]  # no world writes it again
    measured, true = told(stage, 500)
    times = 1e-3 * np.arange(500)
    share = 1.0 - np.exp(-2.0 * math.pi * hertz * times)
    np.testing.assert_allclose(measured, share[:, None] * true, atol=1e-12)


def test_the_weight_of_the_tool_is_seen_along_minus_z_whatever_the_pose() -> None:
    stage = arm("tool_mass=0.3")
    robot, rng = stage.robot, np.random.default_rng(1)
    for joints in rng.uniform(robot.lower, robot.upper, (20, robot.n)):
        stage.arm.q[:] = stage.state["link"] = stage.state["carried"] = joints
        stage.signals["slave_setpoint_js"] = joints
        stage.step()
        np.testing.assert_allclose(stage.signals["slave_measured_cf"], [0.0, 0.0, -0.3 * 9.80665, 0.0, 0.0, 0.0])


def test_a_bias_is_what_is_told_of_nothing() -> None:
    measured, _ = told(arm("force_bias=[0.1,-0.2,0.3]", "torque_bias=[0.01,0.02,-0.03]"), 5)
    np.testing.assert_array_equal(measured, [[0.1, -0.2, 0.3, 0.01, 0.02, -0.03]] * 5)


def test_what_the_sensor_adds_is_added_to_the_true_push_and_moves_nothing() -> None:
    ideal = pressed("reflection.architecture=unilateral", ticks=13_000)
    faulty = pressed(
        "reflection.architecture=unilateral",
        "force_bias=[0.0,0.5,0.0]",
        "tool_mass=0.1",
        "force_noise=0.01",
        ticks=13_000,
    )
    assert ideal["slave_true_cf"][:, 2].max() > 0.5
    np.testing.assert_array_equal(ideal["slave_measured_cf"], ideal["slave_true_cf"])
    for field in ("slave_true_cf", "slave_true_cp", "slave_measured_js"):
        np.testing.assert_array_equal(faulty[field], ideal[field])
    off = (faulty["slave_measured_cf"] - faulty["slave_true_cf"]).mean(0)
    np.testing.assert_allclose(off, [0.0, 0.5, -0.980665, 0.0, 0.0, 0.0], atol=1e-3)


def test_the_plant_behind_gears_has_its_sensor_too() -> None:
    measured, true = told(arm("plant=hardware", "force_bias=[0.0,0.0,1.0]"), 3)
    np.testing.assert_array_equal(measured - true, [[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]] * 3)


def test_an_arm_without_a_graph_draws_its_noise_too() -> None:
    sensor = configuration.configure("free_motion", settings=["force_noise=0.1"]).group("slave_sim").force_sensor
    pair = SimulatedArm(ArmParameters(force_sensor=sensor, trials="small", starts_at_home=True))
    rows = []
    for _ in range(1500):
        pair.step()
        rows.append(pair.signals["slave_measured_cf"][:3].copy())
    assert np.std(rows) == pytest.approx(0.1, rel=0.1)
    assert len(np.unique(rows)) == 4500


def test_a_sensor_that_is_retuned_tells_the_new_numbers_from_the_next_tick_on() -> None:
    stage = arm()
    stage.step()
    assert not stage.signals["slave_measured_cf"].any()
    given = ["robot=rcrt1", "trials=small", "force_bias=[1.0,0.0,0.0]", "force_noise=0.01"]
    stage.retune(configuration.configure("free_motion", settings=given).group("slave_sim"))
    measured, _ = told(stage, 200)
    assert measured[:, 0].mean() == pytest.approx(1.0, abs=0.005)
    assert measured[:, 0].std() == pytest.approx(0.01, rel=0.3)


def score(*texts: str) -> Any:
    """Score of a recorded press."""
    given = ["reflection.architecture=unilateral", "duration=14.0", *texts]
    return tc.run(configuration.configure("palpation", settings=given)).score()


def test_the_score_is_the_error_in_touch_and_noise_is_no_touch() -> None:
    found = score("force_bias=[0.3,0.0,0.4]", "force_noise=0.02")
    assert found.value("touch.count") == score().value("touch.count")
    wanted = math.sqrt(0.3**2 + 0.4**2 + 3 * 0.02**2)
    assert found.value("force_sensing.measured_rms_n") == pytest.approx(wanted, rel=0.01)
    assert 0.5 < present(found.value("force_sensing.measured_max_n")) < 0.65


def test_nothing_is_scored_where_nothing_was_touched() -> None:
    found = tc.run("free_motion", duration=1.0, force_noise=0.1).score()
    assert found.value("force_sensing.measured_rms_n") is None
    assert found.value("touch.count") == 0
