"""Laws of contact: damped walls take more energy than they give back, whoever leans on them."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from held_master import HeldMaster
from teleop_core.base.parameters import build
from teleop_core.coupling.mapping.gains import FixtureParameters, MotionScalingParameters
from teleop_core.coupling.mapping.motion_scaling import MotionScaling
from teleop_core.coupling.mapping.walls import passive_stiffness
from teleop_core.evaluation.metrics.contact import TOUCH_J
from teleop_core.graph.signals import TICK_NS
from teleop_core.hand.master import hand_mechanics, haptic_master
from teleop_core.hand.master.device import DeviceParameters
from teleop_core.hand.operators import register_operator, rest
from teleop_core.hand.operators.behaviour import OperatorParameters, PressParameters
from teleop_core.kernels.geometry import Array

HALF = 2e-3  # from the middle of the box to its walls [m]
RENDERED = DeviceParameters().stiffness  # what the device can render on x, y, z [N/m]
SLIVER = 5e-7  # a touch may give so much more than it took [J]: 0.1 N over 5 µm


def session(
    motion: Callable[[Array], Array],
    seconds: float,
    hand: dict[str, float] | None = None,
    device: Mapping[str, Any] | None = None,
    seed: int = 1,
    delay: int = 0,
    **fixture: str | float,
) -> tuple[Array, Array]:
    """Places (N, 3) [m], forces (N, 3) [N] of a hand with a device in a box, without a slave.

    The wall's force comes ``delay`` ticks late.
    """
    register_operator("leaning", motion, replace=True)
    own, hand = {"kind": "leaning", "rotation": 0.0, "seed": seed, "patience": 0.0}, hand or {}
    own |= {key: hand[key] for key in hand if key.startswith("tremor")}
    person = build(OperatorParameters, own)
    master = HeldMaster(
        replace(person, buttons=PressParameters(fixture=(0.002,))),
        haptic_master.HapticMasterParameters(
            seed=seed,
            hand=hand_mechanics.HandParameters(**{k: v for k, v in hand.items() if k not in own}),
            device=DeviceParameters(**(device or {})),
        ),
    )
    values = {"box.size": (2.0 * HALF,) * 3, **fixture}
    scaling = MotionScaling(MotionScalingParameters(fixture=build(FixtureParameters, values)))
    felt, told = master.signals, scaling.signals
    feel, tell = master.load(), scaling.load()
    places, forces = np.empty((2, round(seconds * 1e3), 3))
    late = deque([np.zeros(6)] * delay)
    for i in range(len(places)):
        if i % 500 == 0:
            master.prepare(500)
        feel()
        places[i], forces[i] = master.state["tip"], felt["master_measured_cf"][:3]
        for name in ("master_measured_cp", "master_buttons"):
            told[name] = felt[name]
        told["master_measured_cp_ns"] = (i + 1) * TICK_NS
        told["slave_setpoint_cp"] = told["slave_servo_cp"]
        told["slave_setpoint_cp_ns"] = i * TICK_NS
        tell()
        late.append(told["master_servo_cf"].copy())
        felt["master_servo_cf"] = late.popleft()
    return places, forces


def energies(places: Array, forces: Array) -> Array:
    """Taken, returned and friction's energy (N, 3) [J] of each stretch with a force."""
    step = np.diff(places, axis=0, prepend=places[:1])
    work, way = (forces * step).sum(axis=1), np.linalg.norm(step, axis=1)
    edges = np.flatnonzero(np.diff(forces.any(axis=1), prepend=False, append=False))
    return np.array(
        [
            (-work[a:b].clip(max=0.0).sum(), work[a:b].clip(min=0.0).sum(), 0.26 * way[a:b].sum())
            for a, b in edges.reshape(-1, 2)
        ]
    ).reshape(-1, 3)


def leaning(rng: np.random.Generator) -> tuple[Callable[[Array], Array], dict[str, float], float]:
    """A hand at random: motion, grip, and a wall no stiffer than the device renders there."""
    axis = int(rng.integers(3))
    direction = np.zeros(3)
    direction[axis] = 1.0
    stiffness = RENDERED[axis]
    if rng.random() < 0.3:  # into an edge or a corner
        direction = rng.normal(size=3)
        direction /= np.abs(direction).max()
        stiffness = min(RENDERED)
    if rng.random() < 0.5:
        stiffness = math.exp(rng.uniform(math.log(200.0), math.log(stiffness)))
    reach = HALF + math.exp(rng.uniform(math.log(1e-4), math.log(6e-3)))
    fast, slow, phase = math.exp(rng.uniform(math.log(0.3), math.log(4.0))), rng.uniform(0.1, 4), 2
    share = rng.uniform(0.0, 0.3)

    def motion(times: Array) -> Array:
        swing = np.sin(2.0 * math.pi * fast * times)
        swing += share * np.sin(2.0 * math.pi * slow * times + phase)
        return reach * (swing * np.minimum(2.0 * times, 1.0))[:, None] * direction

    firmness = math.exp(rng.uniform(math.log(50.0), math.log(2000.0)))
    damping = 2.0 * rng.uniform(0.05, 1.2) * math.sqrt(firmness * 0.195)
    return motion, {"stiffness": firmness, "damping": max(damping, 0.1)}, stiffness


