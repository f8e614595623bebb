"""A study with people, live: trials in the browser are recorded and scored, and go on after a kill."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("viser")

import teleop_core as tc
from browser import Tab, until
from console_process import ENDS, STARTS
from present import present

pytestmark = [pytest.mark.ros, pytest.mark.browser, pytest.mark.slow]

STUDY = """\
scenario: point
duration: 10.0
seeds: 2
sweep: {display.latency: [0.033, 0.333]}
metrics: [task.time_s]
people:
  title: Pointing
  consent: You press in targets.
  instructions: Press in the ball.
  participants: 1
  practice: 0
  repetitions: 1
  attempts: 4
  duration: 60.0
  order: fixed
  operator: OPERATOR
  questions: [{name: fun, text: "Was it fun?", low: "no", high: "yes"}]
"""
READY = "document.querySelector('#t-begin') && !document.querySelector('#t-begin').disabled"
DRAWN = """!document.querySelector('#t-trial').hidden
    && document.querySelector('#t-starting').hidden && document.querySelector('#t-start').hidden"""
PANEL = "[...document.querySelectorAll('.mantine-Paper-root')].some((e) => e.getClientRects().length)"
SIZE = (1000, 640)  # px; software draws the page with the processors that the session needs


@contextmanager
def conducted(folder: Path, operator: str = "observer") -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """The command at work, and the address of the participant's page; ended with Ctrl-C."""
    (folder / "s.yaml").write_text(STUDY.replace("OPERATOR", operator))
    command = [sys.executable, "-m", "teleop_core.commands.cli", "people", "s.yaml", "--store", "store"]
    log = folder / "people.log"
    with log.open("wb") as file:
        process = subprocess.Popen([*command, "--port", "0", "--no-browser"], stdout=file, stderr=file, cwd=folder)
    try:
        told: Any = until(lambda: re.search(r"participants: (\S+);", log.read_text()), "an address", STARTS)
        yield process, told[1]
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            assert process.wait(ENDS) == 0, log.read_text()
    finally:
        process.kill()
        process.wait()


def journal(folder: Path) -> Any:
    """What is on disk of the participant."""
    return json.loads((folder / "store" / "p01" / "journal.json").read_text())


def test_trials_are_recorded_scored_and_go_on_where_they_were_after_a_kill(tmp_path: Path) -> None:
    with Tab(tmp_path / "browser", *SIZE) as tab:
        with conducted(tmp_path) as (process, url):
            tab.visit(url)
            tab.until(READY)
            tab.click("I agree and take part")
            tab.shows("Trial 1 of 2")
            tab.until(READY)
            tab.click("Begin")
            until((tmp_path / "store" / "p01" / "trial_01").exists, "a recording", STARTS)
            process.kill()
            process.wait()
        assert journal(tmp_path)["events"] == []
        with conducted(tmp_path) as (_, url):
            tab.visit(url)
            tab.shows("Trial 1 of 2")
            tab.until(READY)
            tab.click("Begin")
            tab.shows("Was it fun?", STARTS)
            until(lambda: "scores" in journal(tmp_path)["events"][0], "its score", 60)
    (event,) = journal(tmp_path)["events"]
    assert (event["state"], event["bag"]) == ("done", "trial_01_2")
    recording = tc.open_recording(tmp_path / "store" / "p01" / "trial_01_2")
    assert recording.score().value("task.time_s") == event["scores"]["task.time_s"]
    assert present(recording.score().value("task.attempts")) >= 4
    assert "participant p01, trial 1, repetition 1" in " ".join(recording.metadata["configuration"].split())


@pytest.mark.soak
def test_a_stop_fails_the_trial_and_a_person_presses_with_a_key(tmp_path: Path) -> None:
    with Tab(tmp_path / "browser", *SIZE) as tab, conducted(tmp_path, "remote") as (_, url):
        tab.visit(url)
        tab.until(READY)
        tab.click("I agree and take part")
        tab.shows("Trial 1 of 2")
        tab.until(READY)
        tab.click("Begin")
        tab.until(f"{DRAWN} && !document.querySelector('#t-press').hidden", STARTS)
        assert not tab.value(PANEL)
        tab.key("j")
        tab.shows("1 of 4 done")
        tab.click("EMERGENCY STOP")
        tab.shows("Call the person who conducts the study")
        tab.click("End this trial")
        tab.shows("Please wait for the person who conducts the study.", STARTS)
    (event,) = journal(tmp_path)["events"]
    assert (event["state"], event["reason"]) == ("failed", "the arms were stopped")
