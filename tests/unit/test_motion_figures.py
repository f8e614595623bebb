"""Figures of motion: those of others' formulas, of known motions, the same at any rate."""

import math

import numpy as np
import pytest
from scipy import signal
from scipy.spatial.transform import Rotation

from present import present
from teleop_core.evaluation import motion_measures
from teleop_core.evaluation.motion_figures import NAMES, Kinematics, MotionFigures
from teleop_core.evaluation.motion_samples import MotionSamples
from teleop_core.kernels.geometry import Array

# The bell of the documentation of the authors' own program, and what that gives for it.
BELL = np.exp(-5.0 * np.arange(-1.0, 1.0, 0.01) ** 2)
BELL_SPARC, BELL_LDLJ = -1.41403, -5.81636
DECIMALS = 5e-6
# Linear interpolation to 30 Hz of motion below 3 Hz.
INTERPOLATION = 0.05


def motion_figures(times: Array, place: Array) -> MotionFigures:
    """Figures of a motion that does not turn."""
    samples = MotionSamples()
    samples.add(times, np.hstack((place, np.tile((1.0, 0.0, 0.0, 0.0), (len(times), 1)))))
    found = Kinematics(samples)
    return found.figures(found.everything)


def hand(times: Array, seed: int = 1) -> Array:
    """A hand that waves at some frequencies below 3 Hz: places (N, 3) [m]."""
    rng = np.random.default_rng(seed)
    rates, phases = rng.uniform(0.2, 2.5, (3, 6)), rng.uniform(0.0, 2.0 * math.pi, (3, 6))
    waves = np.sin(2.0 * math.pi * rates * times[:, None, None] + phases) / rates
    return 3e-3 * waves.sum(axis=2)


def test_spectral_arc_length_is_that_of_its_authors() -> None:
    assert motion_measures.sparc(BELL, 100.0) == pytest.approx(BELL_SPARC, abs=DECIMALS)


def test_log_dimensionless_jerk_is_that_of_its_authors() -> None:
    assert motion_measures.log_dimensionless_jerk(BELL[:, None], 100.0) == pytest.approx(BELL_LDLJ, abs=DECIMALS)


@pytest.mark.parametrize("factor", [0.01, 300.0])
def test_smoothness_does_not_depend_on_the_size_of_a_motion(factor: float) -> None:
    assert motion_measures.sparc(factor * BELL, 100.0) == pytest.approx(BELL_SPARC, abs=DECIMALS)
    scaled = motion_measures.log_dimensionless_jerk(factor * BELL[:, None], 100.0)
    assert scaled == pytest.approx(BELL_LDLJ, abs=DECIMALS)


def test_two_strokes_are_less_smooth_than_one() -> None:
    twice = np.concatenate((BELL, np.zeros(50), BELL))
    assert present(motion_measures.sparc(twice, 100.0)) < BELL_SPARC - 0.5


def test_motion_at_rest_has_no_smoothness() -> None:
    assert motion_measures.sparc(np.zeros(100), motion_measures.RATE) is None
    assert motion_measures.log_dimensionless_jerk(np.zeros((100, 3)), motion_measures.RATE) is None


@pytest.mark.parametrize("count", [300, 1800])
def test_spectrum_is_that_of_scipy(count: int) -> None:
    velocity = np.random.default_rng(3).standard_normal((count, 3))
    frequency, density = motion_measures.velocity_spectrum([velocity])
    expected_frequency, expected = signal.welch(velocity, motion_measures.RATE, nperseg=256, axis=0)
    np.testing.assert_allclose(frequency, expected_frequency)
    np.testing.assert_allclose(density, expected.sum(axis=1), rtol=1e-9)


