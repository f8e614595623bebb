"""The operator ``human``: reaches, errors, corrections, tremor; the same bits in any blocks."""

import math
from collections.abc import Callable
from itertools import islice, pairwise
from typing import Any

import numpy as np
import pytest

from held_master import HeldMaster
from teleop_core.base import build
from teleop_core.hand.master.haptic_master import HapticMasterParameters
from teleop_core.hand.operators import OPERATORS, Setting
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.human import HumanParameters, Submovement, submovements, tremor
from teleop_core.kernels.geometry import Array

SIZE, ROTATION, APPROACH = (0.06, 0.05, 0.04), 0.2, 2.0
CENTER, TILT = (0.01, -0.02, 0.03), (-0.5, 0.1, 0.2)
EXACT: dict[str, Any] = {"shortfall": 0.0, "noise_along": 0.0, "noise_across": 0.0, "corrections": 0}


def region(**values: object) -> OperatorParameters:
    given = {
        "kind": "human",
        "size": SIZE,
        "rotation": ROTATION,
        "approach_time": APPROACH,
        "center": CENTER,
        "tilt": TILT,
    }
    return build(OperatorParameters, given | values)


def motion(
    seed: int = 1, parameters: HumanParameters | None = None, **values: float | tuple[float, float, float]
) -> Callable[..., Any]:
    setting = Setting(region(**values), np.zeros((6, 4)), seed)
    return OPERATORS.find("human").make(parameters or HumanParameters(), setting)


def reaches(count: int, parameters: HumanParameters, seed: int = 1, **values: object) -> list[Submovement]:
    """The first submovements."""
    plan = submovements(parameters, region(**values), np.random.default_rng(seed))
    return list(islice(plan, count))


@pytest.mark.parametrize("size", [1, 13, 1000, 7000])
def test_motion_is_the_same_to_the_bit_in_blocks_of_any_size(size: int) -> None:
    times = np.arange(1, 7001) * 1e-3 + APPROACH
    whole, asked = motion()(times), motion()
    parts = [asked(times[i : i + size]) for i in range(0, len(times), size)]
    assert np.array_equal(np.concatenate(parts), whole)


def test_motion_asked_for_an_earlier_time_begins_anew() -> None:
    times = np.arange(0.0, 30.0, 0.01)
    asked = motion()
    first = asked(times)
    asked(times + 100.0)
    assert np.array_equal(asked(times), first)


def test_hand_starts_at_rest_and_has_approached_the_centre_in_time() -> None:
    rows = motion(parameters=HumanParameters(tremor=0.0))(np.array([0.0, APPROACH]))
    assert not rows[0].any()
    np.testing.assert_allclose(rows[1, :6], (*CENTER, *TILT), atol=1e-12)


def test_hand_without_noise_never_leaves_its_region() -> None:
    times = np.arange(APPROACH, 120.0, 0.01)
    parameters = HumanParameters(**EXACT, overlap=0.0)
    rows = motion(parameters=parameters)(times)
    offsets = np.abs(rows[:, :6] - np.concatenate((CENTER, TILT)))
    assert (offsets <= np.array((*SIZE, *[2.0 * ROTATION] * 3)) / 2.0 + 1e-9).all()
    assert (offsets.max(axis=0) > 0.5 * np.array((*SIZE, *[ROTATION] * 3)) / 2.0).all()


def test_hand_keeps_to_its_region_but_for_its_errors() -> None:
    times = np.arange(APPROACH, 300.0, 0.01)
    offsets = np.abs(motion()(times)[:, :3] - CENTER)
    assert (offsets <= np.array(SIZE) / 2.0 + 0.01).all()


def test_submovements_begin_one_after_the_other() -> None:
    found = reaches(500, HumanParameters())
    assert (np.diff([one.begin for one in found]) > 0.0).all()
    assert min(one.duration for one in found) > 0.0


def test_correction_begins_a_reaction_time_after_the_eye_could_see_the_error() -> None:
    parameters = HumanParameters(passing=0.0, dwell_time=10.0, dwell_spread=0.0)
    found = reaches(400, parameters)
    starts = [(a, b.begin - a.begin) for a, b in pairwise(found)]
    corrections = [(a, wait) for a, wait in starts if wait < 5.0]
    assert len(corrections) > 20
    for before, wait in corrections:
        seen = 0.5 * before.duration + parameters.reaction_time
        assert wait == pytest.approx(min(before.duration, seen))


