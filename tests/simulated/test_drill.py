"""The drill on a simulated machine: every row, in both ways, and safeties that are broken."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from drill_runs import run_drill
from mutants import ROOT
from teleop_drill.drill import chosen

pytestmark = pytest.mark.slow
PARTS = 4
"""Sessions that share the rows of one way: each test is short, and two run at once."""
MUTANTS = ("stop_late", "not_recorded", "braking_weak", "second_publishers")


@pytest.mark.parametrize("part", range(PARTS))
@pytest.mark.parametrize("way", ["nodes", "composed"])
def test_an_arm_behaves_under_every_fault(way: Any, part: Any, tmp_path: Path) -> None:
    is_composed = way == "composed"
    rows = [one.name for one in chosen((), is_composed=is_composed)][part::PARTS]
    words = ["--simulated", *(["--composed"] if is_composed else []), *rows]
    code, text, outcomes = run_drill(tmp_path, *words)
    assert set(outcomes) == set(rows)
    assert {name: one["failures"] for name, one in outcomes.items() if one["failures"]} == {}, text
    assert code == 0


@pytest.mark.parametrize("name", MUTANTS)
def test_a_broken_safety_is_found(name: Any) -> None:
    """The others, and both forms of each: make drill-mutants."""
    command = [sys.executable, str(ROOT / "tests/mutants.py"), name, "--processes"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=400)
    assert done.returncode == 0, done.stdout + done.stderr
