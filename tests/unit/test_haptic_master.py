"""Haptic master: the published device, a hand that gives way, tremor, buttons, same bits again."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import periodogram
from scipy.spatial.transform import Rotation

from held_master import HeldMaster
from teleop_core.base import build
from teleop_core.hand.master import hand_mechanics, haptic_master
from teleop_core.hand.master.device import DeviceParameters
from teleop_core.hand.operators import OPERATORS, Setting, register_operator
from teleop_core.hand.operators.behaviour import OperatorParameters, PressParameters
from teleop_core.hand.operators.rest import REST_POSITION, REST_TILT
from teleop_core.hand.operators.shapes import PHASES
from teleop_core.kernels import Array, records

RESOLUTION, NOISE, PEAK = 0.055e-3, 2e-3, 3.3
REST = Rotation.from_euler("x", REST_TILT)
QUIET: dict[str, Any] = {"position_resolution": 0.0, "gimbal_noise": 0.0}
COLD, FRICTION = {"continuous_force": PEAK}, 0.26
TOPICS = ("master_measured_cp", "master_measured_cv", "master_measured_cf", "master_buttons")


def operator(**values: str | float | tuple[float, ...]) -> OperatorParameters:
    return build(OperatorParameters, values)


STILL = operator(kind="hold", rotation=0.0)


def held(given: tuple[OperatorParameters, haptic_master.HapticMasterParameters]) -> Any:
    """Device and operator of given parameters."""
    return HeldMaster(*given)


def parameters(
    *,
    seed: int = 1,
    device: Mapping[str, Any] | None = None,
    hand: dict[str, float] | None = None,
    operator: OperatorParameters = STILL,
    buttons: dict[str, tuple[float, ...]] | None = None,
) -> Any:
    """Those of the operator and of the device; ``tremor_…`` of the hand are the operator's."""
    own: dict[str, Any] = {k: v for k, v in (hand or {}).items() if k.startswith("tremor")}
    rest = {k: v for k, v in (hand or {}).items() if k not in own}
    person = replace(operator, seed=seed, patience=0.0, buttons=PressParameters(**(buttons or {})), **own)
    return person, haptic_master.HapticMasterParameters(
        seed=seed, device=DeviceParameters(**(device or {})), hand=hand_mechanics.HandParameters(**rest)
    )


