"""Architectures: what the hand feels of the slave, by each law, and over a network."""

from functools import partial
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from palpation import on_the_slave, pressed
from teleop_core.base import build
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.graph import STATE
from teleop_core.kernels import kernel
from teleop_core.session import configuration, virtual

pytestmark = pytest.mark.usefixtures("own_parts")
CALM = ("reach_force.is_on=false", "reflection.max_force=10.0")


pressing = partial(pressed, *CALM, ticks=14_000)


def test_position_position_is_a_spring_from_the_command_to_the_tip() -> None:
    chosen = ("reflection.architecture=position_position",)
    rows = pressing(*chosen, "position_position.stiffness=400.0")
    away = rows["slave_measured_cp"][:-1, :3] - rows["slave_servo_cp"][1:, :3]
    force = on_the_slave(rows["master_servo_cf"][1:])
    settled = slice(5000, None)  # the slave follows, and the push has set in
    assert np.linalg.norm(force[settled], axis=1).max() > 0.5
    np.testing.assert_allclose(force[settled], 400.0 * away[settled], atol=1e-12)


def test_the_hand_feels_no_spring_while_the_slave_goes_its_own_way() -> None:
    rows = pressing(
        "reflection.architecture=position_position",
        "feedback_timeout=1.0",
        "delays=[slave/measured_cp@motion_scaling=0.2]",
        ticks=6000,
    )
    follows = rows["teleop_state"][:, STATE["is_following"]] > 0.0
    own_way = slice(0, int(np.argmax(follows)))
    moved = np.linalg.norm(np.ptp(rows["slave_measured_cp"][own_way, :3], axis=0))
    assert moved > 0.01  # the arm goes to where it starts
    assert not rows["master_servo_cf"][own_way].any()
    assert rows["master_servo_cf"][own_way.stop + 200 :].any()


@pytest.mark.parametrize(("kind", "silent"), [("position_force", "cf"), ("position_position", "cp")])
def test_what_falls_silent_fades_within_a_tenth_of_a_second(kind: str, silent: str) -> None:
    chosen = [*CALM, f"reflection.architecture={kind}", "feedback_timeout=0.05"]
    session = virtual.VirtualTime(configuration.configure("palpation", settings=chosen))
    stage, pushes = session.stages["motion_scaling"], []
    row = stage.signals
    session.run(11_600)
    pose_ns = int(row["master_measured_cp_ns"])
    for tick in range(1, 201):
        now_ns = pose_ns + tick * 1_000_000
        row["master_measured_cp_ns"] = now_ns
        row["slave_setpoint_cp_ns"] = now_ns  # it follows, but for what is silent
        for name in {"cf", "cp"} - {silent}:
            row[f"slave_measured_{name}_ns"] = now_ns
        stage.step()
        pushes.append(np.linalg.norm(row["master_servo_cf"][:3]))
    assert pushes[0] > 0.1
    assert pushes[-1] == 0.0
    assert np.abs(np.diff(pushes)).max() < 0.05 * pushes[0]


def test_another_architecture_sets_in_from_nothing_within_a_tenth_of_a_second() -> None:
    session = virtual.VirtualTime(configuration.configure("palpation", settings=[*CALM]))
    session.run(11_600)
    stage = session.stages["motion_scaling"]
    chosen = {"reflection.architecture": "position_position", "reach_force.is_on": False}
    stage.retune(build(MotionScalingParameters, chosen))
    force = np.linalg.norm(session.run(200)["master_servo_cf"][:, :3], axis=1)
    assert force[0] < 0.02 * force[150:].max()
    assert np.abs(np.diff(force)).max() < 2.0 * 150.0 * 55e-6  # of the spring, two steps read
    stage.retune(build(MotionScalingParameters, chosen | {"reflection.position_position.stiffness": 0.0}))
    assert not session.run(2)["master_servo_cf"].any()


def test_an_architecture_of_ones_own_is_one_call_and_remembers_twelve_numbers() -> None:
    @kernel
    def counting(numbers: Any, memory: Any, felt: Any, away: Any, period: Any, out: Any) -> None:
        memory[11] += period
        out[0], out[1], out[2] = 0.0, 0.0, 0.01 * memory[11]

    tc.register_architecture(tc.Architecture("counting", tc.NoParameters, counting))
    rows = pressing("reflection.architecture=counting", ticks=3000)
    force = on_the_slave(rows["master_servo_cf"])
    np.testing.assert_allclose(np.diff(force[1000:, 2]), 1e-5, rtol=1e-9)
