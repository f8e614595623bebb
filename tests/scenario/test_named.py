"""Whatever README, site and ``--help`` name runs to its end.

Sessions of commands are short here, and whole in ``make soak``. What is not run is listed, with the
reason, by ``python tests/support/named.py``. The tutorials run where the site is built.
"""

import re
import subprocess
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import pytest

import teleop_core as tc
from example_runs import NAMES
from named import ROOT, Named, commands, places, provide
from present import present
from teleop_core.commands.cli import main
from teleop_core.graph.layers import list_scenarios
from teleop_core.session import configuration, runner, virtual
from teleop_lab import experiments

BRIEF = ("--duration", "2")
FORMS = ["brief", pytest.param("whole", marks=pytest.mark.soak)]
AGREEING = {
    "resolution": 16, "tendons": 3, "poses": 73, "workspace": 1, "filter": 10, "precision": 5,
    "repeatability": 6, "responses": 5, "accuracy": 30, "master_slave": 7, "controllers": 2,
    "gravity": 6, "robustness": 0, "shares": 0, "points24": 1, "stability": 15, "zwidth": 29,
    "transparency": 112, "drift": 42, "puncture": 27, "fitts": 13, "delay": 6,
    "move_and_wait": 14, "scaling_under_delay": 2, "uva": 74, "mma_frames": 39, "mma_balance": 15, "hybrid": 18,
    "parallel_robots": 6, "operator_models": 0, "blind": 124,
}  # fmt: skip
"""Published figures, laws and goals that each experiment agrees with."""
CALCULATED = ("resolution", "tendons", "poses", "workspace", "filter", "responses", "accuracy", "mma_frames",
              "mma_balance", "parallel_robots")  # fmt: skip
"""Those without a session, which take two seconds together: no other test has their figures."""
LONG_EXPERIMENTS = ("stability", "transparency", "operator_models", "move_and_wait", "controllers", "fitts")
"""Half a minute and more each; tests/unit has their laws with fewer cases."""
TRACKED_MM = {"coarse_box": 0.289, "fine_box": 0.260, "human": 0.114, "point": 0.153, "uva_board": 0.105}
"""Root mean square of each scenario's position error, where it is above a tenth."""


@pytest.fixture(scope="module")
def bench() -> experiments.Bench:
    """Sessions that several experiments need run once."""
    return experiments.Bench()


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(
            n, marks=() if n in CALCULATED else pytest.mark.soak if n in LONG_EXPERIMENTS else pytest.mark.slow
        )
        for n in experiments.EXPERIMENTS.names()
    ],
)
def test_every_experiment_runs_to_its_end_and_agrees_as_it_did(name: str, bench: experiments.Bench) -> None:
    outcome = experiments.run(name, bench=bench)
    assert sum(row.agrees is True for row in outcome.rows) == AGREEING[name]
    if name == "points24":
        stops_inside_of_all_points_if_it_sees_and_else_in_none(outcome.rows)
    if name == "gravity":
        is_clearly_worse_without_under_the_sources_controller(outcome)


def is_clearly_worse_without_under_the_sources_controller(outcome: experiments.Outcome) -> None:
    """What is further said of an arm that does not hold its own weight."""
    for mode in ("coarse", "fine"):
        ratio = outcome.row("error without compensation divided by the error with it", f"position error, RMS, {mode}")
        assert present(ratio.predicted) > 1.5
        assert present(ratio.ours) < 1.1


def stops_inside_of_all_points_if_it_sees_and_else_in_none(rows: Sequence[experiments.Comparison]) -> None:
    """What is further said of a hand that goes from point to point, 24 of them."""
    seen, blind = [row for row in rows if row.quantity.endswith("inside the inner circle")]
    assert seen.published == seen.predicted == seen.ours == 24.0
    assert blind.predicted == blind.ours == 0.0
    (mean, *_) = [row.predicted for row in rows if row.unit == "mm"]
    assert 0.05 < present(mean) < 0.2


@pytest.mark.slow
@pytest.mark.parametrize("scenario", list_scenarios())
@pytest.mark.filterwarnings("default")
def test_every_scenario_runs_to_its_end_and_is_followed(scenario: str) -> None:
    made = configuration.configure(scenario)
    recording = tc.run(scenario)
    assert len(recording["slave/measured_js"]) == runner.session_ticks(made, virtual.VirtualTime(made))
    score = recording.score()
    assert present(score.reach.followed_share) > 0.99
    expected = pytest.approx(TRACKED_MM.get(scenario, 0.05), rel=0.1 if scenario in TRACKED_MM else 1)
    assert score.position_error_mm.rms == expected


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("place", places())
@pytest.mark.filterwarnings("default")
def test_commands_of_a_page_run_one_after_the_other(
    place: str, form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("config", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    (tmp_path / "bags").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)  # which a command replaces
    for named in commands():
        if named.place == place and not named.reason and (form == "whole" or not named.is_long):
            provide(named, tmp_path)
            assert run(named, form) == 0, named.line


def run(named: Named, form: str) -> int:
    """Exit code of a command, run here, or in a process of its own if it loads parts."""
    words = list(named.words)
    if form == "brief" and words[0] == "sim":
        if BRIEF[0] in words:
            at = words.index(BRIEF[0])
            del words[at : at + 2]
        words += BRIEF
    if "--parts" not in words:
        return main(words)
    return subprocess.run([sys.executable, "-m", "teleop_core.commands.cli", *words], check=False).returncode


def test_every_example_is_run_by_a_test() -> None:
    texts = [path.read_text(encoding="utf-8") for path in ROOT.glob("tests/*/test_examples.py")]
    run_by_name = set(re.findall(r"run\(\s*\"(\w+)\"", "\n".join(texts)))
    named = set(re.findall(r"examples/(\w+)\.py", "\n".join(texts + [str(c) for c in commands()])))
    apart = {"foreign_slave"}  # the drives of crtk_client, which its test starts
    assert set(NAMES) <= run_by_name | named | apart


def test_every_command_that_is_not_run_has_a_reason_and_most_are_run() -> None:
    found = list(commands())
    experiments_run = "each is run by a test of its own"
    run = sum(not named.reason or named.reason.startswith(experiments_run) for named in found)
    assert run > 0.55 * len(found)
    assert set(AGREEING) == set(experiments.EXPERIMENTS.names())
