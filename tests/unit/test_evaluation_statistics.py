"""Evaluation: statistics, pairing and pose errors against closed forms and independent oracles."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from present import present
from teleop_core.evaluation.accumulators import Distribution, Moments
from teleop_core.evaluation.pairing import NONE, latest, same_stamp, same_tick
from teleop_core.evaluation.published import COARSE, FINE, Published, published_for
from teleop_core.evaluation.traces import BUCKETS, SAMPLES, Envelope, spacing_s
from teleop_core.evaluation.tracking import pose_errors
from teleop_core.kernels.geometry import Array

MS = 1_000_000
# Sums of some thousand squares: relative rounding stays far below.
ROUNDING = 1e-12
# Angles in degrees from quaternions with 16 digits.
DEGREES = 1e-9


def moments(*stretches: ArrayLike) -> Any:
    out = Moments()
    for stretch in stretches:
        out.add(np.asarray(stretch, float))
    return out


def poses(positions: Array, rotations: Rotation) -> Array:
    x, y, z, w = np.atleast_2d(rotations.as_quat()).T
    return np.column_stack((positions, w, x, y, z))


# -- statistics ------------------------------------------------------------------------------------


@given(st.lists(st.lists(st.floats(-1e3, 1e3), max_size=20), min_size=1, max_size=6))
def test_spread_does_not_depend_on_how_the_samples_are_cut(stretches: list[list[float]]) -> None:
    samples = np.concatenate([np.array(s, float) for s in stretches])
    spread = moments(*stretches).spread()
    if not len(samples):
        assert spread == moments().spread()
        return
    assert np.isclose(present(spread.rms), np.sqrt(np.mean(samples**2)), rtol=ROUNDING, atol=1e-150)
    assert spread.max == np.abs(samples).max()
    if len(samples) > 1:
        assert np.isclose(present(spread.sd), samples.std(ddof=1), rtol=1e-9, atol=1e-9)


def test_sample_deviation_of_a_small_error_on_a_large_mean_keeps_its_digits() -> None:
    samples = 1e6 + np.tile([1e-3, -1e-3], 5000)
    assert np.isclose(present(moments(samples[:7], samples[7:]).spread().sd), samples.std(ddof=1), rtol=1e-6)


def test_spread_without_samples_is_not_applicable() -> None:
    assert moments([]).spread() == moments([np.nan, np.inf]).spread()
    assert moments([]).spread().rms is None
    assert moments([2.0]).spread().sd is None


def test_quantiles_are_exact_to_the_microsecond_however_the_durations_are_cut() -> None:
    rng = np.random.default_rng(3)
    durations = rng.integers(-20, 9000, 5000)
    spread = Distribution()
    for part in np.array_split(durations, 7):
        spread.add(part * 1000)
    assert spread.count == 5000
    ordered = np.sort(durations)
    assert spread.quantile_us(0.5) == ordered[2499]
    assert spread.quantile_us(0.99) == ordered[4949]
    assert spread.delay().max == ordered[-1] / 1000
    few = Distribution()
    few.add(np.array([1000, 2000, 3000]))
    assert (few.quantile_us(0.5), few.quantile_us(0.1)) == (2, 1)


def test_histogram_holds_all_durations() -> None:
    spread = Distribution()
    spread.add(np.random.default_rng(4).exponential(2e6, 4000).astype(np.int64))
    middles, shares = spread.histogram(100)
    assert np.isclose(shares.sum(), 100.0)
    assert np.allclose(np.diff(middles), 0.1)
    durations = np.repeat(spread.values_us, spread.counts)  # the first bin is that of 0.1 ms from the shortest on
    assert np.isclose(shares[0], 100 * np.mean(durations < durations[0] + 100))


# -- pairing ---------------------------------------------------------------------------------------


def test_ticks_are_paired_by_order_when_the_recorder_was_held_up() -> None:
    measured = np.arange(2000) * MS
    setpoint = measured - 60_000
    held = slice(700, 707)  # seven ticks arrive at once, topic by topic
    measured, setpoint = measured.copy(), setpoint.copy()
    setpoint[held] = 706 * MS + np.arange(7) * 1000
    measured[held] = 706 * MS + 10_000 + np.arange(7) * 1000
    assert (same_tick(measured, setpoint) == np.arange(2000)).all()


def test_jitter_beyond_a_tick_does_not_mix_the_ticks() -> None:
    rng = np.random.default_rng(9)
    tick = np.arange(20_000) * MS
    is_late = rng.random(20_000) < 0.1
    late = np.where(is_late, rng.exponential(1.5 * MS, 20_000), 0).astype(np.int64)
    setpoint = np.maximum.accumulate(tick + late)
    measured = np.maximum.accumulate(setpoint + rng.integers(20_000, 120_000, 20_000))
    assert (same_tick(measured, setpoint) == np.arange(20_000)).mean() > 0.998


@pytest.mark.parametrize("offset", [0, 60_000, -60_000])
def test_pairs_stay_right_when_messages_of_either_topic_are_lost(offset: int) -> None:
    rng = np.random.default_rng(5)
    tick = np.arange(20_000)
    measured = tick[np.sort(rng.permutation(20_000)[:19_950])]
    setpoint = tick[np.sort(rng.permutation(20_000)[:19_950])]
    partner = same_tick(measured * MS, setpoint * MS + offset)
    found = partner != NONE
    wrong = setpoint[partner[found]] != measured[found]
    # Losses of both topics within three ticks of each other may shift what is between by one.
    assert wrong.mean() < 1e-3
    assert np.abs(setpoint[partner[found]] - measured[found]).max() <= 1
    assert found.sum() >= len(np.intersect1d(measured, setpoint)) - 10


def test_samples_far_apart_have_no_partner() -> None:
    assert (same_tick(np.arange(5) * MS, np.arange(5) * MS + 1000 * MS) == NONE).all()
    seldom = np.arange(9) * 1000 * MS
    assert (same_tick(seldom, seldom + 51 * MS) == NONE).all()
    assert (same_tick(seldom, seldom + 50 * MS) == np.arange(9)).all()
    assert (same_tick(np.arange(5) * MS, np.empty(0, np.int64)) == NONE).all()
    assert not len(same_tick(np.empty(0, np.int64), np.arange(5)))


def test_latest_command_is_never_from_the_future() -> None:
    stamps = np.array([5, 10, 20])
    assert latest(np.array([4, 5, 9, 10, 25]), stamps).tolist() == [NONE, 0, 0, 1, 2]
    assert latest(np.array([4, 12]), stamps[::-1]).tolist() == [NONE, 1]
    assert latest(np.array([4]), np.empty(0, np.int64)).tolist() == [NONE]


def test_same_stamp_finds_the_first_sample_that_carries_it() -> None:
    assert same_stamp(np.array([1, 3, 9]), np.array([1, 3, 3, 4])).tolist() == [0, 1, NONE]
    assert same_stamp(np.array([1]), np.empty(0, np.int64)).tolist() == [NONE]


# -- poses -----------------------------------------------------------------------------------------


def test_angle_differences_agree_with_an_independent_library() -> None:
    rng = np.random.default_rng(6)
    a = Rotation.from_euler("ZYX", rng.uniform(-1, 1, (500, 3)) * [180, 80, 180], degrees=True)
    b = Rotation.from_euler("ZYX", rng.uniform(-1, 1, (500, 3)) * [180, 80, 180], degrees=True)
    zero = np.zeros((500, 3))
    errors = pose_errors(poses(zero, a), poses(zero, b))
    difference = a.as_euler("ZYX", degrees=True) - b.as_euler("ZYX", degrees=True)
    wrapped = (difference + 180) % 360 - 180
    assert np.allclose(errors.roll_pitch_yaw_deg, wrapped, atol=1e-8)
    assert np.allclose(errors.angle_deg, np.degrees((a * b.inv()).magnitude()), atol=1e-6)
    assert not errors.is_degenerate.any()


@given(st.floats(1e-7, 179.0), st.integers(0, 10**6))
def test_angle_error_is_the_angle_of_the_turn_however_small_it_is(angle: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    b = Rotation.random(rng=rng)
    a = b * Rotation.from_rotvec(np.radians(angle) * axis / np.linalg.norm(axis))
    zero = np.zeros((1, 3))
    errors = pose_errors(poses(zero, a), poses(zero, b))
    assert np.isclose(errors.angle_deg[0], angle, atol=DEGREES * 10)


def test_sign_of_a_quaternion_and_its_length_do_not_matter() -> None:
    rng = np.random.default_rng(7)
    a, b = (poses(rng.normal(size=(50, 3)), Rotation.random(50, rng=rng)) for _ in range(2))
    flipped = a.copy()
    flipped[:, 3:] *= -1.7
    plain, other = pose_errors(a, b), pose_errors(flipped, b)
    assert np.allclose(plain.angle_deg, other.angle_deg, atol=1e-9)
    assert np.allclose(plain.roll_pitch_yaw_deg, other.roll_pitch_yaw_deg, atol=1e-9)


def test_roll_and_yaw_are_left_out_where_pitch_makes_them_meaningless() -> None:
    near = Rotation.from_euler("ZYX", [[10, 89.6, 20], [10, 88.0, 20]], degrees=True)
    turned = Rotation.from_euler("ZYX", [[60, 89.6, 70], [11, 88.0, 20]], degrees=True)
    errors = pose_errors(poses(np.zeros((2, 3)), near), poses(np.zeros((2, 3)), turned))
    assert errors.is_degenerate.tolist() == [True, False]
    off = Rotation.from_euler("ZYX", [[60, 88.0, 70], [11, 88.0, 20]], degrees=True)
    for pair in ((near, off), (off, near)):  # one of the two is enough
        mixed = pose_errors(*(poses(np.zeros((2, 3)), one) for one in pair))
        assert mixed.is_degenerate.tolist() == [True, False]
    assert np.isnan(errors.roll_pitch_yaw_deg[0, ::2]).all()
    assert np.isclose(errors.roll_pitch_yaw_deg[0, 1], 0.0, atol=1e-6)
    assert errors.angle_deg[0] < 1.0  # the two turns nearly cancel


def test_pose_without_direction_has_no_orientation_error() -> None:
    still = np.zeros((1, 7))
    reference = poses(np.zeros((1, 3)), Rotation.identity(1))
    errors = pose_errors(still, reference)
    assert errors.position_mm[0] == 0.0
    assert np.isnan(errors.angle_deg[0])


# -- published figures ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("gain", "mode"), [(1.0, COARSE), (0.5, COARSE), (2.0, COARSE), (0.1, FINE), (0.2, FINE), (None, None), (0.0, None)]
)
def test_gain_chooses_the_published_mode_of_the_source_s_robot(gain: float | None, mode: Published | None) -> None:
    assert published_for(gain) is published_for(gain, None) is published_for(gain, "rcrt1") is mode
    assert published_for(gain, "puma560") is None


# -- drawing ---------------------------------------------------------------------------------------


def test_envelope_of_ten_minutes_is_the_recording() -> None:
    times = np.arange(600_000) * MS
    values: Any = np.random.default_rng(8).normal(size=(600_000, 2)).astype(np.float32)
    envelope = Envelope(0, int(times[-1]), 2)
    for part in np.array_split(np.arange(600_000), 9):
        envelope.add(times[part], values[part])
    seconds, line = envelope.line()
    assert (line == values).all()
    assert np.allclose(seconds, np.arange(600_000) * 1e-3, rtol=0, atol=1e-9)


def test_envelope_of_a_longer_recording_keeps_every_peak() -> None:
    count = SAMPLES + 100_000
    rng = np.random.default_rng(8)
    times = np.arange(count) * MS
    values = rng.normal(size=(count, 2))
    values[43_210, 0], values[count - 10, 1] = 50.0, -60.0
    envelope = Envelope(0, int(times[-1]), 2)
    for part in np.array_split(np.arange(count), 9):
        envelope.add(times[part], values[part])
    seconds, line = envelope.line()
    assert len(line) <= 2 * BUCKETS
    assert (np.diff(seconds) > 0).all()
    assert line[:, 0].max() == 50.0
    assert line[:, 1].min() == -60.0
    length = count * 1e-3
    assert abs(seconds[line[:, 0].argmax()] - 43.21) <= spacing_s(count, length)
    assert np.isclose(spacing_s(count, length), length / BUCKETS)


def test_envelope_leaves_a_hole_where_one_column_has_no_numbers() -> None:
    count = SAMPLES + 4
    values = np.random.default_rng(5).normal(size=(count, 2))
    values[1000:2000, 1] = np.nan
    times = np.arange(count) * MS
    for samples in (slice(0, 5000), slice(None)):  # as they are, and in stretches
        envelope = Envelope(0, int(times[samples][-1]), 2)
        envelope.add(times[samples], values[samples])
        seconds, line = envelope.line()
        is_hole = (seconds > 1.01) & (seconds < 1.99)
        assert np.isnan(line[is_hole, 1]).all()
        assert np.isfinite(line[is_hole, 0]).all()
        assert np.isfinite(line[(seconds < 0.99) | (seconds > 2.01)]).all()
