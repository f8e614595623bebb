"""Start page, live: a new user chooses a URDF arm, drives it, ends, sees the score and replays."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("viser")

import teleop_core as tc
from browser import Tab, until
from console_process import STARTS, ConsoleProcess

pytestmark = [pytest.mark.ros, pytest.mark.browser, pytest.mark.slow]

URDF = Path(__file__).parents[2] / "examples" / "any_arm.urdf"
FORM = "!document.querySelector('#t-start').hidden"
READY = f"{FORM} && !document.querySelector('#t-begin').disabled"
# Software draws the page with the processors that the session needs: a small one.
SIZE = (1000, 640)  # px


@pytest.fixture
def console(tmp_path: Path) -> Iterator[ConsoleProcess]:
    started = ConsoleProcess(tmp_path)
    try:
        yield started
    finally:
        assert started.end() == 0, started.text


def pick(tab: Any, label: str, word: str) -> None:
    """Choose a word in the list behind a label."""
    tab.value(f"""(() => {{
        const row = [...document.querySelectorAll('.t-field')].find(
            (e) => e.firstChild.textContent === '{label}');
        row.querySelector('select').value = '{word}';
        row.querySelector('select').dispatchEvent(new Event('change', {{bubbles: true}}));
    }})()""")


@pytest.mark.soak
def test_session_is_begun_stopped_ended_scored_repeated_and_replayed_from_the_page(
    console: ConsoleProcess, tmp_path: Path
) -> None:
    with Tab(tmp_path / "browser", *SIZE) as tab:
        tab.visit(console.url)
        tab.until(READY, STARTS)
        tab.value(f"""(() => {{
            const dropped = new DataTransfer();
            dropped.items.add(new File([{json.dumps(URDF.read_text())}], 'any_arm.urdf'));
            document.querySelector('#t-start').dispatchEvent(
                new DragEvent('drop', {{dataTransfer: dropped, bubbles: true, cancelable: true}}));
        }})()""")
        tab.shows("robot=robots/any_arm.urdf")
        tab.shows("must be one of camera, tool0")
        tab.fill("Tip", "tool0")
        tab.key("Tab")
        pick(tab, "Network", "delay_100")
        tab.shows("network.preset=delay_100")
        tab.until(READY)
        tab.click("Start")
        tab.shows("ENABLED", STARTS)
        tab.shows("Next: drag the stylus")
        tab.click("EMERGENCY STOP")
        tab.shows("All arms are stopped")
        tab.click("End session")
        tab.until(f"{FORM} && document.querySelector('.t-list :is(.t-good, .t-held)')", 180)
        (recorded,) = (tmp_path / "bags").iterdir()
        score = tc.open_recording(recorded).score()
        tab.shows(score.verdict.text)
        assert score.session.robot == "robots/any_arm.urdf"
        tab.shows("Repeat")
        tab.value("document.querySelector('.t-list input').click()")
        tab.click("Replay")
        tab.shows("Play", 60)
        tab.click("Back to all sessions")
        tab.until(FORM)
        assert not tab.faults()


def test_session_that_cannot_go_on_leads_back_to_the_form_with_its_reason(
    console: ConsoleProcess, tmp_path: Path
) -> None:
    with Tab(tmp_path / "browser", *SIZE) as tab:
        tab.visit(console.url)
        tab.until(READY, STARTS)
        pick(tab, "Operator", "gamepad")
        tab.shows("operator=gamepad")
        tab.until(READY)
        tab.click("Start")
        until(lambda: "It ended: " in console.text, "it ends", STARTS)
        tab.until(FORM)
        tab.shows("It ended: ")
