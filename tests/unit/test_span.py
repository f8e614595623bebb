"""Spans: a part of a recording is scored by its own samples, and by what was in force before."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import teleop_core as tc
from recipes import terminal
from teleop_core.base.errors import ParameterError
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.evaluation.score_table import score_table

FROM, TO = 9.0, 11.5


@pytest.fixture(scope="module")
def recording() -> Any:
    # The hand begins 3.7 s after the recording, when the slave has reached its start posture.
    buttons = {"clutch": (5.5, 6.5), "fixture": (1.0,)}
    settings = {f"buttons.{name}": times for name, times in buttons.items()}
    return tc.run("coarse_box", duration=10.0, approach_time=2.0, starts_at_home=False, settings=settings)


@pytest.fixture(scope="module")
def score(recording: tc.Recording) -> Any:
    return recording.score(span=(FROM, TO))


def test_error_of_a_span_is_that_of_its_samples(recording: tc.Recording, score: tc.Score) -> None:
    measured, setpoint = recording["slave/measured_cp"], recording["slave/setpoint_cp"]
    is_in = ((measured.time >= FROM) & (measured.time <= TO))[1:]
    places = ["x", "y", "z"]  # each pose is of the tick before that it is told in
    error = np.linalg.norm(measured[places][1:] - setpoint[places][:-1], axis=1)[is_in] * 1e3
    assert score.samples.scored == is_in.sum()
    assert score.position_error_mm.rms == pytest.approx(np.sqrt((error**2).mean()))
    assert score.position_error_mm.max == pytest.approx(error.max())


def test_spans_side_by_side_have_every_sample_once(recording: tc.Recording) -> None:
    # Samples stand at whole milliseconds.
    edges = (0.0, 5.0005, 8.0005, recording.duration)
    parts = [recording.score(span=span).samples for span in pairwise(edges)]
    whole = recording.score().samples
    for name in ("scored", "invalid", "unpaired"):
        assert sum(getattr(part, name) for part in parts) == getattr(whole, name)


def test_span_of_everything_is_the_whole(recording: tc.Recording) -> None:
    whole, span = recording.score(), recording.score(span=(0.0, 1e9))
    assert span.position_error_mm == whole.position_error_mm
    assert span.to_json()["session"] == whole.to_json()["session"]


def test_fixture_that_was_on_before_a_span_is_on_in_it(score: tc.Score) -> None:
    assert score.value("fixture.on_s") == pytest.approx(TO - FROM, abs=0.01)


def test_score_says_what_was_scored(recording: tc.Recording, score: tc.Score) -> None:
    assert (score.session.from_s, score.session.to_s) == (FROM, TO)
    assert score.session.duration_s == recording.duration
    assert "scored from 9 to 11.5 s" in repr(score)
    shown = terminal()
    shown.print(score_table([score]))
    assert "9–11.5 s" in shown.export_text()


def test_approach_counts_in_a_span_and_not_in_the_whole(recording: tc.Recording) -> None:
    assert recording.score().value("motion.hand.time_s") == pytest.approx(8.0, abs=0.1)
    during = recording.score(span=(3.0, 6.0))
    assert during.value("motion.hand.time_s") == pytest.approx(3.0, abs=0.1)


def test_strokes_of_the_clutch_are_those_within_the_span(recording: Any, score: Any) -> None:
    for found in (recording.score(), score):
        assert found.value("motion.clutch.count") == 1
        assert found.value("motion.clutch.time_s") == pytest.approx(1.0, abs=0.05)
        assert found.value("motion.segment_median.count") >= 1
    assert recording.score(span=(6.0, 9.0)).value("motion.clutch.count") == 0


@pytest.mark.parametrize(
    "span", [(3.0, 3.0), (5.0, 2.0), (-1.0, 2.0), (1e3, 2e3), (float("nan"), 1.0), (0.0, float("nan"))]
)
def test_span_without_time_is_refused_with_what_there_is(recording: tc.Recording, span: tuple[float, float]) -> None:
    with pytest.raises(ParameterError, match=rf"before the end at {recording.duration:.3f} s"):
        recording.score(span=span)


def test_command_scores_the_span_of_each_recording(recording: tc.Recording, tmp_path: Path) -> None:
    path = tmp_path / "bag"
    recording.save(path)
    target = tmp_path / "scores.json"
    (found,) = evaluate_bags([path], target, None, Console(quiet=True), (FROM, TO))
    assert json.loads(target.read_text())[0]["session"]["from_s"] == FROM
    assert found.samples == recording.score(span=(FROM, TO)).samples
