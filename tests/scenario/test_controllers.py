"""Control laws in sessions on the hardware plant, and their comparison as an experiment."""

import math
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from present import present
from teleop_core.graph.topics import NO_COMMAND_NS
from teleop_core.robots import load_robot
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.controllers import GOAL_UM, LAWS, compared, tracking_of

BETTER = ("computed_torque", "disturbance_observer", "friction_compensation", "adaptive")
SHORT = 16.0


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench(seed=5, settings={"duration": SHORT})


@pytest.mark.parametrize("scenario", ["coarse_box", "fine_box"])
@pytest.mark.parametrize("law", BETTER)
def test_law_tracks_within_three_resolutions_on_the_plant_that_predicts_the_machine(
    bench: Bench, scenario: str, law: str
) -> None:
    found = tracking_of(bench.session(scenario, settings={"plant": "hardware", **LAWS[law]}))
    assert found.rms <= GOAL_UM
    source = tracking_of(bench.session(scenario, settings={"plant": "hardware", **LAWS["source_pid"]}))
    assert found.rms < 0.2 * source.rms
    assert found.chatter < 0.5 * source.chatter


def test_tracking_is_what_its_definition_gives_of_the_recording() -> None:
    law: dict[str, Any] = {"plant": "hardware", "controller": "adaptive", "duration": 6.0}
    bench = Bench(seed=2)
    found = tracking_of(bench.session("fine_box", settings=law))
    recording = tc.run("fine_box", seed=2, settings=law)
    frames = {
        name: recording[f"slave/{name}"].frame() for name in ("setpoint_cp", "measured_cp", "true_cp", "measured_js")
    }
    # A measured pose comes a tick after the setpoint that it was sampled with.
    kept = (recording["slave/setpoint_cp"].stamp_ns[:-1] > NO_COMMAND_NS).nonzero()[0]
    wanted, seen, true = (
        frames[name][["x", "y", "z"]].iloc[kept + late].reset_index(drop=True) * 1e6
        for name, late in (("setpoint_cp", 0), ("measured_cp", 1), ("true_cp", 0))
    )
    error = ((seen - wanted) ** 2).sum(axis=1) ** 0.5
    assert math.isclose(found.rms, ((error**2).mean()) ** 0.5, rel_tol=1e-9)
    assert math.isclose(found.largest, error.max(), rel_tol=1e-9)
    off = true - wanted
    spread = (off.var(ddof=0).sum()) ** 0.5
    assert math.isclose(found.true_spread, spread, rel_tol=1e-9)
    robot = load_robot("rcrt1")
    efforts = frames["measured_js"][[f"{name}.effort" for name in robot.joint_names]].iloc[kept]
    change = (efforts / present(robot.drives).effort_limit).diff().dropna()
    assert math.isclose(found.chatter, 100.0 * np.sqrt((change**2).to_numpy().mean()), rel_tol=1e-9)


def test_sessions_compared_differ_in_their_hands_alone(bench: Bench) -> None:
    sessions = compared(bench, "fine_box", "adaptive")
    assert [one.seed for one in sessions] == [5, 6, 7]
    assert {one.name for one in sessions} == {"fine_box"}


def test_law_that_learns_suffers_least_from_friction_that_is_not_as_known(bench: Bench) -> None:
    twice = tuple(2.0 * value for value in present(load_robot("rcrt1").hardware).coulomb)
    settings: Any = {"plant": "hardware", "plant.hardware.coulomb": twice}
    known, learned = (
        tracking_of(bench.session("coarse_box", settings={**settings, **LAWS[law]})).rms
        for law in ("friction_compensation", "adaptive")
    )
    assert learned < 0.8 * known
    assert learned <= GOAL_UM
