"""Drill: the short form of the fault matrix, as the command that people run."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from drill_runs import run_drill
from teleop_drill.drill import SHORT

pytestmark = [pytest.mark.ros, pytest.mark.slow]
LIMITS = 1.0 + 1e-9


@pytest.mark.soak
def test_the_short_form_of_the_fault_matrix_holds_for_lone_nodes(tmp_path: Path) -> None:
    code, text, outcomes = run_drill(tmp_path, "--short", "--out", str(tmp_path / "bags"))
    assert set(outcomes) == set(SHORT)
    for one in outcomes.values():
        assert one["measured"]["step_ratio"]["value"] <= LIMITS, text
        assert one["recording"] == "intact", text
        assert one["recovered_s"] is not None, text
    assert outcomes["kill_motion_scaling"]["state"] == "PAUSED", text
    assert outcomes["stop_topic"]["state"] == "FAULT", text
    assert outcomes["stop_topic"]["told"] == "stop", text
    assert (code == 0) is all(one["is_passed"] for one in outcomes.values())
    assert {file.name for file in (tmp_path / "bags").rglob("metadata.yaml")} == {"metadata.yaml"}


@pytest.mark.soak
def test_a_composed_session_survives_a_hand_that_lies_and_is_stopped(tmp_path: Path) -> None:
    names = ("stop_service", "nan", "infinite", "teleport")
    code, text, outcomes = run_drill(tmp_path, "--composed", *names)
    assert set(outcomes) == set(names)
    for one in outcomes.values():
        assert one["measured"]["step_ratio"]["value"] <= LIMITS, text
        assert one["recovered_s"] is not None, text
        assert one["recording"] == "intact", text
    assert (code == 0) is all(one["is_passed"] for one in outcomes.values())


def test_drives_that_end_are_named_with_what_they_wrote_last() -> None:
    drives = shlex.join([sys.executable, "-c", "import sys; sys.exit('no arm on this cable')"])
    command = [sys.executable, "-m", "teleop_core.commands.cli", "drill", "--drives", drives, "stop_topic"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=200)
    assert done.returncode == 2, done.stdout + done.stderr
    assert "slave_sim ended with exit code 1" in done.stderr
    assert "no arm on this cable" in done.stderr
