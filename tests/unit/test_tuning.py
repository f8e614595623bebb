"""Tuning: it finds the best values, goes on where it was, and tells what cannot be."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from teleop_lab import Tuning, read_tuning
from teleop_lab.studies import SearchRange, Trial, Tuned
from teleop_lab.studies.summary import least_difference
from teleop_lab.studies.tuning_page import tuning_page

METRIC = "position_error_mm.rms"
WITHOUT_EYES = {"teleop.duration": 0.5, "teleop.stages": ("display",)}
"""A display that the hand of a box does not look at."""


def tuning(**changes: Any) -> Tuning:
    whole = Tuning(
        "coarse_box", {"coarse_gain": SearchRange(0.2, 1.0)}, (1,), METRIC, settings={"teleop.duration": 0.5}
    )
    return replace(whole, **changes)


def file_of(folder: Path, text: str) -> Path:
    file = folder / "tune.yaml"
    file.write_text(text, "utf-8")
    return file


def test_the_best_trial_has_the_score_of_the_same_session_alone() -> None:
    tuned = tuning().run(trials=6, jobs=1)
    scores = [trial.score for trial in tuned.trials]
    assert tuned.best.score == min(score for score in scores if score is not None)
    name, value = next(iter(tuned.best.values.items()))
    alone = tc.run("coarse_box", duration=0.5, seed=1, settings={name: value}).score()
    assert tuned.best.score == alone.value(METRIC)


def test_trials_within_the_noise_of_the_best_one_are_equal_to_it_and_others_are_not() -> None:
    best = Trial({"coarse_gain": 1.0}, (1.0, 1.1, 0.9, 1.0), "")
    near = Trial({"coarse_gain": 0.9}, (1.1, 1.0, 1.0, 1.0), "")
    far = Trial({"coarse_gain": 0.1}, (2.0, 2.2, 1.8, 2.1), "")
    failed = Trial({"coarse_gain": 0.2}, (), "tired")
    tuned = Tuned.of((far, near, failed, best), is_largest=False)
    assert list(tuned.alike) == [near, best]
    page = tuning_page(tuning(scenario="point", metric="task.time_s"), tuned, "gain")
    assert "smallest task time" in page
    assert "coarse gain 1: 1.00 (0.87 to 1.13) s" in page
    assert "Cannot be told apart from the best: 1 of 2 other trials, whose task time" in page
    assert "coarse_gain 0.9 … 1" in page


def test_the_largest_score_is_the_best_where_it_is_asked_for() -> None:
    tuned = tuning(is_largest=True).run(trials=3, jobs=1)
    assert tuned.best.score == max(trial.score or 0.0 for trial in tuned.trials)


def test_a_search_that_was_broken_off_goes_on_to_the_same_values(tmp_path: Path) -> None:
    whole = tuning().run(tmp_path / "whole", trials=8, jobs=1)
    calls = 0

    def killed(done: int, _: int) -> None:
        nonlocal calls
        calls += 1
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tuning().run(tmp_path / "one", trials=8, jobs=1, progress=killed)
    assert calls == 2
    before = len(list((tmp_path / "one").glob("*/*.json")))
    assert 0 < before < 8
    assert tuning().run(tmp_path / "one", trials=8, jobs=1) == whole


def test_a_score_that_no_session_has_is_told_and_not_taken_for_a_bad_one() -> None:
    with pytest.raises(tc.SessionError, match=r"no trial has touch\.peak_n"):
        tuning(metric="touch.peak_n").run(trials=1, jobs=1)


def tried(scores: Any) -> Tuned:
    """Result of trials with scores (N, M) by trial and seed, at gains 1, 2 and so on."""
    rows = [tuple(map(float, row)) for row in scores]
    trials = [Trial({"gain": n}, row, "") for n, row in enumerate(rows, 1)]
    return Tuned.of(trials, is_largest=True)


def test_the_truly_best_value_is_among_those_that_are_not_told_from_the_best_nineteen_times_in_twenty() -> None:
    rng, held = np.random.default_rng(1), 0
    means = np.array([1.0, 0.9, 0.5, 0.5, 0.0])[:, None]
    for _ in range(400):
        by_seed = 3.0 * rng.normal(size=4)  # a seed that is easy is easy at every value
        held += any(one.values["gain"] == 1 for one in tried(means + by_seed + rng.normal(size=(5, 4))).alike)
    assert held >= 0.95 * 400


def test_values_are_told_apart_where_they_differ_by_more_than_the_seeds_do() -> None:
    noise = np.random.default_rng(2).normal(size=(4, 5))
    apart, near = tried(np.arange(4.0)[:, None] + 0.01 * noise), tried(np.arange(4.0)[:, None] + 10.0 * noise)
    assert apart.alike == (apart.best,)
    assert "All other values tried are worse" in apart.told("score")
    assert len(near.alike) == 4
    assert "Cannot be told apart from the best: 3 of 3" in near.told("score")
    assert near.told("score").endswith("Interval of the best: gain 1 … 4.")


def test_one_seed_tells_no_values_apart_and_says_so() -> None:
    alone = tried([[1.0], [5.0]])
    assert len(alone.alike) == 2
    assert "2 seeds or more" in alone.told("score")


def test_a_parameter_that_does_nothing_has_the_whole_range_for_its_best_value() -> None:
    tuned = tuning(searched={"display.latency": SearchRange(0.0, 0.5)}, seeds=(1, 2), settings=WITHOUT_EYES).run(
        trials=3, jobs=1
    )
    assert len(tuned.alike) == 3


@pytest.mark.parametrize("seeds", [2, 3, 8])
def test_what_a_seed_adds_to_all_scores_does_not_count(seeds: int) -> None:
    scores = np.random.default_rng(3).normal(size=(4, seeds))
    assert least_difference(scores + 100.0 * np.arange(seeds)) == pytest.approx(least_difference(scores))
    assert least_difference(scores[:1]) == 0.0


def test_choices_and_whole_numbers_are_kept_as_they_are() -> None:
    searched = {"controller": ["pid", "disturbance_observer"], "integration_steps": SearchRange(1, 4)}
    tuned = tuning(searched=searched).run(trials=4, jobs=1)
    for trial in tuned.trials:
        assert trial.values["controller"] in searched["controller"]
        assert isinstance(trial.values["integration_steps"], int)
        assert not trial.error


def test_a_file_says_the_same_as_python(tmp_path: Path) -> None:
    text = (
        "scenario: coarse_box\nseeds: [1]\nduration: 0.5\n"
        f"tune:\n  coarse_gain: {{low: 0.2, high: 1.0}}\nminimize: {METRIC}\n"
    )
    assert read_tuning(file_of(tmp_path, text)).run(trials=2, jobs=1) == tuning().run(trials=2, jobs=1)


def test_the_command_prints_the_best_values_and_writes_page_and_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from teleop_core.commands.cli import main

    text = (
        "scenario: coarse_box\nduration: 0.3\n"
        f"tune:\n  coarse_gain: {{low: 0.5, high: 1.0, log: true}}\nminimize: {METRIC}\n"
    )
    page, numbers = tmp_path / "page.html", tmp_path / "numbers.csv"
    given = ["--trials", "2", "--jobs", "1", "--html", str(page), "--csv", str(numbers)]
    assert main(["tune", str(file_of(tmp_path, text)), *given]) == 0
    said = capsys.readouterr().out
    assert "best: --set coarse_gain=" in said
    assert "One seed tells no values apart" in said
    assert "One seed tells no values apart" in page.read_text("utf-8")
    assert "2 trials × 1 = 2 sessions" in page.read_text("utf-8")
    assert len(numbers.read_text("utf-8").splitlines()) == 3
