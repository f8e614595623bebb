"""The operator ``human`` moves as people do, and ``random`` does not: figures of whole sessions."""

import numpy as np
import pytest

import teleop_core as tc

pytestmark = pytest.mark.slow

SEEDS = (1, 2, 3)
# Lowest and highest of surgeons at the masters of a da Vinci and of another user of one; a minute
# of a single hand differs from their means by up to a tenth.
PEOPLE = {
    "speed_median_mm_s": (12.0, 27.0),
    "speed_p95_mm_s": (48.0, 101.0),
    "frequency_50_hz": (0.6, 1.05),
    "frequency_95_hz": (2.1, 7.3),
    "power_1_3": (0.27, 0.53),
    "peaks_per_s": (1.3, 2.8),
    "idle_share": (0.14, 0.27),
    "sparc": (-3.8, -3.3),
    "acceleration_p95_m_s2": (0.35, 0.75),
    "tremor_um": (57.0, 69.0),
}
SINGLE = 0.1


def figures(name, **changes):
    """A figure of the hand, of each seed."""
    return [score.value(f"motion.hand.{name}") for score in scores(**changes)]


def scores(cache={}, **changes):  # noqa: B006 (sessions are run once)
    key = str(changes)
    if key not in cache:
        cache[key] = [tc.run("human", seed=seed, **changes).score() for seed in SEEDS]
    return cache[key]


@pytest.mark.parametrize("name", PEOPLE)
def test_hand_moves_within_the_range_of_people(name):
    low, high = PEOPLE[name]
    values = np.array(figures(name))
    room = SINGLE * np.abs([low, high])
    assert (values >= low - room[0]).all()
    assert (values <= high + room[1]).all()
    assert low - 0.02 * abs(low) <= values.mean() <= high + 0.02 * abs(high)


@pytest.mark.parametrize("name", ["frequency_50_hz", "power_1_3", "peaks_per_s", "sparc"])
def test_smooth_operator_is_no_human(name):
    low, high = PEOPLE[name]
    assert all(value < low or value > high for value in figures(name, operator="random"))


def test_strokes_of_the_clutch_part_the_motion_into_segments():
    for score in scores():
        assert score.value("motion.clutch.count") == 2
        assert score.value("motion.clutch.time_s") == pytest.approx(1.0, abs=0.1)
        assert score.value("motion.segment_median.count") == 3
        begins = [score.value(f"motion.segments.{n}.begin_s") for n in (1, 2, 3)]
        ends = [score.value(f"motion.segments.{n}.end_s") for n in (1, 2, 3)]
        assert begins[0] < ends[0] < begins[1] < ends[1] < begins[2] < ends[2]


def test_same_seed_gives_the_same_bits():
    first, again = (tc.run("human", seed=5, duration=6.0) for _ in range(2))
    for name in ("master/measured_cp", "slave/measured_js"):
        assert np.array_equal(first[name].values, again[name].values)
