"""Elastic joints, late and weak drives: each acts as its formula says, none by default."""

import math
from typing import Any

import numpy as np
import pytest

from present import present
from teleop_core.base import ParameterError, build
from teleop_core.graph import DT, TICK_NS
from teleop_core.kernels import Array, kernel
from teleop_core.robots import load_robot
from teleop_core.slave import elastic, simulation, slave_sim, transmission
from teleop_core.slave.plants.hardware import faults_of

ARM = load_robot("rcrt1")
STIFF = 5000.0
GEARS = {"plant.hardware.gear_stiffness": (STIFF, STIFF, 0.0, 0.0, 0.0, 0.0)}
ALONE = {"plant.hardware.without": ("friction", "wandering", "bias", "drive_steps")}


def slave(**settings: Any) -> slave_sim.SlaveSim:
    given = {"plant.kind": "hardware", "controller.kind": "source_pid"}
    return slave_sim.SlaveSim(build(slave_sim.SlaveSimParameters, given | settings))


def test_by_default_no_gear_bends_and_no_effort_is_late() -> None:
    p = slave().parameters
    assert p["has_gears"] == 0
    assert p["delay_ticks"] == 0
    assert (p["drive_gain"] == 1.0).all()


def test_a_link_hangs_in_its_gear_by_its_weight_over_the_stiffness() -> None:
    made = slave(**GEARS)
    for tick in range(1, 400):
        made.signals["now_ns"] = tick * TICK_NS
        made.step()
    gravity = np.zeros(6)
    present(ARM.dynamics).gravity(made.state["link"].copy(), made.arm.dynamics.copy(), gravity)
    bent = made.arm.q - made.state["link"]
    np.testing.assert_allclose(bent[:2], gravity[:2] / STIFF, rtol=1e-3, atol=1e-9)
    assert np.array_equal(bent[2:], np.zeros(4))
    assert np.allclose(made.arm.tip[:2], made.state["link"][:2], atol=1e-12)


def test_a_gear_rings_at_the_frequency_of_two_masses_on_its_spring() -> None:
    one = {"plant.hardware.gear_stiffness": (STIFF, 0.0, 0.0, 0.0, 0.0, 0.0)}
    made = slave(viscous=(0.0,) * 6, **one, **ALONE)
    p, s, arm = made.parameters, made.state, made.arm
    p["gear_damping"] = 0.0
    motor = faults_of(ARM).motors[0]
    model, q = np.zeros((3, 3)), ARM.home.copy()
    from teleop_core.robots.arms.rcrt1_dynamics import inertia_matrix

    inertia_matrix(q, arm.dynamics, model)
    link = model[0, 0] - motor
    s["link"][0] += 1e-4
    held, path, weight = arm.q.copy(), [], np.zeros(6)
    present(ARM.dynamics).gravity(held.copy(), arm.dynamics.copy(), weight)
    for _ in range(1000):
        for i in range(1, 6):  # all other joints are held
            arm.q[i], s["link"][i], arm.dq[i], s["link_speed"][i] = held[i], held[i], 0.0, 0.0
        elastic.integrate_elastic(arm.acceleration, arm.dynamics, p, s, arm.contacts, 20, weight, arm.q, arm.dq, DT)
        path.append((arm.q[0], s["link"][0]))
    motors, links = np.array(path).T
    # Nothing pushes from outside: the common centre of mass stays.
    centre = motor * (motors - held[0]) + link * (links - held[0])
    np.testing.assert_allclose(centre, link * 1e-4, rtol=2e-2)
    wave = motors - motors.mean()
    rising = np.flatnonzero((wave[:-1] < 0.0) & (wave[1:] >= 0.0))
    exact = rising - wave[rising] / (wave[rising + 1] - wave[rising])
    period = (exact[-1] - exact[0]) / (len(exact) - 1) * DT
    expected = 2.0 * math.pi / math.sqrt(STIFF * (1.0 / motor + 1.0 / link))
    assert abs(period / expected - 1.0) < 0.01


@kernel
def drive_on(p: simulation.SimulationRecord, s: simulation.SimulationState, arm: Any, efforts: Array) -> None:
    """What drives give for rows of efforts (N, 6); written in their place."""
    for k in range(efforts.shape[0]):
        for i in range(6):
            arm.effort[i] = efforts[k, i]
        transmission.drive(p, s, arm)
        for i in range(6):
            efforts[k, i] = arm.effort[i]


def test_late_drives_give_the_efforts_of_so_many_ticks_before_and_weak_ones_their_share() -> None:
    made = slave(**ALONE, **{"plant.hardware.effort_delay": 3e-3})
    asked = np.random.default_rng(1).uniform(-0.1, 0.1, (50, 6))
    given = asked.copy()
    drive_on(made.parameters, made.state, made.arm, given)
    np.testing.assert_allclose(given[3:], asked[:-3], atol=1e-15)
    np.testing.assert_allclose(given[:3], np.repeat(asked[:1], 3, axis=0), atol=1e-15)
    made = slave(**ALONE, **{"plant.hardware.drive_gain": 0.8})
    given = asked.copy()
    drive_on(made.parameters, made.state, made.arm, given)
    np.testing.assert_allclose(given, 0.8 * asked, atol=1e-15)


def test_a_delay_that_makes_a_loop_swing_is_refused_though_the_loop_without_it_was_tried() -> None:
    law = {"controller.kind": "disturbance_observer"}
    slave(**law)
    with pytest.raises(ParameterError):
        slave(**law, **{"plant.hardware.effort_delay": 20e-3})
