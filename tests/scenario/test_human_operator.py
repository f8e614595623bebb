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
