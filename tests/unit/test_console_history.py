"""What the page sums up of what it sees: figures that numpy finds too."""

from typing import Any

import numpy as np
import pytest

from teleop_console.history import LiveScores
from teleop_console.link import ArmView
from teleop_core.graph import topics


def seen(
    reference: tuple[float, int, int],
    place: Any,
    force: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    is_following: bool = True,
) -> ArmView:
    """A view of an arm whose tip is wanted in one place and is in another [m]."""
    turn = [1.0, 0.0, 0.0, 0.0]
    streams = {
        topics.SLAVE_SETPOINT_CP.name: np.array([*reference, *turn]),
        topics.SLAVE_MEASURED_CP.name: np.array([*place, *turn]),
        topics.MASTER_MEASURED_CF.name: np.array([*force, 0.0, 0.0, 0.0]),
    }
    return ArmView(streams=streams, state={"is_following": float(is_following)})


def test_live_figures_are_those_of_all_samples_at_even_times() -> None:
    rng = np.random.default_rng(1)
    reference, place = rng.normal(0.0, 0.01, (2, 200, 3))
    force = rng.normal(0.0, 1.0, (200, 3))
    scores = LiveScores()
    for i in range(200):
        scores.add(0.03 * i, seen(reference[i], place[i], force[i]))
    error = np.linalg.norm(reference - place, axis=1)[1:]  # a first sample has no step before it
    assert scores.rms == pytest.approx(np.sqrt(np.mean(error**2)))
    assert scores.largest == pytest.approx(error.max())
    assert scores.way == pytest.approx(np.linalg.norm(np.diff(place, axis=0), axis=1).sum())
    assert scores.force == pytest.approx(np.linalg.norm(force, axis=1).max())
    assert scores.time == pytest.approx(199 * 0.03)


@pytest.mark.parametrize(("gap", "counted"), [(0.9, 0.9), (2.0, 0.0)])
def test_a_second_that_the_page_did_not_see_is_not_counted_as_followed(gap: float, counted: float) -> None:
    scores = LiveScores()
    for time in (0.0, gap):
        scores.add(time, seen((1, 0, 0), (0, 0, 0)))
    assert scores.time == pytest.approx(counted)


def test_what_does_not_follow_does_not_count() -> None:
    scores = LiveScores()
    for i in range(50):
        scores.add(0.03 * i, seen((1, 0, 0), (0, 0.01 * i, 0), is_following=False))
    assert (scores.time, scores.way, scores.largest) == (0.0, 0.0, 0.0)
    assert "0.0 s" in scores.text()


def test_what_the_clutch_holds_does_not_count_as_followed() -> None:
    scores = LiveScores()
    for i in range(400):
        view = seen((1, 0, 0), (0, 0.01, 0))
        view.state["is_clutched"] = float(i >= 100)
        scores.add(0.03 * i, view)
    assert scores.time == pytest.approx(99 * 0.03)
