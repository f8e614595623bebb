"""Force observer: what drives and encoders tell of a push, against the push as it is."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import teleop_core as tc
from present import present
from teleop_core.graph.topics import OPERATION
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime
from teleop_core.slave import force_observer, slave_sim
from teleop_core.slave.plants import PLANTS

LAG = 5e-3
"""Time constant of the measured speeds [s]."""


def fine_physics(parameters: tc.NoParameters, robot: tc.Robot) -> tc.Physics:
    """The ideal plant with encoders that see everything, and no friction."""
    zero = np.zeros(robot.n)
    ideal = PLANTS.find("ideal").physics(tc.NoParameters(), robot)
    return replace(ideal, encoder_step=np.full(robot.n, 1e-10), viscous=zero, coulomb=zero)


@pytest.fixture(scope="module", autouse=True)
def fine() -> None:
    """A plant of which everything is known."""
    if "fine_encoders" not in PLANTS:
        tc.register_plant(tc.Plant("fine_encoders", tc.NoParameters, fine_physics))


def made(name: str, *texts: str) -> slave_sim.SlaveSim:
    """A simulated arm at its start."""
    given = [f"robot={name}", "trials=small", "estimate=true", *texts]
    stage = slave_sim.SlaveSim(configure("free_motion", settings=given).group("slave_sim"))
    stage._rest_at(stage.robot.start.copy())
    return stage


def led(stage: slave_sim.SlaveSim, path: Array) -> Array:
    """True and estimated force (2, N, 3) of an arm whose setpoints are led along a path (N, n)."""
    forces = np.empty((2, len(path), 3))
    for k, setpoint in enumerate(path):
        stage.signals["slave_setpoint_js"] = setpoint
        stage.step()
        for row, name in zip(forces[:, k], ("slave_true_cf", "slave_estimated_cf"), strict=True):
            row[:] = stage.signals[name][:3]
    return forces


def pressed(name: str, way: Any, *texts: str, seconds: float = 1.0, ticks: int = 3000) -> Array:
    """Forces of a tip that goes 3 mm along a way, against a ball 1 mm ahead, and stays there."""
    robot = load_robot(name)
    way = np.array(way) / np.linalg.norm(way)
    ball = (robot.fk(robot.start)[:3, 3] + 0.051 * way).tolist()
    stage = made(name, "world=sphere", "world.sphere.radius=0.05", f"world.place={ball}",
                 "world.material=own", "world.stiffness=1000.0", *texts)  # fmt: skip
    move = np.linalg.pinv(robot.jacobian(robot.start)[:3]) @ (0.003 * way)
    share = np.minimum(1e-3 * np.arange(ticks) / seconds, 1.0)
    return led(stage, robot.start + share[:, None] * move)


@pytest.mark.parametrize(
    ("name", "way"), [("rcrt1", (0.3, 0.5, -0.8)), ("planar_3r", (0.8, 0.5, 0.0)), ("stewart", (0.3, 0.5, 0.8))]
)
def test_a_constant_push_on_the_tip_is_estimated_within_four_per_cent(
    name: str, way: tuple[float, float, float]
) -> None:
    true, estimated = pressed(name, way)
    assert np.linalg.norm(true[-1]) == pytest.approx(2.0, rel=0.05)
    off = (estimated - true)[-500:].mean(0)
    assert np.linalg.norm(off) < 0.04 * np.linalg.norm(true[-1])


@pytest.mark.parametrize("hertz", [3.0, 30.0])
def test_a_push_is_told_through_a_low_pass_of_the_bandwidth_behind_that_of_the_speeds(hertz: float) -> None:
    true, estimated = pressed(
        "rcrt1", (0.3, 0.5, -0.8), "plant=fine_encoders", f"estimate_bandwidth={hertz}", seconds=0.1
    )
    wanted, lagged = np.zeros_like(true), np.zeros(3)
    for k in range(1, len(true)):
        lagged = lagged + (true[k - 1] - lagged) * 1e-3 / (1e-3 + LAG)
        wanted[k] = wanted[k - 1] + (lagged - wanted[k - 1]) * -math.expm1(-2e-3 * math.pi * hertz)
    assert np.abs(estimated - wanted).max() < 0.05 * np.abs(true - wanted).max()


@given(size=st.floats(0.05, 0.15), turns=st.lists(st.floats(0.3, 1.2), min_size=6, max_size=6))
@settings(max_examples=6, deadline=None)
def test_swinging_fast_in_free_air_is_no_push(size: float, turns: list[float]) -> None:
    stage = made("rcrt1", "plant=fine_encoders")
    robot, times = stage.robot, 1e-3 * np.arange(2000)
    room = np.minimum(np.minimum(robot.upper - robot.start, robot.start - robot.lower), 1.0)
    swing = np.sin(2.0 * math.pi * np.outer(times, turns)) * times[:, None]
    _, estimated = led(stage, robot.start + size * room * swing)
    assert np.abs(estimated).max() < 0.01


def test_what_an_estimate_costs_is_time_alone_and_off_it_is_zero() -> None:
    texts = ("reflection.architecture=unilateral",)
    without, with_it = (
        VirtualTime(configure("palpation", settings=[*texts, f"estimate={word}"])).run(12_000)
        for word in ("false", "true")
    )
    for field in ("slave_true_cf", "slave_measured_cf", "slave_true_cp", "slave_measured_js"):
        np.testing.assert_array_equal(with_it[field], without[field])
    assert not without["slave_estimated_cf"].any()
    assert with_it["slave_estimated_cf"].any()
    assert not with_it["slave_estimated_cf"][:, 3:].any()


def test_brakes_that_stop_the_arm_are_no_push_and_nothing_of_before_is_left_after_them() -> None:
    stage = made("rcrt1", "plant=fine_encoders")
    turn = np.zeros(stage.robot.n)
    turn[0] = 1e-3  # [rad] each tick
    led(stage, stage.robot.start + np.arange(500)[:, None] * turn)
    stage.signals["slave_operation"][OPERATION.index("is_braked")] = 1.0
    _, held = led(stage, np.tile(stage.arm.q.copy(), (300, 1)))
    assert not held.any()
    stage.signals["slave_operation"][OPERATION.index("is_braked")] = 0.0
    _, free = led(stage, np.tile(stage.arm.q.copy(), (300, 1)))
    assert free.any()
    assert np.abs(free).max() < 0.01


ENTRIES = st.floats(-1.0, 1.0).map(lambda value: round(value, 3))


@given(n=st.integers(1, 9), data=st.data(), force=st.lists(ENTRIES, min_size=3, max_size=3))
@settings(max_examples=100, deadline=None)
def test_the_force_is_the_damped_least_squares_of_the_efforts(n: int, data: st.DataObject, force: list[float]) -> None:
    entries = data.draw(st.lists(ENTRIES, min_size=3 * n, max_size=3 * n))
    scale = np.array(data.draw(st.lists(st.floats(0.1, 100.0), min_size=n, max_size=n)))
    J = np.vstack((np.reshape(entries, (3, n)), np.full((3, n), np.nan)))
    efforts, found = J[:3].T @ np.array(force), np.full(3, np.nan)
    force_observer.force_of_efforts(J, efforts, scale, found)
    way = J[:3].T / scale[:, None]
    damping = math.sqrt(1e-4 * np.trace(way.T @ way) / 3.0)
    rows = np.vstack((way, damping * np.eye(3)))
    wanted = np.linalg.lstsq(rows, np.append(efforts / scale, np.zeros(3)), rcond=None)[0]
    np.testing.assert_allclose(found, wanted, atol=1e-6)
    assert np.linalg.norm(found) <= np.linalg.norm(force) * (1.0 + 1e-6)  # never more than there is


@pytest.mark.parametrize("wrong", [0.0, math.nan, math.inf])
def test_an_arm_without_a_jacobian_feels_nothing(wrong: float) -> None:
    found = np.full(3, np.nan)
    force_observer.force_of_efforts(np.full((6, 4), wrong), np.ones(4), np.ones(4), found)
    np.testing.assert_array_equal(found, np.zeros(3))


def test_a_stretched_arm_tells_a_finite_force() -> None:
    stage = made("planar_3r")
    stage._rest_at(np.zeros(3))
    _, estimated = led(stage, np.zeros((200, 3)))
    assert np.isfinite(estimated).all()
    assert np.abs(estimated).max() < 1.0


def test_the_estimate_is_scored_in_touch_where_there_is_one() -> None:
    given = ["reflection.architecture=unilateral", "duration=14.0"]
    none, found = (
        tc.run(configure("palpation", settings=[*given, f"estimate={word}"])).score() for word in ("false", "true")
    )
    assert none.value("force_sensing.estimated_rms_n") is None
    assert none.value("force_sensing.measured_rms_n") == 0.0
    assert 0.001 < present(found.value("force_sensing.estimated_rms_n")) < 0.1  # of pushes up to 1.8 N
    assert present(found.value("force_sensing.estimated_max_n")) < 0.25
