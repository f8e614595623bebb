"""Replay on the console's page: a real browser shows a recording as it was at any time."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from headless import Headless
from teleop_core.kernels.geometry import Array

pytest.importorskip("viser")

from browser import Tab
from console_process import ConsoleProcess
from teleop_core.bags.reader import Bag
from teleop_core.graph.topics import SLAVE_MEASURED_CP

pytestmark = [pytest.mark.browser, pytest.mark.slow]

TIP = "/arm/robot/tip"
SHOWN = "/([0-9.]+) s of [0-9.]+ s/.exec(document.body.innerText)?.[1]"
PICTURES = "[...document.querySelectorAll('img')].map((e) => e.src).filter((e) => !/svg/.test(e))"
STILL = 3e-5  # poses that differ less from what is drawn are not sent [m]


@pytest.fixture(scope="module")
def page(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Headless]:
    """Page of a recording in a browser."""
    console = ConsoleProcess(tmp_path_factory.mktemp("console"), recording)
    try:
        with Tab(tmp_path_factory.mktemp("browser"), 1000, 700) as tab:
            tab.visit(console.url)
            tab.shows("Play")
            yield tab
    finally:
        assert console.end() == 0, console.text


def go_to(page: Any, time: float) -> None:
    """Write a time [s] beside its slider."""
    page.fill("time", f"{time:.3f}")
    page.key("Enter")
    page.until(f"{SHOWN} === '{time:.2f}'")


def measured(recording: Path, time: float) -> Array:
    """Where the tip was last measured by a time since the begin [m], as the recording says."""
    bag = Bag(recording)
    series = bag.read(SLAVE_MEASURED_CP)
    at = series.at(bag.start_ns + round(time * 1e9)) + 1  # told a tick after its joints
    return series.values[at, :3]


@pytest.mark.parametrize("time", [9.5, 4.25, 11.0])
def test_tip_is_shown_where_the_recording_says_at_a_time(page: Any, recording: Path, time: float) -> None:
    go_to(page, time)
    wanted = measured(recording, time)
    page.until(f"""{page.place_of(TIP)}.every((x, i) => Math.abs(
        x - {wanted.tolist()}[i]) < {2 * STILL})""")
    assert not page.faults()


def test_replay_plays_pauses_and_steps(page: Any) -> None:
    go_to(page, 2.0)
    page.click("Play")
    page.shows("Pause")
    page.until(f"{SHOWN} > 2.5")
    page.click("Pause")
    page.shows("Play")
    held = float(page.value(SHOWN))
    page.click("+1 s")
    page.until(f"Math.abs({SHOWN} - {held + 1.0}) < 0.011")
    page.click("−1 s")
    page.until(f"Math.abs({SHOWN} - {held}) < 0.011")
    page.value("document.activeElement.blur()")
    page.key("p")
    page.shows("Pause")
    page.until(f"{SHOWN} > {held + 0.3}")
    page.key("p")
    page.until("!document.body.innerText.includes('Pause')")  # or the time is written over


def test_recording_cannot_be_driven_from_the_page(page: Headless) -> None:
    assert not page.value("document.body.innerText.includes('EMERGENCY STOP')")
    assert not page.value("document.body.innerText.includes('Initialize')")


def test_pictures_from_tool_and_microscope_show_the_scene(page: Any) -> None:
    go_to(page, 6.0)
    page.click("View")
    page.click("show")
    page.shows("microscope")
    page.until(f"{PICTURES}.length === 2")
    blank = page.value(PICTURES)
    page.until(f"{PICTURES}.every((seen, i) => seen !== {blank}[i])")
    page.click("show")
    page.until(f"{PICTURES}.length === 0")
