"""The operator ``human`` moves as people do: figures of whole sessions."""

import runpy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import teleop_core as tc

pytestmark = pytest.mark.slow

SEEDS = (1, 2, 3)
EXAMPLE = Path(__file__).parents[2] / "examples" / "human_operator.py"
# Lowest and highest of people, as the example has them; a minute of a single hand differs from
# their means by up to a tenth, as does the one figure of tremor.
PEOPLE = runpy.run_path(str(EXAMPLE))["PEOPLE"] | {"tremor_um": (57.0, 69.0)}
SINGLE = 0.1


def figures(name: str, **changes: object) -> list[Any]:
    """A figure of the hand, of each seed."""
    return [score.value(f"motion.hand.{name}") for score in scores(**changes)]


@cache
def scores(**changes: Any) -> list[Any]:
    return [tc.run("human", seed=seed, **changes).score() for seed in SEEDS]


@pytest.mark.parametrize("name", sorted(PEOPLE))
def test_hand_moves_within_the_range_of_people(name: Any) -> None:
    low, high = PEOPLE[name]
    values = np.array(figures(name))
    room = SINGLE * np.abs([low, high])
    assert (values >= low - room[0]).all()
    assert (values <= high + room[1]).all()
    assert low - 0.02 * abs(low) <= values.mean() <= high + 0.02 * abs(high)


def test_median_speed_is_no_more_than_that_of_the_hand_of_the_uva_study() -> None:
    """20 mm/s; surgeons of JIGSAWS moved at 9 to 15 mm/s by task."""
    assert np.mean(figures("speed_median_mm_s")) <= 20.0


def test_strokes_of_the_clutch_part_the_motion_into_segments() -> None:
    for score in scores():
        assert score.value("motion.clutch.count") == 2
        assert score.value("motion.clutch.time_s") == pytest.approx(1.0, abs=0.1)
        assert score.value("motion.segment_median.count") == 3
        begins = [score.value(f"motion.segments.{n}.begin_s") for n in (1, 2, 3)]
        ends = [score.value(f"motion.segments.{n}.end_s") for n in (1, 2, 3)]
        assert begins[0] < ends[0] < begins[1] < ends[1] < begins[2] < ends[2]
