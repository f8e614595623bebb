"""Answers of a study: their words come from the numbers, and the page shows what the numbers hold."""

import csv
import json
import re
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from teleop_lab import Study, read_study
from teleop_lab.studies.answers import UNTOLD, effect_told, parameters_of, score_of
from teleop_lab.studies.dataset import dataset_of, swept_coordinates
from teleop_lab.studies.point import PointKey, PointResult
from teleop_lab.studies.printed import Printed
from teleop_lab.studies.study_page import study_page
from teleop_lab.studies.summary import Mean, change_of, interplay, mean_of

if TYPE_CHECKING:
    import xarray

TIME, SHARE = "task.time_s", "task.error_share"
STUDIES = Path(__file__).parents[2] / "config/studies"
SEEDS = tuple(range(1, 9))


def study(**swept: Any) -> Study:
    whole = {"display.latency": (0.0, 0.1, 0.2), "coarse_gain": (0.5, 1.0)} | swept
    return Study("point", whole, SEEDS, (TIME, SHARE))


def dataset(made: Study, slope: float, joint: float = 0.0, seed: int = 1) -> "xarray.Dataset":
    """Results of sessions that take 1 s and ``slope`` more for 1 s of lag, and ``joint`` more with the larger gain."""
    import xarray

    late, gain, noise = np.array([0.0, 0.1, 0.2]), np.array([0.0, 1.0]), np.random.default_rng(seed)
    times = 1.0 + slope * late[:, None, None] + joint * np.multiply.outer(late, gain)[..., None]
    times = times + noise.normal(scale=0.005, size=(3, 2, len(SEEDS)))
    none = np.full(times.shape, "", object)
    found = {TIME: (made.names, times), SHARE: (made.names, 0.0 * times), "error": (made.names, none)}
    return xarray.Dataset(found, {**swept_coordinates(made.swept), "seed": list(SEEDS)}, {"scenario": "point"})


def test_an_effect_is_told_with_sign_and_unit_and_one_whose_interval_includes_zero_is_not() -> None:
    rng = np.random.default_rng(3)
    for value, half in zip(rng.normal(scale=0.3, size=300), rng.exponential(0.3, size=300), strict=True):
        effect = Mean(value, value - half, value + half, 5)
        told = effect_told(TIME, effect, 2.0)
        if abs(value) <= half:
            assert told.startswith(f"{UNTOLD}: −")
            assert "longer" not in told
            assert "shorter" not in told
        else:
            assert told.startswith("+" if value > 0.0 else "−")
            assert re.search(r"\bm?s \(", told)
            assert ("shorter" if value > 0.0 else "longer") not in told
            assert UNTOLD not in told


@pytest.mark.parametrize(
    ("score", "effect", "before", "told"),
    [
        (TIME, Mean(0.935, 0.872, 0.997, 5), 2.0, "+935 ms (872 to 997), 47 % longer"),
        (TIME, Mean(-18.34, -20.1, -16.6, 5), 40.0, "−18.3 s (−20.1 to −16.6), 46 % shorter"),
        (TIME, Mean(0.009, -0.012, 0.03, 5), 2.0, "cannot be told apart: −12 to 30 ms"),
        (SHARE, Mean(0.08, 0.01, 0.15, 5), 0.02, "+8 percentage points (1 to 15)"),
        ("task.throughput", Mean(-0.75, -0.9, -0.6, 5), 2.0, "−0.75 bit/s (−0.90 to −0.60), 38 % less"),
        ("economy.path_mm", Mean(41.0, 12.0, 70.0, 5), 0.0, "+41 mm (12 to 70)"),
        (TIME, Mean(0.05, 0.0004, 0.0996, 5), 1.0, "+50.0 ms (0.4 to 99.6), 5 % longer"),
        (TIME, Mean(0.05, 0.05, 0.05, 1), 1.0, "+50 ms in one pair of sessions; no interval, so cannot be told apart"),
        (SHARE, Mean(0.0, 0.0, 0.0, 5), 0.0, "the same in all sessions"),
        (TIME, Mean(np.nan, np.nan, np.nan, 0), 1.0, "no session has this score"),
    ],
)
def test_an_answer_has_the_unit_in_which_a_reader_thinks(score: str, effect: Mean, before: float, told: str) -> None:
    assert effect_told(score, effect, before) == told


