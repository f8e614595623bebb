"""Bands of a page: when the slave was held back, against the state that was recorded."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recipes import START_NS, Recipe, state
from teleop_core.evaluation.bands import Band, bands_of, merged, stretches_of
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.origin import read_origin
from teleop_core.evaluation.state_history import NO_HISTORY, StateHistory, read_history
from teleop_core.graph import STATE_FIELDS, TICK_NS, topics

COUNT = 3000
# Times are sums of float64 seconds.
ROUNDING = 1e-9


def bands(recipe: Recipe, path: Path) -> dict[str, Band]:
    bag = recipe.write(path)
    return {band.cause: band for band in bands_of(Context(bag, "", read_history(bag), read_origin(bag, "")))}


def told(at: int, **values: Any) -> tuple[topics.Topic, int, bytes]:
    stamp_ns = START_NS + at * TICK_NS
    return topics.TELEOP_STATE, stamp_ns, state(stamp_ns, **values)


def history(rows: list[tuple[int, None]]) -> StateHistory:
    """History with one column, at whole milliseconds."""
    stamps = START_NS + np.array([at for at, _ in rows]) * TICK_NS
    return StateHistory(stamps, np.zeros((len(rows), len(STATE_FIELDS))))


def test_each_cause_has_its_stretches(tmp_path: Path) -> None:
    recipe = Recipe(COUNT)
    recipe.singles += [
        told(500, limit=topics.Limit.JOINT, limited_joint=2),
        told(800, limit=topics.Limit.SPEED, limited_joint=-1),
        told(1000, limited_joint=-1),
        told(1500, limit=topics.Limit.JOINT, limited_joint=0),
        told(1600, limited_joint=-1, is_clutched=1),
        told(2500, limit=topics.Limit.WORKSPACE, limited_joint=-1),
    ]
    found = bands(recipe, tmp_path / "bag")
    expected = {
        "joint limit (joints 1, 3)": [[0.5, 0.8], [1.5, 1.6]],
        "speed limit": [[0.8, 1.0]],
        "clutched": [[1.6, 2.5]],
        "outside of the workspace": [[2.5, 2.999]],
    }
    assert set(found) == set(expected)
    for cause, stretches in expected.items():
        assert np.allclose(found[cause].stretches, stretches, rtol=0, atol=ROUNDING), cause


def test_recording_that_does_not_tell_limits_has_no_bands(tmp_path: Path) -> None:
    recipe = Recipe(COUNT)
    assert bands(recipe, tmp_path / "followed") == {}
    recipe.singles = []
    assert bands(recipe, tmp_path / "silent") == {}


def test_every_cause_has_a_band_of_its_own_colour(tmp_path: Path) -> None:
    recipe = Recipe(COUNT)
    causes = [limit for limit in topics.Limit if limit is not topics.Limit.NONE]
    recipe.singles += [told(200 * (i + 1), limit=limit, limited_joint=-1) for i, limit in enumerate(causes)]
    found = bands(recipe, tmp_path / "bag").values()
    assert len(found) == len(causes) == len({band.color for band in found})


@pytest.mark.parametrize("seed", range(5))
def test_stretches_hold_just_the_times_at_which_it_is_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    at = np.sort(rng.choice(np.arange(-50, COUNT + 50), 200, replace=False))
    is_so = rng.random(200) < 0.5
    stretches = stretches_of(history([(a, None) for a in at]), is_so, START_NS, START_NS + COUNT * TICK_NS)
    times = (np.arange(COUNT) + 0.5) * 1e-3
    row = np.searchsorted(at * 1e-3, times, side="right") - 1
    expected = np.where(row >= 0, is_so[row], False)
    inside = np.searchsorted(stretches.ravel(), times, side="right") % 2 == 1
    assert np.array_equal(inside, expected)


def test_no_history_has_no_stretches() -> None:
    assert stretches_of(NO_HISTORY, np.empty(0, bool), 0, 10**9).shape == (0, 2)


def test_merging_loses_no_stretch_and_joins_the_nearest() -> None:
    rng = np.random.default_rng(3)
    ends = np.cumsum(rng.exponential(0.01, 10_000)).reshape(-1, 2)
    few = merged(ends, 300)
    assert len(few) <= 300
    owner = np.searchsorted(few[:, 0], ends[:, 0], side="right") - 1
    assert (ends[:, 1] <= few[owner, 1]).all()
    gaps = few[1:, 0] - few[:-1, 1]
    closed = np.setdiff1d(ends[1:, 0] - ends[:-1, 1], gaps)
    assert closed.max() <= gaps.min()


def test_few_stretches_stay_as_they_are() -> None:
    ends = np.array([[0.0, 0.1], [0.1004, 0.2]])
    assert merged(ends) is ends
