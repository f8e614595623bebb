"""Pose measures: accuracy and repeatability as ISO 9283 has them."""

import numpy as np
import pytest

from teleop_lab.experiments import pose_measures, precision


def test_places_on_a_circle_are_as_repeatable_as_it_is_wide_and_accurate_as_its_middle_is() -> None:
    turns = np.linspace(0.0, 2.0 * np.pi, 30, endpoint=False)
    places = [3.0, 4.0, 0.0] + 0.5 * np.column_stack((np.cos(turns), np.sin(turns), 0.0 * turns))
    assert pose_measures.accuracy(places, np.zeros(3)) == pytest.approx(5.0)
    assert pose_measures.repeatability(places) == pytest.approx(0.5)


def test_repeatability_is_the_mean_distance_and_three_standard_deviations() -> None:
    places = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, -3.0, 0.0]])
    # Distances 1, 1, 3, 3: mean 2, sample S.D. sqrt(4 / 3).
    assert pose_measures.repeatability(places) == pytest.approx(2.0 + 3.0 * np.sqrt(4.0 / 3.0))


def test_a_move_of_all_places_changes_accuracy_alone() -> None:
    rng = np.random.default_rng(5)
    places, aims, way = rng.normal(size=(4, 10, 3)), rng.normal(size=(4, 3)), rng.normal(size=3)
    assert pose_measures.repeatability(places + way) == pytest.approx(pose_measures.repeatability(places))
    assert pose_measures.accuracy(places + way, aims + way) == pytest.approx(pose_measures.accuracy(places, aims))


def test_accuracy_of_the_published_rests_is_no_more_than_their_mean_error() -> None:
    rests = precision.published_rests()
    off = pose_measures.accuracy(rests.tips_mm, rests.aims_mm)
    assert (off <= rests.errors_mm.mean(axis=1) + 1e-9).all()
    assert off.max() == pytest.approx(0.432, abs=5e-4)  # point 2, RMS 0.432 in table 7.7
