"""Console's page: in a real browser a person drives a live session, and its recordings prove it."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("viser")

import teleop_core as tc
from browser import Tab, until
from teleop_core.bags.reader import Bag
from teleop_core.evaluation.origin import read_origin
from teleop_core.operation import State

pytestmark = [pytest.mark.ros, pytest.mark.browser, pytest.mark.slow]

GRIP, ARROW = "/arm/master/grip", 0.07  # the stylus' gizmo, and the heads of its arrows [m]
DRIVER = "/browser [0-9]+ drives/.exec(document.body.innerText)?.[0]"
PULLED = 0.012  # m
STARTS = 180.0  # s; kernels may have to be compiled
# Software draws the page with the processors that the session needs: a small one.
SIZE = (1000, 560)  # px
# The hand's mass swings a little, and it lets go for moments where the browser is slow.
SHARE, STILL = 0.15, 2e-4  # m


class Console:
    """The command as a process; what it says is in ``text``."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._log = folder, folder / "console.log"
        command = [sys.executable, "-m", "teleop_core.cli", "console", "--port", "0"]
        command += ["--no-browser", "--out", str(folder / "session")]
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder)
        told = until(lambda: re.search(r"http://\S+?/(?=;)", self.text), "an address", STARTS)
        self.url = told[0]

    @property
    def text(self) -> str:
        return self._log.read_text(errors="replace")

    def end(self) -> int:
        """Exit code after Ctrl-C."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        return self._process.wait(60)


@pytest.fixture(scope="module")
def console(tmp_path_factory):
    started = Console(tmp_path_factory.mktemp("console"))
    try:
        yield started
    finally:
        assert started.end() == 0, started.text


@pytest.fixture(scope="module")
def page(console, tmp_path_factory):
    """The page in a browser that drives."""
    with Tab(tmp_path_factory.mktemp("browser"), *SIZE) as tab:
        tab.visit(console.url)
        tab.shows("ENABLED", STARTS)
        tab.shows("drives")
        yield tab


def ready(tab):
    """Wait until the slave follows; where it paused because this machine stood still, resume."""
    tab.until("/ENABLED|PAUSED/.test(document.body.innerText)")
    if tab.value("document.body.innerText.includes('PAUSED')"):
        tab.click("Start")
    tab.shows("ENABLED", 60)


def pull(tab, axis, way=PULLED):
    """Take an arrow of the stylus and pull it along itself; the button stays down."""
    begin, end = np.zeros(3), np.zeros(3)
    begin[axis], end[axis] = ARROW, ARROW + way
    grip, goal = tab.seen_at(GRIP, begin), tab.seen_at(GRIP, end)
    tab.mouse("mouseMoved", *grip)
    tab.value("new Promise((done) => setTimeout(done, 200))")
    tab.pull(grip, goal, steps=10)
    return goal


def saved(page, console, name):
    """What has been recorded until now, closed under a name."""
    page.fill("name", name)
    page.click("Save as")
    page.shows(f"/{name}", 60)
    until((console.folder / name / "metadata.yaml").exists, "it is closed")
    return console.folder / name


def way(stream):
    """Where a tip went from the begin to the end of a recording [m]."""
    return stream[["x", "y", "z"]][-1] - stream[["x", "y", "z"]][0]


def test_page_of_a_session_opens_without_errors_and_asks_no_other_host(page, console):
    assert not page.faults()
    assert page.hosts() == {console.url.split("/")[2]}


@pytest.mark.parametrize("axis", [0, 1])
def test_stylus_that_is_pulled_moves_the_slave_by_the_gain_and_the_map_of_axes(page, console, axis):
    ready(page)
    saved(page, console, f"before_{axis}")
    page.mouse("mouseReleased", *pull(page, axis))
    path = saved(page, console, f"pulled_{axis}")
    recording, origin = tc.open_recording(path), read_origin(Bag(path))
    hand, slave = way(recording["master/measured_cp"]), way(recording["slave/measured_cp"])
    assert np.argmax(np.abs(hand)) == axis
    assert hand[axis] == pytest.approx(PULLED, rel=0.5)  # as far as the screen tells
    gain = recording["teleop/state"]["gain"][-1]
    expected = gain * origin.axes @ hand
    assert np.linalg.norm(slave - expected) < SHARE * np.linalg.norm(expected)


@pytest.mark.parametrize("way_in", ["button", "key"])
def test_emergency_stop_stops_by_button_and_key_until_it_is_released(page, console, way_in):
    ready(page)
    if way_in == "button":
        page.click("EMERGENCY STOP")
    else:
        page.value("document.activeElement.blur()")
        page.key(" ")
    page.until("!document.body.innerText.includes('ENABLED')")
    path = saved(page, console, f"stopped_{way_in}")
    states = tc.open_recording(path)["slave/operation"]["state"]
    assert states[-1] in {State.FAULT, State.DISABLED}
    page.click("release")
    page.click("Initialize")
    page.shows("ENABLED", 60)


def test_page_that_is_loaded_again_goes_on_driving(page):
    page.reload()
    page.shows("drives", 60)
    ready(page)
    page.click("Stop")
    page.shows("PAUSED")
    ready(page)
    assert not page.faults()


def test_browser_that_is_closed_in_motion_leaves_the_slave_still(page, console, tmp_path):
    ready(page)
    saved(page, console, "before_close")
    with Tab(tmp_path, *SIZE) as other:
        other.visit(console.url)
        driver = page.value(DRIVER)
        other.click("Take control")
        other.until(f"{DRIVER} !== '{driver}'")
        ready(other)
        pull(other, 0, -PULLED)
    page.shows("clutched", 30)
    page.click("Take control")
    saved(page, console, "closed")
    page.value("new Promise((done) => setTimeout(done, 1500))")
    after = tc.open_recording(saved(page, console, "after_close"))
    moved = tc.open_recording(console.folder / "closed")
    assert np.linalg.norm(way(moved["slave/measured_cp"])) > 0.2 * PULLED
    still = after["slave/measured_cp"][["x", "y", "z"]]
    assert np.ptp(still, axis=0).max() < STILL
    assert after["teleop/state"]["is_clutched"][-1] == 1.0
