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
from browser import Tab, until
from console_process import STARTS, ConsoleProcess
from teleop_console.recorded_arms import configuration_of
from teleop_core.bags.reader import Bag
from teleop_core.evaluation.origin import read_origin
from teleop_core.slave.operation import State

pytestmark = [pytest.mark.ros, pytest.mark.browser, pytest.mark.slow]

ROOT = Path(__file__).parents[2]
TIP = "/arm/robot/tip"
GRIP, ARROW = "/arm/master/grip", 0.07  # the stylus' gizmo, and the heads of its arrows [m]
DRIVER = "/browser [0-9]+ has control/.exec(document.body.innerText)?.[0]"
PULLED = 0.012  # m
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
        tab.shows("has control")
        yield tab


def ready(tab: Any) -> None:
    """Wait until the slave follows; where it paused because this machine stood still, resume.

    A session begins enabled, on its way to where it starts: it follows nobody until it is there.
    """
    tab.until("/ENABLED|PAUSED/.test(document.body.innerText)")
    if tab.value("document.body.innerText.includes('PAUSED')"):
        tab.click("Start")
    tab.shows("ENABLED, homed", 120)


def arrow(tab: Any, axis: int, way: float = PULLED) -> Any:
    """Where an arrow of the stylus is seen, and where it would be a way farther [px]."""
    begin, end = np.zeros(3), np.zeros(3)
    begin[axis], end[axis] = ARROW, ARROW + way
    return tab.seen_at(GRIP, begin), tab.seen_at(GRIP, end)


def pull(tab: Any, axis: int, way: float = PULLED) -> Any:
    """Take an arrow of the stylus and pull it along itself; the button stays down."""
    grip, goal = arrow(tab, axis, way)
    tab.mouse("mouseMoved", *grip)
    tab.value("new Promise((done) => setTimeout(done, 200))")
    tab.pull(grip, goal, steps=10)
    return goal


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
@pytest.mark.parametrize(("axis", "by"), [(0, "mouse"), (1, "finger")])
def test_stylus_that_is_pulled_moves_the_slave_by_gain_and_axes(
    page: Any, console: ConsoleProcess, axis: int, by: str
) -> None:
    ready(page)
    saved(page, console, f"before_{axis}_{by}")
    if by == "mouse":
        page.mouse("mouseReleased", *pull(page, axis))
    else:
        page.swipe(*arrow(page, axis, -PULLED))
    rest(page)
    path = saved(page, console, f"pulled_{axis}_{by}")
    recording, origin = tc.open_recording(path), read_origin(Bag(path))
    hand, slave = way(recording["master/measured_cp"]), way(recording["slave/measured_cp"])
    assert np.argmax(np.abs(hand)) == axis
    assert abs(hand[axis]) == pytest.approx(PULLED, rel=0.5)  # as far as the screen tells
    gain = recording["teleop/state"]["gain"][-1]
    expected = gain * origin.axes @ hand
    assert np.linalg.norm(slave - expected) < SHARE * np.linalg.norm(expected)


@pytest.mark.soak
def test_emergency_stop_stops_until_it_is_released(page: Any, console: ConsoleProcess) -> None:
    ready(page)
    page.click("EMERGENCY STOP")
    page.until("!document.body.innerText.includes('ENABLED')")
    states = tc.open_recording(saved(page, console, "stopped"))["slave/operation"]["state"]
    assert states[-1] in {State.FAULT, State.DISABLED}
    page.click("Release")
    page.click("Initialize")
    page.shows("ENABLED", 60)


@pytest.mark.soak
def test_browser_that_is_closed_in_motion_leaves_the_slave_still(page: Any, console: Any, tmp_path: Path) -> None:
    ready(page)
    begin = page.value(page.place_of(TIP))
    saved(page, console, "before_close")
    with Tab(tmp_path, *SIZE) as other:
        other.visit(console.url)
        driver = page.value(DRIVER)
        other.click("Take control")
        other.until(f"{DRIVER} !== '{driver}'")
        ready(other)
        pull(other, 0, -PULLED)
        led = f"{page.place_of(TIP)}.map((x, i) => x - {begin}[i])"
        page.until(f"Math.hypot(...{led}) > {0.25 * PULLED}")  # and on its way still
    page.shows("clutched")
    page.click("Take control")
    page.until(f"{DRIVER} === '{driver}'")  # only who drives may save
    saved(page, console, "closed")
    page.value("new Promise((done) => setTimeout(done, 1500))")
    after = tc.open_recording(saved(page, console, "after_close"))
    moved = tc.open_recording(console.folder / "closed")
    assert np.linalg.norm(way(moved["slave/measured_cp"])) > 0.2 * PULLED
    still = after["slave/measured_cp"][["x", "y", "z"]]
    assert np.ptp(still, axis=0).max() < STILL
    assert after["teleop/state"]["is_clutched"][-1] == 1.0


@pytest.mark.soak
def test_recording_that_was_saved_is_scored_by_a_button(page: Any, console: ConsoleProcess) -> None:
    ready(page)
    page.mouse("mouseReleased", *pull(page, 0))
    saved(page, console, "to_score")
    page.click("Scores")
    page.click("Score the last saved recording")
    page.shows("tracking error", 60)
    page.click("Drive")


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