def test_end_of_a_movement_is_off_in_proportion_to_its_speed() -> None:
    parameters = HumanParameters(shortfall=0.0, corrections=0, noise_along=0.03, noise_across=0.0)
    exact = HumanParameters(shortfall=0.0, corrections=0, noise_along=0.0, noise_across=0.0)
    # The same random numbers lead to the same first target.
    ratios = []
    for seed in range(400):
        (aimed,), (found,) = (reaches(1, p, seed) for p in (exact, parameters))
        way = np.linalg.norm(aimed.step[:3])
        off = (found.step[:3] - aimed.step[:3]) @ aimed.step[:3] / way
        ratios.append(off / (way / found.duration))
    assert np.std(ratios) == pytest.approx(0.03, rel=0.15)
    assert abs(np.mean(ratios)) < 0.006


def test_far_targets_take_longer_by_a_time_per_bit() -> None:
    parameters = HumanParameters(time_spread=0.0, **EXACT)
    for one in reaches(100, parameters):
        bits = np.log2(np.linalg.norm(one.step[:3]) / parameters.width + 1.0)
        expected = parameters.movement_time + parameters.time_per_bit * bits
        assert one.duration == pytest.approx(expected)


def test_hand_without_room_holds_still_but_for_its_tremor() -> None:
    rows = motion(size=(0.0, 0.0, 0.0), rotation=0.0)(np.arange(5.0, 60.0, 0.01))
    assert not np.ptp(rows[:, :3], axis=0).any()
    assert 63e-6 < np.sqrt((rows[:, 9:] ** 2).sum(axis=1).mean()) < 90e-6


def test_tremor_has_its_size_in_its_band_and_a_spectrum_that_falls_off_smoothly_beside_it() -> None:
    density: Any
    times, density, size = np.arange(0.0, 100.0, 1e-3), 0.0, 0.0
    for seed in range(20):
        shaking = tremor(63e-6, np.random.default_rng(seed))(times)
        power = (np.abs(np.fft.rfft(shaking, axis=0)) ** 2).sum(axis=1) * 2.0 / len(times) ** 2
        frequency = np.fft.rfftfreq(len(times), 1e-3)
        size = math.sqrt(power[(frequency >= 8.0) & (frequency <= 12.0)].sum())
        assert size == pytest.approx(63e-6, rel=0.1)
        density = density + power
    found = [density[np.abs(frequency - middle) < 0.5].sum() for middle in range(6, 19)]
    peak = int(np.argmax(found))
    assert 9 <= 6 + peak <= 11
    falling = np.array(found[6:])  # from 12 Hz on
    assert (falling[:-1] > 0.9 * falling[1:]).all()
    assert 3.0 < found[4] / found[8] < 20.0  # 10 over 14 Hz: 160 and more of a box


def resting(kind: str, **device: object) -> Array:
    """Reading (N, 3) [m] of ten seconds of a hand that rests in the device."""
    values = {"kind": kind, "size": (0.0, 0.0, 0.0), "rotation": 0.0, "patience": 0.0}
    person = build(OperatorParameters, values)
    master = HeldMaster(person, build(HapticMasterParameters, device))
    out = np.empty((10_000, 3))
    for tick in range(len(out)):
        master.prepare(1)
        master.signals["now_ns"] = (tick + 1) * 1_000_000
        master.step()
        out[tick] = master.signals["master_measured_cp"][:3]
    return out[5000:]


def in_tremor_band(places: Array) -> float:
    spectrum = np.abs(np.fft.rfft(places - places.mean(axis=0), axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(places), 1e-3)
    in_band = (frequency >= 8.0) & (frequency <= 12.0)
    return float(np.sqrt(2.0 * spectrum[in_band].sum()) / len(places))


def test_tremor_of_a_resting_human_is_in_the_reading_in_spite_of_friction_and_steps() -> None:
    assert in_tremor_band(resting("human")) == pytest.approx(63e-6, rel=0.15)
    assert in_tremor_band(resting("hold")) < 30e-6