@pytest.mark.parametrize("seed", range(40))
def test_peaks_are_those_whose_prominence_scipy_finds_as_large(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal(int(rng.integers(3, 90)))
    values = np.cumsum(values) if seed % 2 else values
    swing = float(rng.uniform(0.1, 2.0))
    peaks, valleys = motion_measures.turning_points(values, swing)
    assert peaks == signal.find_peaks(values, prominence=swing)[0].tolist()
    assert valleys == signal.find_peaks(-values, prominence=swing)[0].tolist()


def test_plateau_is_one_peak() -> None:
    assert motion_measures.turning_points(np.array([0.0, 2.0, 2.0, 2.0, 0.0, 2.0, 0.0]), 1.0) == ([1, 5], [4])


def test_each_bell_of_speed_is_a_submovement() -> None:
    speed = 0.05 * np.tile(BELL[::7], 4)
    assert len(motion_measures.submovements(speed)) == 4
    assert not motion_measures.submovements(0.1 * speed)


def test_reversals_are_the_turns_of_every_axis() -> None:
    times = np.arange(0.0, 10.0, 1.0 / motion_measures.RATE)
    wave = np.sin(2.0 * math.pi * 0.5 * times)
    place = np.column_stack((5e-3 * wave, 0.5e-3 * wave, 0.0 * wave))
    assert motion_measures.reversals(place) == 10


@pytest.mark.parametrize("axis", [[1.0, 0.0, 0.0], [0.6, 0.0, 0.8]])
def test_turn_rate_is_that_of_a_steady_turn_whatever_the_signs(axis: list[float]) -> None:
    angles = np.arange(0.0, 7.0, 0.02)
    turns = Rotation.from_rotvec(angles[:, None] * axis).as_quat(scalar_first=True)
    turns[::3] *= -1.0
    np.testing.assert_allclose(motion_measures.turn_rates(turns), 0.02 * motion_measures.RATE, rtol=1e-6)


@pytest.mark.parametrize("rate", [100.0, 609.0, 1000.0])
@pytest.mark.parametrize("frequency", [8.6, 10.0, 11.4])
def test_tremor_is_the_root_mean_square_of_a_wave_in_its_band(rate: float, frequency: float) -> None:
    times = np.arange(0.0, 20.0, 1.0 / rate)
    place = hand(times)
    place[:, 1] += 100e-6 * np.sin(2.0 * math.pi * frequency * times)
    found = motion_figures(times, place)
    assert found.tremor_um == pytest.approx(100.0 / math.sqrt(2.0), rel=0.02)


@pytest.mark.parametrize("frequency", [5.0, 15.0])
def test_waves_beside_the_band_are_no_tremor(frequency: float) -> None:
    times = np.arange(0.0, 5.0, 1e-3)
    wave = np.sin(2.0 * math.pi * frequency * times)
    assert motion_measures.tremor_power(1e-3 * wave[:, None], 1000.0) < (1e-6) ** 2


def test_seconds_of_rest_have_a_tremor_of_their_own() -> None:
    times = np.arange(0.0, 40.01, 1e-3)
    shaking = 80e-6 * np.sin(2.0 * math.pi * 10.0 * times)
    place = np.column_stack((np.where(times < 20.0, 0.0, shaking), 0.0 * times, 0.0 * times))
    place[:, 2] = np.where(times < 20.0, 0.02 * np.sin(times), 0.02 * math.sin(20.0))
    found = motion_figures(times, place)
    assert found.tremor_at_rest_um == pytest.approx(80.0 / math.sqrt(2.0), rel=0.05)
    assert found.tremor_um == pytest.approx(80.0 / 2.0, rel=0.05)


@pytest.mark.parametrize("rate", [30.0, 36.0])
def test_tremor_is_unknown_where_the_rate_cannot_carry_it(rate: float) -> None:
    times = np.arange(0.0, 20.0, 1.0 / rate)
    assert motion_figures(times, hand(times)).tremor_um is None


def test_circle_has_the_speed_of_its_angle_and_radius() -> None:
    times = np.arange(0.0, 20.0, 1e-3)
    angle = 2.0 * math.pi * 0.5 * times
    place = 0.01 * np.column_stack((np.cos(angle), np.sin(angle), 0.0 * angle))
    found, speed = motion_figures(times, place), 10.0 * math.pi
    assert found.speed_median_mm_s == pytest.approx(speed, rel=0.01)
    assert found.path_mm == pytest.approx(20.0 * speed, rel=0.01)
    assert found.idle_share == 0.0
    assert found.frequency_50_hz == pytest.approx(0.5, abs=motion_measures.RATE / 256)
    assert found.acceleration_p95_m_s2 == pytest.approx(1e-3 * speed * math.pi, rel=0.02)


@pytest.mark.parametrize("rate", [30.0, 36.0, 100.0, 609.0])
def test_figures_are_the_same_at_any_rate_with_irregular_stamps(rate: float) -> None:
    rng = np.random.default_rng(5)
    steps = rng.uniform(0.9, 1.1, int(30.0 * rate)) / rate
    times = np.cumsum(steps)
    found, expected = (motion_figures(t, hand(t)) for t in (times, np.arange(0.0, 30.0, 1e-3)))
    for name in ("speed_median_mm_s", "speed_p95_mm_s", "path_mm", "sparc", "power_1_3"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=INTERPOLATION)
    assert found.frequency_50_hz == expected.frequency_50_hz


@pytest.mark.parametrize("pieces", [1, 7, 400])
def test_figures_do_not_depend_on_how_samples_are_handed_over(pieces: int) -> None:
    times = np.arange(0.0, 21.0, 1e-3)
    rows = np.hstack((hand(times), np.tile((1.0, 0.0, 0.0, 0.0), (len(times), 1))))
    samples = MotionSamples()
    for part in np.array_split(np.arange(len(times)), pieces):
        samples.add(times[part], rows[part])
    found = Kinematics(samples)
    assert found.figures(found.everything) == motion_figures(times, rows[:, :3])


def test_gap_is_neither_time_nor_way() -> None:
    times = np.arange(0.0, 20.0, 0.01)
    place = hand(times)
    is_there = (times < 8.0) | (times > 11.0)
    moved = np.where(times[:, None] > 11.0, place + 0.5, place)
    found = motion_figures(times[is_there], moved[is_there])
    whole = motion_figures(times, place)
    assert found.time_s == pytest.approx(17.0, abs=0.1)
    assert found.path_mm < whole.path_mm
    assert found.speed_p95_mm_s == pytest.approx(whole.speed_p95_mm_s, rel=0.1)


def test_samples_that_are_no_numbers_or_not_later_are_left_out() -> None:
    times = np.arange(0.0, 20.0, 0.01)
    place = hand(times)
    spoilt_times, spoilt = times.copy(), place.copy()
    spoilt[500:505] = np.nan
    spoilt_times[900] = 3.0
    spoilt[900] = 7.0
    found, expected = motion_figures(spoilt_times, spoilt), motion_figures(times, place)
    assert found.speed_p95_mm_s == pytest.approx(expected.speed_p95_mm_s, rel=0.02)
    assert found.path_mm == pytest.approx(expected.path_mm, rel=0.02)


def test_stretches_end_where_time_is_missing() -> None:
    times = np.array([0.0, 0.1, 0.2, 3.0, 3.1])
    assert motion_measures.stretches(times) == [slice(0, 3), slice(3, 5)]
    assert motion_measures.stretches(np.empty(0)) == []


def test_nothing_has_no_figures() -> None:
    found = motion_figures(np.empty(0), np.empty((0, 3)))
    assert (found.time_s, found.path_mm, found.submovements) == (0.0, 0.0, 0)
    assert found.sparc is None
    assert "ldlj" in NAMES


def test_share_of_power_is_that_of_the_waves_in_it() -> None:
    times = np.arange(0.0, 60.0, 1.0 / motion_measures.RATE)
    velocity = np.column_stack((np.sin(2.0 * math.pi * 0.5 * times), np.sin(2.0 * math.pi * 2.0 * times)))
    frequency, density = motion_measures.velocity_spectrum([velocity])
    assert motion_measures.share_between(1.0, 3.0, frequency, density) == pytest.approx(0.5, abs=0.01)


def test_the_path_of_a_zigzag_is_not_shortened_at_its_corners() -> None:
    times = np.arange(0.0, 20.0, 1e-3)
    zigzag = 0.01 * np.abs(2.0 * (times * 3.0 % 1.0) - 1.0)  # 0.06 m/s, with corners six times a second
    place = np.column_stack((zigzag, 0.0 * times, 0.0 * times))
    assert motion_figures(times, place).path_mm == pytest.approx(20.0 * 60.0, rel=0.01)
