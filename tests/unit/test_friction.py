"""Friction that sticks: it holds for ever, slips as Coulomb says, takes energy, wanders."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from present import present
from teleop_core.base import build
from teleop_core.graph import DT
from teleop_core.kernels import Array, kernel
from teleop_core.slave.friction import wander
from teleop_core.slave.joints import integrate
from teleop_core.slave.simulation import SimulationRecord, SimulationState
from teleop_core.slave.slave_sim import SlaveSim, SlaveSimParameters

JOINT = 3  # theta4 of the rcrt1: an axis that acts on no other


class Joint:
    """One joint of the rcrt1 on the hardware plant, under any effort; friction does not wander."""

    def __init__(self, steps: int = 2, **settings: Any) -> None:
        given = {"plant.kind": "hardware", "plant.hardware.without": ("wandering",)}
        self.slave = SlaveSim(build(SlaveSimParameters, given | settings))
        self.steps, self.p, self.s = steps, self.slave.parameters, self.slave.state
        self.q, self.dq, self.effort = np.zeros(6), np.zeros(6), np.zeros(6)
        self.q[1:3] = self.slave.robot.home[1:3]
        self.inertia = present(self.slave.robot.drives).inertia[JOINT]
        self.dry, self.viscous = self.p["coulomb"][JOINT], self.p["viscous"][JOINT]
        self.stiffness = self.p["bristle"][JOINT]

    def step(self, effort: float, count: int = 1) -> Array:
        """Positions (count,) of the joint under a constant effort, after each tick."""
        arm, self.effort[JOINT], found = self.slave.arm, effort, np.empty(count)
        for k in range(count):
            self.q[1:3] = self.slave.robot.home[1:3]
            self.dq[:3] = 0.0
            integrate(arm.acceleration, arm.dynamics, self.p, self.s, arm.contacts, self.steps,
                      self.effort, self.q, self.dq, DT)  # fmt: skip
            found[k] = self.q[JOINT]
        return found


@pytest.mark.parametrize("share", [0.1, 0.7, 0.99, -0.99])
def test_a_load_below_dry_friction_is_held_for_ever(share: float) -> None:
    joint = Joint()
    for k in range(1000):  # a load that comes at once swings and may slip
        joint.step(k / 1000 * share * joint.dry)
    path = joint.step(share * joint.dry, 30_000)
    assert path[2000:].max() - path[2000:].min() < 1e-15
    assert math.isclose(path[-1], share * joint.dry / joint.stiffness, rel_tol=1e-6)
    joint.step(0.0, 3000)
    assert abs(joint.q[JOINT]) < 1e-12  # it had only bent


def test_a_load_above_dry_friction_slips_as_coulomb_says() -> None:
    joint = Joint(viscous=(0.0,) * 6)
    joint.step(1.5 * joint.dry, 200)
    before = joint.dq[JOINT]
    joint.step(1.5 * joint.dry, 100)
    expected = 0.5 * joint.dry / joint.inertia * 0.1
    assert math.isclose(joint.dq[JOINT] - before, expected, rel_tol=1e-12)


def test_vibration_below_dry_friction_moves_nothing_away() -> None:
    # Plain LuGre creeps under just this.
    joint = Joint()
    joint.step(0.5 * joint.dry, 2000)
    rest = joint.q[JOINT]
    for k in range(20_000):
        joint.step((0.5 + 0.4 * math.sin(2 * math.pi * 25.0 * k * DT)) * joint.dry)
    joint.step(0.5 * joint.dry, 3000)
    assert math.isclose(joint.q[JOINT], rest, rel_tol=1e-9)


@pytest.mark.parametrize("hertz", [0.5, 3.0])
def test_motion_is_that_of_an_elastic_and_plastic_bristle(hertz: float) -> None:
    joint = Joint(steps=20)
    amplitude, damping = 3.0 * joint.dry, joint.p["bristle_damping"][JOINT]
    most = joint.dry / joint.stiffness

    def slopes(time: float, state: Array) -> list[float]:
        _, v, z = state
        pull = np.clip(joint.stiffness * z + damping * v, -joint.dry, joint.dry)
        is_slipping = abs(z) >= most and v * z > 0.0
        force = amplitude * math.sin(2 * math.pi * hertz * math.floor(time / DT + 1e-9) * DT)
        return [v, (force - joint.viscous * v - pull) / joint.inertia, 0.0 if is_slipping else v]

    count, mine = 1000, []
    for k in range(count):
        mine.append(joint.step(amplitude * math.sin(2 * math.pi * hertz * k * DT))[0])
    state, theirs = [0.0, 0.0, 0.0], []
    for k in range(count):
        end = solve_ivp(slopes, (k * DT, (k + 1) * DT - 1e-12), state, max_step=DT / 20, rtol=1e-8)
        state = end.y[:, -1]
        state[2] = min(max(state[2], -most), most)
        theirs.append(state[0])
    assert np.abs(np.array(mine) - theirs).max() < 2e-3 * np.ptp(theirs)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=12))
def test_friction_gives_back_no_more_than_its_bristle_had_stored(shares: list[float]) -> None:
    joint = Joint(steps=10, viscous=(0.0,) * 6)
    work, last = 0.0, 0.0
    for share in shares:
        for place in joint.step(share * joint.dry, 40):
            work, last = work + share * joint.dry * (place - last), place
    kinetic = 0.5 * joint.inertia * joint.dq[JOINT] ** 2
    stored = 0.5 * joint.stiffness * joint.s["bent"][JOINT] ** 2
    assert work >= kinetic + stored - 1e-3 * abs(work) - 1e-12


def test_a_second_step_size_gives_the_same_motion() -> None:
    paths = []
    for steps in (2, 20):
        joint = Joint(steps=steps)
        parts = [joint.step(share * joint.dry, 300) for share in (2.0, -3.0, 0.5, 2.5)]
        paths.append(np.concatenate(parts))
    assert np.abs(paths[0] - paths[1]).max() < 2e-3 * np.ptp(paths[1])


def test_smooth_friction_creeps_under_the_load_that_sticking_friction_holds() -> None:
    joint = Joint(**dict[str, Any]({"plant.hardware.without": ("wandering", "sticking")}))
    path = joint.step(0.7 * joint.dry, 5000)
    assert path[-1] - path[-1000] > 1e-3


@kernel
def wander_once(p: SimulationRecord, s: SimulationState) -> None:
    """One tick of :func:`wander`, which only kernels call."""
    wander(p, s)


@kernel
def wander_on(p: SimulationRecord, s: SimulationState, share: float, ticks: int, found: Array) -> None:
    """Share of dry friction in force, every hundredth tick (ticks / 100, 6).

    All joints slip by a ``share`` of the way on which friction changes in every tick.
    """
    for k in range(ticks):
        for i in range(6):
            s.slipped[i] = share * p.wander_travel[i]
        wander(p, s)
        if k % 100 == 99:
            for i in range(6):
                found[k // 100, i] = s.grip[i]


def grips(seed: int, share: float = 1e-3, ways: int = 600) -> tuple[Array, Array]:
    slave = SlaveSim(build(SlaveSimParameters, {"plant.kind": "hardware", "seed": seed}))
    ticks = round(ways / share)
    found = np.empty((ticks // 100, 6))
    wander_on(slave.parameters, slave.state, share, ticks, found)
    return found, slave.parameters["wander"]


@pytest.mark.parametrize("share", [1e-3, 0.02])
def test_friction_wanders_about_its_mean_as_much_as_it_is_told_at_any_speed(share: float) -> None:
    found, told = grips(1, share, ways=1200)
    quiet = told < 0.5  # above, the floor of a tenth cuts the share
    assert np.abs(found.mean(axis=0)[quiet] - 1.0).max() < 0.1
    assert np.abs(found.std(axis=0)[quiet] / told[quiet] - 1.0).max() < 0.15
    assert (found >= 0.1).all()
    a = found[:, 1] - found[:, 1].mean()
    # So many samples later a hundred ticks times the share of the memory are over.
    kept = (1.0 - share) ** 100
    assert abs(np.mean(a[1:] * a[:-1]) / np.mean(a**2) - kept) < 0.1


def test_friction_wanders_alike_for_one_seed_and_otherwise_for_another() -> None:
    first, again, other = grips(1)[0], grips(1)[0], grips(2)[0]
    assert np.array_equal(first, again)
    assert abs(np.corrcoef(first[:, 0], other[:, 0])[0, 1]) < 0.2
    assert abs(np.corrcoef(first[:, 0], first[:, 1])[0, 1]) < 0.2


def test_friction_of_a_joint_that_sticks_does_not_wander() -> None:
    joint = Joint(**dict[str, Any]({"plant.hardware.without": ()}))
    for _ in range(300):
        joint.step(3.0 * joint.dry)
        wander_once(joint.p, joint.s)
    moved = joint.s["grip"][JOINT]
    assert moved != 1.0
    joint.step(0.0, 2000)
    wander_once(joint.p, joint.s)
    held, joint.dq[:] = joint.s["grip"][JOINT], 0.0
    for _ in range(5000):
        joint.step(0.5 * held * joint.dry)
        wander_once(joint.p, joint.s)
    assert joint.s["grip"][JOINT] == held


@pytest.mark.slow
def test_an_arm_at_rest_stays_there_however_long_it_is_held() -> None:
    from teleop_core.robots import load_robot
    from teleop_core.slave.pair import ArmParameters
    from teleop_lab.fitting.rest_table import PUBLISHED, read_rests
    from teleop_lab.fitting.rests import Mover

    arm = load_robot("rcrt1")
    given = {"plant.kind": "hardware", "controller.kind": "source_pid", "seed": 3}
    for target in np.clip(read_rests(PUBLISHED, arm).targets, arm.lower, arm.upper)[1:4]:
        counts = np.array(
            [
                Mover(build(ArmParameters, given), settle=seconds).move(target) / present(arm.drives).encoder_step
                for seconds in (1.0, 5.0, 20.0, 60.0)
            ]
        )
        assert np.ptp(counts, axis=0)[[0, 1, 3, 4, 5]].max() < 1e-6
        assert np.ptp(counts, axis=0)[2] < 2.5  # the integrator of d3 may still take a count
