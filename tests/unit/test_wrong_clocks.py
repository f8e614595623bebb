"""Recordings in which single stamps are hours or years away cost no more than others."""

import tracemalloc
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.bags.memory import MemoryBag
from teleop_core.bags.series import Series
from teleop_core.base.errors import RecordingError
from teleop_core.graph.topics import MASTER_MEASURED_CP, Topic
from teleop_core.session.replayed_span import replayed_span

HOUR = 3600 * 10**9
LATER = {"an hour late": HOUR, "in 2038": 2145916800 * 10**9, "beyond all": 2**61}
MEMORY = 300e6
"""Bytes that a second and a half of a session may take at most."""


@pytest.fixture(scope="module")
def session() -> tc.Recording:
    return tc.run("coarse_box", duration=1.5)


def moved(recording: tc.Recording, late_ns: int, which: int = -1) -> tc.Recording:
    """The recording with one sample of every stream stamped and logged later."""
    bag = recording.bag
    assert isinstance(bag, MemoryBag)

    def later(series: Series) -> Series:
        stamps, logs = series.stamp_ns.copy(), series.log_ns.copy()
        stamps[min(which, len(stamps) - 1)] += late_ns
        logs[-1] += late_ns
        return Series(stamps, logs, series.values, series.names, series.frame_id)

    series: dict[Topic, Series] = {t: later(s) for t, s in bag.streams.items() if len(s)}
    return tc.Recording(MemoryBag("late", series, {}, bag.metadata))


@pytest.fixture(autouse=True)
def memory() -> Iterator[None]:
    tracemalloc.start()
    yield
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < MEMORY


@pytest.mark.parametrize("late", LATER)
def test_a_late_last_stamp_is_left_out_of_the_replay_and_told(session: tc.Recording, late: str) -> None:
    with pytest.warns(UserWarning, match="leaves out 1 samples beyond gaps of more than 60 s"):
        again = tc.replay(moved(session, LATER[late]))
    assert again.duration == pytest.approx(session.duration, abs=2.5)


@pytest.mark.parametrize("late", LATER)
def test_scores_frames_and_copies_of_it_cost_what_its_samples_cost(
    session: tc.Recording, late: str, tmp_path: Path
) -> None:
    strayed = moved(session, LATER[late])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        strayed.score()
    topics = ("master/measured_cp", "slave/measured_cp")
    rows = len(strayed.frame(*topics))
    assert rows <= sum(len(strayed[topic]) for topic in topics)
    saved = strayed.save(tmp_path / "bag")
    assert len(saved[topics[0]]) == len(strayed[topics[0]])


def test_a_stamp_in_the_middle_that_is_late_does_not_move_the_others(session: tc.Recording) -> None:
    with pytest.warns(UserWarning, match="leaves out"):
        again = tc.replay(moved(session, HOUR, which=700))
    assert again.duration == pytest.approx(session.duration, abs=2.5)


def test_a_hand_that_rests_for_most_of_a_minute_is_replayed_through_the_rest(tmp_path: Path) -> None:
    stamps = np.array([0, 1, 2, 50_000, 50_001]) * 1_000_000
    assert replayed_span(tmp_path, MASTER_MEASURED_CP.name, stamps) == (0, 50_001_000_000)


def test_a_recording_without_a_readable_sample_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no readable sample"):
        replayed_span(tmp_path, MASTER_MEASURED_CP.name, np.empty(0, np.int64))
