"""What the page remembers: the last thirty seconds, and figures that numpy finds too."""

from typing import Any, cast

import numpy as np
import pytest

from teleop_console.history import SPAN, History, LiveScores
from teleop_console.link import Arm, ArmView
from teleop_console.plots import Plots
from teleop_console.server import ConsoleServer
from teleop_core.graph import topics
from teleop_core.robots import load_robot

ARM = Arm("", load_robot("rcrt1"))


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
        topics.SLAVE_SERVO_CP.name: np.array([*reference, *turn]),
        topics.SLAVE_MEASURED_CP.name: np.array([*place, *turn]),
        topics.MASTER_MEASURED_CF.name: np.array([*force, 0.0, 0.0, 0.0]),
    }
    return ArmView(streams=streams, state={"is_following": float(is_following)})


def test_history_reaches_back_thirty_seconds_and_ends_now() -> None:
    history = History(ARM)
    for time in np.arange(0.0, 70.0, 1.0 / 30.0):
        history.add(float(time), seen((time, 0, 0), (0, 0, 0)), 0.001)
    at, reference = history.read("reference")
    assert at[-1] == 0.0
    assert -SPAN <= at[0] < -SPAN + 0.1
    np.testing.assert_allclose(np.diff(reference[:, 0]), np.diff(at), atol=1e-9)


def test_what_was_not_known_is_not_a_number_in_history() -> None:
    history = History(ARM)
    history.add(1.0, ArmView(), float("nan"))
    assert np.isnan(history.read("joints")[1]).all()


def test_the_energy_that_both_ports_may_still_give_is_drawn_in_joules() -> None:
    history, view = History(ARM), seen((0, 0, 0), (0, 0, 0))
    for topic, left in ((topics.MASTER_ENERGY, 0.004), (topics.SLAVE_ENERGY, -0.001)):
        view.streams[topic.name] = np.where(np.array(topics.ENERGY) == "margin", left, 7.0)
    history.add(1.0, view, 0.001)
    assert history.read("left")[1].tolist() == [[0.004, -0.001]]


def test_a_time_that_goes_back_begins_history_anew() -> None:
    history = History(ARM)
    for time in (5.0, 6.0, 2.0):
        history.add(time, seen((0, 0, 0), (0, 0, 0)), 0.0)
    assert len(history.read("error")[0]) == 1


def test_a_time_that_stands_still_as_in_a_paused_replay_leaves_history_as_it_is() -> None:
    history = History(ARM)
    for time in (5.0, 6.0, 6.0, 6.0):
        history.add(time, seen((0, 0, 0), (0, 0, 0)), 0.0)
    assert history.read("error")[0].tolist() == [-1.0, 0.0]


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


def test_each_plot_has_an_axis_of_times_and_room_for_a_negative_number_beside_it() -> None:
    with ConsoleServer(0) as server:
        plots = Plots(server.viser.gui, History(ARM))
        for handle in (plots._joint_plot, *plots._plots):
            times, numbers = cast(Any, handle.axes)
            assert times is not numbers  # one object for both is drawn once
            assert numbers["size"] >= 8 * len("-0.00025")
            assert "size" not in times
