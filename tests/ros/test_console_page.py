"""Console's page: in a real browser a person drives a live session, and its recordings prove it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from headless import Headless
from present import present

pytest.importorskip("viser")

import teleop_core as tc
from browser import PULLED, Tab, arrow, until
from console_process import STARTS, ConsoleProcess
from teleop_console.recorded_arms import configuration_of
from teleop_core.bags.reader import Bag
from teleop_core.evaluation.origin import read_origin

pytestmark = [pytest.mark.ros, pytest.mark.browser, pytest.mark.slow]

ROOT = Path(__file__).parents[2]
TIP = "/arm/robot/tip"
# Software draws the page with the processors that the session needs: a small one.
SIZE = (1000, 560)  # px
# A browser that waits for a processor sends late, which is no reason to let go of the stylus.
PATIENT = "operator.remote.timeout=1.5"  # s
# The hand's mass swings a little.
SHARE, STILL = 0.15, 2e-4  # m


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConsoleProcess]:
    folder = tmp_path_factory.mktemp("console")
    own = ("--parts", ROOT / "examples" / "own_control.py")
    started = ConsoleProcess(folder, *own, "--out", folder / "session", "--set", PATIENT)
    try:
        yield started
    finally:
        assert started.end() == 0, started.text


@pytest.fixture(scope="module")
def page(console: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Headless]:
    """The page in a browser that drives."""
    with Tab(tmp_path_factory.mktemp("browser"), *SIZE) as tab:
        tab.visit(console.url)
        tab.shows("ENABLED", STARTS)
        tab.shows("you have control")
        yield tab


def ready(tab: Any) -> None:
    """Wait until the slave follows; where it paused because this machine stood still, resume.

    A session begins enabled, on its way to where it starts: it follows nobody until it is there.
    """
    tab.until("/ENABLED|PAUSED/.test(document.body.innerText)")
    if tab.value("document.body.innerText.includes('PAUSED')"):
        tab.click("Start")
    tab.shows("ENABLED, homed", 120)


def rest(tab: Any) -> None:
    """Wait until the slave is drawn in one place for half a second."""
    tab.value(f"""new Promise((done) => {{
        let last = [], since = 0;
        const look = () => {{
            const now = performance.now(), place = {tab.place_of(TIP)};
            if (!last.length || Math.hypot(...place.map((x, i) => x - last[i])) > {STILL})
                [last, since] = [place, now];
            now - since > 500 ? done() : setTimeout(look, 20);
        }};
        look();
    }})""")


def saved(page: Any, console: Any, name: Any) -> Any:
    """What has been recorded until now, closed under a name."""
    page.fill("name", name)
    page.click("Save as")
    page.shows(f"/{name}", 60)
    until((console.folder / name / "metadata.yaml").exists, "it is closed")
    return console.folder / name


def way(stream: tc.Stream) -> Any:
    """Where a tip went from the begin to the end of a recording [m]."""
    return stream[["x", "y", "z"]][-1] - stream[["x", "y", "z"]][0]


def test_page_of_a_session_opens_without_errors_and_asks_no_other_host(page: Any, console: ConsoleProcess) -> None:
    assert not page.faults()
    assert page.hosts() == {console.url.split("/")[2]}


def test_button_of_ones_own_acts_on_the_session_and_says_what_it_did(page: Any) -> None:
    for told in ("at most 20 mm/s", "at most what its joints make"):
        page.click("Gentle")
        page.shows(told)


@pytest.mark.soak
def test_stylus_that_is_pulled_moves_the_slave_by_gain_and_axes(page: Any, console: ConsoleProcess) -> None:
    ready(page)
    saved(page, console, "before")
    begin, end = arrow(page, 0, PULLED)
    page.pull(begin, end)
    page.mouse("mouseReleased", *end)
    rest(page)
    path = saved(page, console, "pulled")
    recording, origin = tc.open_recording(path), read_origin(Bag(path))
    hand, slave = way(recording["master/measured_cp"]), way(recording["slave/measured_cp"])
    assert hand[0] == pytest.approx(PULLED, rel=0.5)  # as far as the screen tells
    gain = recording["teleop/state"]["gain"][-1]
    expected = gain * origin.axes @ hand
    assert np.linalg.norm(slave - expected) < SHARE * np.linalg.norm(expected)


@pytest.mark.soak
def test_fixed_setting_begins_a_new_session_and_an_impossible_one_is_refused(
    page: Any, console: ConsoleProcess
) -> None:
    ready(page)
    page.click("Settings")
    page.fill("delays ↻", "[nowhere=0.02]")
    page.shows("nowhere")  # the list above the button: it moves the button
    page.click("New session with these")
    page.shows("⚠")
    page.fill("delays ↻", "[slave/servo_jp=0.02]")
    page.shows("slave/servo_jp=0.02")
    page.click("New session with these")
    until((console.folder / "session_session2").exists, "a new session")
    page.shows("ENABLED", STARTS)
    configuration = present(configuration_of(Bag(saved(page, console, "delayed"))))
    assert configuration.groups["teleop"].delays == ("slave/servo_jp=0.02",)
    assert not page.faults()
