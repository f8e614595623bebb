"""The drill on a simulated machine: every row, in both ways, and safeties that are broken."""

import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from drill_runs import run_drill
from mutants import ROOT
from teleop_drill.drill import chosen, inside
from teleop_drill.nodes import drill
from teleop_drill.simulation.drill import simulated_drill

pytestmark = pytest.mark.slow
MUTANTS = ("stop_late", "not_recorded")
"""Those that no law of random schedules finds, of each half of the drill: what moves, what is recorded."""


def assert_it_behaves(folder: Path, rows: Sequence[str], *words: str) -> None:
    code, text, outcomes = run_drill(folder, "--simulated", *words, *rows)
    assert set(outcomes) == set(rows)
    assert {name: one["failures"] for name, one in outcomes.items() if one["failures"]} == {}, text
    assert code == 0


def rows_of(*, is_composed: bool, is_short: bool) -> list[str]:
    """All rows of one form of the session, or a part: a row of both forms is in one of the two parts."""
    own, other = ([one.name for one in chosen((), is_composed=form)] for form in (is_composed, not is_composed))
    shared = [name for name in own if name in other]
    return [name for name in own if not is_short or name not in shared[not is_composed :: 2]]


@pytest.mark.parametrize("runs", [1, pytest.param(2, marks=pytest.mark.soak)], ids=["once", "twice"])
@pytest.mark.parametrize("words", [(), ("--composed",)], ids=["processes", "composed"])
def test_an_arm_behaves_under_every_fault_in_one_go_each_time_to_the_same_bits(
    words: tuple[str, ...], runs: int, tmp_path: Path
) -> None:
    """Rows in the order of the table: each begins at home, whatever the rows before it did to the arm.

    That another process gives the same bits: test_machine.
    """
    files = []
    for run in map(str, range(runs)):
        (folder := tmp_path / run).mkdir()
        assert_it_behaves(folder, rows_of(is_composed=bool(words), is_short=runs == 1), *words)
        files.append((folder / "drill.json").read_bytes())
    assert len(set(files)) == 1


@pytest.mark.parametrize("looks", [3, pytest.param(7, marks=pytest.mark.soak)])
def test_drives_that_stood_still_catch_up_as_their_loop_does_wherever_on_the_circle_they_are(
    looks: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drill, "_STEADY", looks)
    rows = chosen(("freeze_slave_sim",), is_composed=False)
    (found,) = simulated_drill(rows, tmp_path, lambda _: None)
    speed = found.measured("tip_speed_m_s")
    assert not found.failures()
    assert speed.value > 0.25  # of a setpoint that catches up behind its filter it is less


def test_a_signal_ends_a_drill_where_it_waits_and_what_was_measured_is_kept(tmp_path: Path) -> None:
    rows, said = chosen(("stop_topic", "flood"), is_composed=False), list[str]()

    def say(line: str) -> None:
        said.append(line)
        if len(said) == 3:  # after the first row
            signal.raise_signal(signal.SIGTERM)
            said.append("goes on until it waits")

    found = simulated_drill(rows, tmp_path, say)
    assert [one.exercise.name for one in found] == [rows[0].name], said
    assert said[3:] == ["goes on until it waits", "stopped: interrupted; results until now:"]


def test_a_drill_whose_environment_another_drill_has_left_breaks_its_stage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TELEOP_PARTS", inside.__file__)
    assert_it_behaves(tmp_path, ["stage_raises"], "--composed")


@pytest.mark.parametrize("name", MUTANTS)
def test_a_broken_safety_is_found(name: str) -> None:
    """The others, and both forms of each: make drill-mutants."""
    command = [sys.executable, str(ROOT / "tests/support/mutants.py"), name, "--processes"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=400)
    assert done.returncode == 0, done.stdout + done.stderr