def test_the_interval_of_five_values_holds_their_mean_in_nineteen_of_twenty_samples() -> None:
    rng, count = np.random.default_rng(1), 2000
    found = [change_of(rng.normal(1.0, 1.0, 5)) for _ in range(count)]
    assert sum(one.low <= 1.0 <= one.high for one in found) / count == pytest.approx(0.95, abs=0.015)
    assert mean_of(np.array([0.0, 0.0, 0.1])).low == 0.0
    assert mean_of(np.array([-0.1, 0.0, 0.1])).low < -0.1
    assert score_of(SHARE, ()).shown(mean_of(np.array([0.0, 0.9, 1.0]))).endswith("to 100)")


def test_effects_that_add_up_do_not_interact_and_others_do_with_their_sign() -> None:
    made, pair = study(), ("display.latency", "coarse_gain")
    told = sum(interplay(made, dataset(made, 2.0, 0.0, seed), TIME, pair).change.is_told for seed in range(40))
    assert told <= 6
    found = interplay(made, dataset(made, 2.0, -0.5), TIME, pair)
    assert found.values == (0.2, 1.0)
    assert found.change.low <= -0.1 <= found.change.high < 0.0


def test_a_page_has_design_answers_and_tables_and_a_heat_map_only_of_what_interacts() -> None:
    made = study()
    plain, joint = (study_page(made, dataset(made, 2.0, share), "late") for share in (0.0, -0.5))
    for page in (plain, joint):
        assert "3 × 2 × 8 = 48 sessions of point" in page
        assert "latency from 0 to 200 ms" in page
        assert page.count('<details class="card table" open>') == 3  # readable without JavaScript
        assert "<th>task time [s]</th><th>task error share [%]</th>" in page
        assert '"visible":"legendonly"' in page.replace(" ", "")
    assert re.search(r"\+[\d.]+ ms \([\d.]+ to [\d.]+\), (39|40) % longer", plain)
    assert "heatmap" not in figures(plain)
    assert "heatmap" in figures(joint)
    assert "at coarse gain 1 against 0.5 the effect of latency from 0 to 200 ms differs by −" in joint


def figures(page: str) -> str:
    """Figures of a page as text, without the library that draws them."""
    found = re.search(r'<script id="page-data" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert found
    return json.dumps(json.loads(found.group(1))["figures"])


def test_people_stand_beside_the_sessions_and_are_counted() -> None:
    made = Study("point", {"display.latency": (0.0, 0.1)}, (1, 2), (TIME,))
    values = {TIME: np.array([[1.0, 0.5, 1.5], [9.0, 8.0, 10.0]])}
    with_people = Study("point", made.swept, made.seeds, made.metrics, printed=Printed("people", values))
    results = [PointResult(point.name, PointKey("", ""), {TIME: 1.0}, "", 1.0) for point in made.points()]
    found = dataset_of({**swept_coordinates(made.swept), "seed": [1, 2]}, made.metrics, results, {})
    assert "1 of 2 conditions" in study_page(with_people, found, "late")
    assert "of 2 conditions" not in study_page(made, found, "late")


def test_the_printed_times_of_the_uva_study_are_those_of_its_experiment() -> None:
    printed = read_study(STUDIES / "uva.yaml").printed
    assert printed is not None
    text = (files("teleop_lab.experiments") / "uva_published.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    here = np.array(list(printed.values.values()))[:, :, 0].T.ravel()
    np.testing.assert_array_equal(here, [float(row["mean"]) for row in rows])


def test_parameters_are_named_by_their_last_word_unless_two_have_the_same() -> None:
    made = study(**{"network.there.loss": (0.0, 0.1), "network.back.loss": (0.0, 0.1)})
    titles = [one.title for one in parameters_of(made).values()]
    assert titles == ["latency", "coarse gain", "network.there.loss", "network.back.loss"]