def wanted_places(wanted: OperatorParameters, ticks: int, seed: int = 1) -> Array:
    """Places (ticks, 3) [m] that the operator wants, tick by tick, in the master's base."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, PHASES)
    setting = Setting(wanted, phases, seed)
    motion = OPERATORS.find(wanted.kind.kind).make(wanted.kind.parameters, setting)
    return motion(np.asarray(1e-3 * np.arange(1, ticks + 1), np.float64))[:, :3] + REST_POSITION


def run(master: HeldMaster, ticks: int, force: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    """Signals of the next ticks (ticks,) under a constant commanded force [N]."""
    out = records(master.signals.dtype, ticks)
    for i in range(ticks):
        master.signals["master_servo_cf"][:3] = force
        master.step()
        out[i] = master.signals
    return out


def places(signals: NDArray[np.void]) -> Array:
    return signals["master_measured_cp"][:, :3]


def wobble(signals: NDArray[np.void]) -> Array:
    """Rotation vectors of the stylus readings against its rest, (N, 3)."""
    readings = Rotation.from_quat(signals["master_measured_cp"][:, 3:], scalar_first=True)
    return (REST.inv() * readings).as_rotvec()


@pytest.mark.parametrize("force", [(3.0, 0, 0), (5.0, 0, 0), (3, -3, 3), (0, 0, -1e6), (0, 0, 0)])
def test_applied_force_is_the_commanded_one_up_to_the_peak_and_in_its_direction(
    force: tuple[float, int, float],
) -> None:
    applied = run(held(parameters()), 1, force)["master_measured_cf"][0]
    size = np.linalg.norm(force)
    expected = np.array(force) * min(1.0, PEAK / size if size else 1.0)
    assert np.allclose(applied[:3], expected, rtol=1e-15, atol=0)
    assert not applied[3:].any()


def test_readings_are_multiples_of_the_resolution_within_half_of_it_of_the_tip() -> None:
    master, found = held(parameters(operator=operator(kind="random", approach_time=0.5))), []
    for _ in range(3000):
        found.append(places(run(master, 1))[0])
        assert np.abs(found[-1] - master.state["position"]).max() <= 0.5 * RESOLUTION + 1e-15
    counts = np.array(found) / RESOLUTION
    # A reading of 0.1 m is 2000 steps, known to 1e-12 of a step.
    assert np.abs(counts - np.round(counts)).max() < 1e-10
    assert len(np.unique(np.round(counts))) > 100


def test_gimbal_noise_is_white_fills_its_bounds_and_never_leaves_them() -> None:
    turns = wobble(run(held(parameters()), 5000))
    # Turns about three axes of 2e-3 rad mix by their product, 4e-6 rad.
    assert np.abs(turns).max() < NOISE + 4e-6
    assert (np.abs(turns).max(axis=0) > 0.99 * NOISE).all()
    # Two standard deviations are the bound, the rest is clipped: 0.48 of the bound.
    assert np.allclose(turns.std(axis=0), 0.48 * NOISE, rtol=0.05, atol=0)
    assert np.abs(turns.mean(axis=0)).max() < 4 * 0.48 * NOISE / math.sqrt(5000)
    lagged = np.corrcoef(turns[1:, 0], turns[:-1, 0])[0, 1]
    assert abs(lagged) < 4.0 / math.sqrt(5000)


def hand_gain(hertz: float, hand: hand_mechanics.HandParameters, device: DeviceParameters, axis: int) -> float:
    """Amplitude of the reading over that of the wanted place, without friction: two masses."""
    s = 2j * math.pi * hertz
    pull = hand.stiffness + hand.damping * s
    joint = device.stiffness[axis] + device.structure_damping * s
    own = device.apparent_mass * s**2 + joint
    return abs(pull * joint / ((hand.mass * s**2 + pull + joint) * own - joint**2))


@pytest.mark.parametrize("middle", [9.0, 10.0, 11.0])
def test_tremor_has_its_peak_in_the_band_with_the_wanted_amplitude(middle: float) -> None:
    hand = {"tremor_amplitude": 0.5e-3, "tremor_frequency": middle}
    device = {**QUIET, "friction": 0.0}
    signals = run(held(parameters(device=device, hand=hand)), 20_000)
    motion = places(signals)[1000:] - REST_POSITION
    for axis in range(3):
        frequency, power = periodogram(motion[:, axis], 1000.0)
        assert abs(frequency[power.argmax()] - middle) <= 2.0
        band = (frequency > middle - 2.5) & (frequency < middle + 2.5)
        assert power[band].sum() > 0.95 * power.sum()
    amplitude = math.sqrt(2.0) * motion.std(axis=0)
    gains = [hand_gain(middle, hand_mechanics.HandParameters(), DeviceParameters(), axis) for axis in range(3)]
    # The line wanders by ±2 Hz, over which the gain changes by a third.
    assert np.allclose(amplitude, 0.5e-3 * np.array(gains), rtol=0.1, atol=0)


def test_axes_tremble_independently() -> None:
    hand = {"tremor_amplitude": 0.5e-3}
    motion = places(run(held(parameters(device=QUIET, hand=hand)), 20_000))[1000:]
    between = np.asarray(np.corrcoef(motion.T))[np.triu_indices(3, 1)]
    # Lines that wander over ±2 Hz forget their phase in about 0.2 s: 100 independent pieces.
    assert np.abs(between).max() < 0.4


def test_without_tremor_and_noise_a_still_hand_is_perfectly_still() -> None:
    device = {"gimbal_noise": 0.0}
    signals = run(held(parameters(device=device, hand={"tremor_amplitude": 0.0})), 500)
    assert not np.diff(signals["master_measured_cp"], axis=0).any()
    assert not signals["master_measured_cv"].any()


@pytest.mark.parametrize(("stiffness", "force"), [(100.0, (1.0, 0, 0)), (300.0, (0, -2.0, 0)), (1000.0, (0, 0, 3.0))])
def test_hand_and_device_give_way_by_force_over_stiffness_but_for_friction(
    stiffness: float, force: tuple[float, float, float]
) -> None:
    hand = {"tremor_amplitude": 0.0, "stiffness": stiffness}
    device = {**QUIET, "start": (0.0, 0.0, 0.0), **COLD}
    master = held(parameters(device=device, hand=hand))
    run(master, 5000, force)
    given, structure = master.state["hand"] - REST_POSITION, np.array(DeviceParameters().stiffness)
    pull = stiffness * given
    assert np.linalg.norm(np.array(force) - pull) <= FRICTION * (1.0 + 1e-6)
    bend = master.state["position"] - master.state["hand"]
    assert np.allclose(bend, pull / structure, rtol=1e-6, atol=1e-9)
    assert np.abs(master.state["speed"]).max() < 1e-12


@pytest.mark.parametrize("stiffness", [(1260.0, 2310.0, 1020.0), (1e7, 1e6, 1e5)])
def test_two_masses_move_exactly_under_a_force_that_is_held_for_a_tick(stiffness: tuple[float, float, float]) -> None:
    """Against the exponential of their own equations, tick by tick, axis by axis."""
    hand = hand_mechanics.HandParameters()
    frictionless: dict[str, Any] = {**QUIET, **COLD, "friction": 0.0, "stiffness": stiffness}
    device = DeviceParameters(**frictionless)
    master = haptic_master.HapticMaster(haptic_master.HapticMasterParameters(device=device, hand=hand))
    forces = np.random.default_rng(6).normal(0.0, 0.5, (300, 3))
    expected = np.zeros((3, 4))  # places of device and hand, their speeds
    steps = []
    for k in stiffness:
        bend, damping = k * np.array([1, -1]), device.structure_damping * np.array([1, -1])
        rates = np.zeros((5, 5))
        rates[0, 2] = rates[1, 3] = 1.0
        rates[2, :4] = -np.r_[bend, damping] / device.apparent_mass
        rates[2, 4] = 1.0 / device.apparent_mass
        rates[3, :4] = np.r_[bend, damping] / hand.mass
        rates[3, 1] -= hand.stiffness / hand.mass
        rates[3, 3] -= hand.damping / hand.mass
        steps.append(expm(rates * 1e-3))
    master.prepare(len(forces))
    tick = master.load()
    for i, force in enumerate(forces):
        master.signals["hand_servo_cp_ns"] = i + 1
        master.signals["master_servo_cf"][:3] = force
        tick()
        expected = np.array(
            [(step @ [*state, push])[:4] for step, state, push in zip(steps, expected, force, strict=True)]
        )
        for name, column in (("position", 0), ("hand", 1)):
            moved = master.state[name] - REST_POSITION
            assert np.abs(moved - expected[:, column]).max() < 1e-11, (i, name)
    assert np.abs(expected[:, 0]).max() > 1e-4


def test_wanted_path_is_followed() -> None:
    path = operator(kind="circle", center=(0.0, 0.0, 0.03), approach_time=1.0, period=8.0)
    master = held(parameters(operator=path, device=QUIET, hand={"tremor_amplitude": 0.0}))
    wanted = wanted_places(path, 10_000)
    off = np.linalg.norm(places(run(master, 10_000)) - wanted, axis=1)
    # Backdrive friction of 0.26 N against the hand's 300 N/m.
    assert off.max() < 1.1 * 0.26 / 300.0 * math.sqrt(3.0)


def test_tip_stops_at_the_ends_of_the_workspace() -> None:
    far = operator(kind="hold", center=(0.2, -0.2, 0.2), approach_time=0.5, rotation=0.0)
    last = run(held(parameters(operator=far, device=QUIET)), 2000)[-1:]
    middle = np.subtract(REST_POSITION, (0.0, 0.0, -0.03))
    expected = middle + 0.5 * np.array((0.16, -0.12, 0.07))
    assert np.allclose(places(last)[0], expected, rtol=0, atol=1e-15)
    assert np.abs(last["master_measured_cv"][0, :3]).max() < 1e-9


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_tip_at_its_stop_is_at_rest(sign: float) -> None:
    far = operator(kind="hold", center=(0.2 * sign,) * 3, approach_time=0.5, rotation=0.0)
    master = held(parameters(operator=far, device=QUIET, hand={"tremor_amplitude": 0.0}))
    run(master, 2000)
    # The hand still pulls with 20 N; what it would gather against the stop is not kept, and bends
    # nothing between hand and device.
    assert not master.state["speed"].any()
    assert np.array_equal(master.state["hand"], master.state["position"])


def test_a_push_below_the_friction_moves_the_device_nowhere() -> None:
    master = held(parameters(device=QUIET, hand={"tremor_amplitude": 0.0}))
    run(master, 100)
    before = master.state["position"].copy()
    run(master, 2000, (0.9 * FRICTION, 0.0, 0.0))
    assert np.array_equal(master.state["position"], before)


def test_tip_leaves_its_stop_again() -> None:
    points = (0.2, 0.0, 0.0, 0.0, 0.0, 0.0)
    path = operator(kind="points", points=points, approach_time=0.1, period=1.5)
    signals = run(held(parameters(operator=path, device=QUIET)), 4000)
    assert math.isclose(places(signals)[:, 0].max(), 0.08, abs_tol=1e-12)
    assert abs(places(signals)[-1, 0]) < 1e-3


def test_master_starts_at_rest_in_the_inkwell_and_its_first_reading_reports_no_motion() -> None:
    master = held(parameters(operator=operator(), device={"gimbal_noise": 0.0}))
    start = master.signals["master_measured_cp"].copy()
    assert np.allclose(start[3:], REST.as_quat(scalar_first=True), rtol=0, atol=1e-15)
    assert np.abs(start[:3] - REST_POSITION).max() <= 0.5 * RESOLUTION
    first = run(master, 20)
    assert np.array_equal(places(first)[0], start[:3])
    assert not first["master_measured_cv"][0].any()
    # One step of the reading at most; the tremor starts from nothing too.
    assert np.abs(places(first) - REST_POSITION).max() <= RESOLUTION
    assert np.abs(wobble(first)).max() < 1e-6


def test_twist_is_the_filtered_rate_of_the_readings() -> None:
    path = operator(kind="circle", center=(0.0, 0.0, 0.03), approach_time=1.0, period=4.0)
    master = held(parameters(operator=path, device=QUIET, hand={"tremor_amplitude": 0.0}))
    signals = run(master, 4000)
    rate = np.gradient(places(signals), 1e-3, axis=0)[2000:3990]
    # 5 ms late and half a tick early: 4.5 ms of the rate's own change.
    late = np.roll(signals["master_measured_cv"][:, :3], -5, axis=0)[2000:3990]
    assert np.abs(rate - late).max() < 1e-4
    assert np.abs(rate).max() > 0.02


def test_turning_rate_is_that_of_the_stylus_in_base_axes() -> None:
    path = operator(kind="hold", tilt=(0.0, 0.0, 1.0), approach_time=2.0, rotation=0.0)
    signals = run(held(parameters(operator=path, device=QUIET)), 1500)
    about_stylus_z = REST.apply((0.0, 0.0, 1.0))
    measured = signals["master_measured_cv"][1000, 3:]
    # Peak of the smooth step in its middle: 1.875 times the mean of 0.5 rad/s.
    assert np.allclose(measured, 0.9375 * about_stylus_z, rtol=0, atol=1e-3)


def test_turning_rate_does_not_see_that_opposite_quaternions_are_one_attitude(own_parts: None) -> None:
    rate = 3.0

    def wrapped(times: Array) -> Array:
        angle = (rate * times + math.pi) % (2.0 * math.pi) - math.pi
        return np.column_stack((np.zeros((len(times), 5)), angle))

    register_operator("turning", wrapped)
    device = {**QUIET, "position_resolution": 0.0}
    signals = run(held(parameters(operator=operator(kind="turning"), device=device)), 3000)
    # The stylus goes on turning where its rotation vector jumps by a revolution: twice here.
    readings = signals["master_measured_cp"][:, 3:]
    assert np.count_nonzero((readings[1:] * readings[:-1]).sum(axis=1) < 0.0) >= 1
    # Twice the vector part in place of the angle: (3e-3)**2 / 24 of it.
    expected = REST.apply((0.0, 0.0, rate))
    assert np.allclose(signals["master_measured_cv"][500:, 3:], expected, rtol=0, atol=1e-5)


def test_buttons_are_pressed_at_their_times() -> None:
    buttons = {"clutch": (0.1, 0.3), "fixture": (0.2,), "mode": (0.05, 0.4)}
    pressed = run(held(parameters(buttons=buttons)), 600)["master_buttons"]
    at = [np.flatnonzero(column) + 1 for column in pressed.T]  # tick k has the time k ms
    assert np.array_equal(at[0], np.arange(100, 300))
    for column, starts in ((1, (200,)), (2, (50, 400))):
        edges = at[column][np.diff(at[column], prepend=-10) > 1]
        assert np.array_equal(edges, starts)
        # 0.1 s; a tick more or less by rounding of its end.
        assert abs(len(at[column]) - 100 * len(starts)) <= len(starts)


def test_presses_need_no_order() -> None:
    pressed = run(held(parameters(buttons={"mode": (0.3, 0.05)})), 400)["master_buttons"]
    assert np.count_nonzero(np.diff(pressed[:, 2]) > 0) == 2


RANDOM = operator(kind="random", approach_time=0.5)


@pytest.mark.parametrize("sizes", [(1,) * 50, (7, 993, 1000), (1000,) * 3, (999, 1)])
def test_what_the_operator_wants_does_not_depend_on_the_blocks_it_is_drawn_in(sizes: tuple[int, ...]) -> None:
    buttons = {"clutch": (0.5, 1.0), "mode": (0.02,)}
    one_by_one = run(held(parameters(operator=RANDOM, buttons=buttons)), sum(sizes))
    master = held(parameters(operator=RANDOM, buttons=buttons))
    blocks = []
    for size in sizes:
        master.prepare(size)
        blocks.append(run(master, size))
    for topic in TOPICS:
        assert np.array_equal(np.concatenate(blocks)[topic], one_by_one[topic]), topic


def test_new_hand_is_felt_from_the_next_tick_and_does_not_jump() -> None:
    master = held(parameters(operator=RANDOM, device=QUIET))
    before = places(run(master, 1000))
    stiff = hand_mechanics.HandParameters(stiffness=2000.0, damping=30.0)
    master.device.retune(haptic_master.HapticMasterParameters(hand=stiff, device=DeviceParameters(**QUIET)))
    after = places(run(master, 200))
    assert np.abs(after[0] - before[-1]).max() < 2e-4
    off = after - wanted_places(RANDOM, 1200)[1000:]
    # Friction of 0.26 N and the tremor's tenth of a millimetre against 2000 N/m.
    assert np.abs(off[-50:]).max() < 0.5e-3


EXTREMES = [
    {"mass": 0.01, "damping": 200.0},
    {"mass": 0.01, "damping": 200.0, "stiffness": 5000.0},
    {"mass": 0.01, "damping": 0.1, "stiffness": 5000.0},
    {"mass": 5.0, "damping": 0.1, "stiffness": 1.0},
    {"mass": 0.01, "damping": 0.1, "stiffness": 1.0},
]


@pytest.mark.parametrize("friction", [0.0, 5.0])
@pytest.mark.parametrize("hand", EXTREMES)
def test_hand_at_the_edge_of_its_parameters_stays_where_it_wants_to_be(hand: dict[str, float], friction: float) -> None:
    device = {**QUIET, "apparent_mass": 1e-3, "friction": friction}
    calm = {"stiffness": 300.0, **hand, "tremor_amplitude": 0.0}
    master = held(parameters(device=device, hand=calm))
    push, width = 0.5, 0.16
    moved = np.empty((1030, 3))
    for i in range(1030):
        run(master, 1, (push if i < 30 else 0.0, 0.0, 0.0))
        moved[i] = np.abs(master.state["hand"] - REST_POSITION)
    # A spring swings at most twice as far as it gives way; the device has its stops.
    assert moved.max() <= min(2.1 * push / calm["stiffness"], 0.5 * width)
    # With damping c the tap of 30 ms goes no further than its momentum over c.
    # Friction may hold the device, and so the hand, where it is then.
    reach = 1.01 * push * 0.030 / calm["damping"]
    assert moved.max() <= reach or calm["damping"] < 200.0 or friction > 0.0
    assert not moved[:, 1:].any()