@pytest.mark.parametrize("seed", range(3))
def test_no_contact_with_a_damped_wall_gives_back_more_than_it_took(seed: int, own_parts: None) -> None:
    rng = np.random.default_rng(seed)
    found = []
    for number in range(5):
        motion, hand, stiffness = leaning(rng)
        found.append(energies(*session(motion, 3.0, hand, seed=number + 1, stiffness=stiffness)))
    taken, returned, friction = np.concatenate(found).T
    assert (taken > TOUCH_J).sum() >= 3
    is_contact = np.maximum(taken, returned) >= TOUCH_J
    assert (returned <= taken)[is_contact].all()
    assert (returned - taken <= SLIVER).all()
    # With its dry friction the device feeds the hand at no touch either.
    assert (returned <= taken + friction).all()


def slow(times: Array) -> Array:
    """As the hand of coarse_box: slow, along and into walls, with tremor."""
    waves = ((1e-3, 0.13, 0.1), (1.5e-3, 0.21, 1.0), (1.2e-3, 0.17, 2.0))
    moved = [(HALF + a) * np.sin(2.0 * math.pi * f * times + p) for a, f, p in waves]
    return np.minimum(times, 1.0)[:, None] * np.stack(moved, axis=1)


def test_an_undamped_wall_feeds_slow_contacts_of_a_trembling_hand_a_damped_one_not(own_parts: None) -> None:
    fed = {}
    for wall in ("soft", "damped"):
        taken, returned, _ = energies(*session(slow, 10.0, wall=wall)).T
        is_contact = taken > TOUCH_J
        assert is_contact.sum() >= 3
        fed[wall] = (returned / taken)[is_contact].max()
    assert fed["soft"] > 1.02
    assert fed["damped"] < 1.0


@pytest.mark.parametrize(
    ("stiffness", "delay", "feeds"),
    [(1000.0, 0, False), (330.0, 1, False), (140.0, 3, False), (1260.0, 0, True), (1000.0, 1, True)],
)
def test_a_wall_is_passive_within_its_bound_and_not_far_beyond_it(
    stiffness: float, delay: int, feeds: bool, own_parts: None
) -> None:
    bound = passive_stiffness(10.0, 1e-3, 1e-3 * delay, 0.26, 0.055e-3)
    assert (stiffness > bound * (1.0 + 1e-9)) is feeds
    taken, returned, _ = energies(*session(slow, 8.0, delay=delay, stiffness=stiffness)).T
    is_contact = np.maximum(taken, returned) >= TOUCH_J
    assert is_contact.sum() >= 2
    assert ((returned > taken)[is_contact].any()) == feeds


@pytest.mark.parametrize(("axis", "firmness", "damping"), [(0, 50.0, 0.5), (1, 300.0, 12.0), (2, 2000.0, 5.0)])
def test_leaning_on_a_hard_wall_hand_and_force_are_still(
    axis: int, firmness: float, damping: float, own_parts: None
) -> None:
    def motion(times: Array) -> Array:
        reach = HALF + 1.5 / firmness
        return reach * np.minimum(times / 0.3, 1.0)[:, None] * (np.arange(3) == axis)

    hand = {"stiffness": firmness, "damping": damping, "tremor_amplitude": 0.0}
    device = {"continuous_force": 3.3, "workspace": (0.5, 0.5, 0.5)}
    places, forces = session(motion, 2.0, hand, device, wall="hard")
    late = slice(1300, None)
    assert np.abs(forces[late]).max() > 0.25
    assert not np.ptp(forces[late], axis=0).any()
    assert np.ptp(places[late], axis=0).max() < 1e-9


def test_a_step_of_force_buzzes(own_parts: None) -> None:
    def motion(times: Array) -> Array:
        return (HALF + 1.5 / 300.0) * np.minimum(times / 0.3, 1.0)[:, None] * (1.0, 0.0, 0.0)

    _, forces = session(motion, 2.0, {"tremor_amplitude": 0.0}, wall="step")
    assert np.ptp(forces[1300:, 0]) > 3.0


@pytest.mark.parametrize(("stiffness", "bound"), [(1000.0, 1e-3), (5000.0, 1e-3)])
def test_a_loose_grip_is_not_thrown_about_by_a_stiff_wall(stiffness: float, bound: float, own_parts: None) -> None:
    def motion(times: Array) -> Array:
        return (HALF + 6e-3) * np.minimum(times / 0.5, 1.0)[:, None] * (1.0, 0.0, 0.0)

    hand = {"stiffness": 100.0, "damping": 0.5, "tremor_amplitude": 0.0}
    places, _ = session(motion, 3.0, hand, stiffness=stiffness)
    assert np.ptp(places[2000:, 0]) < bound * 0.01
    assert places[-1, 0] - rest.REST_POSITION[0] - HALF < bound
