"""Page of a session in a browser: the stylus is pulled, a browser goes, what was saved is scored, settings renew."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser")

import teleop_core as tc
from browser import GRIP, PULLED, VIEWER, Tab, arrow, until
from desk import POSE, Desk, shown
from page_client import TOKEN, PageClient
from teleop_console.answers import Situation
from teleop_console.app import Console
from teleop_console.link import ParameterInfo
from teleop_console.look import DARK, LIGHT
from teleop_console.server import ConsoleServer
from teleop_core.base.errors import TeleopError
from teleop_core.session import api

pytestmark = [pytest.mark.browser, pytest.mark.slow]

EXAMPLE = Path(__file__).parents[2] / "bags" / "example"
PIXEL = f"""(() => {{
    const pen = Object.assign(document.createElement('canvas'), {{ width: 1, height: 1 }}).getContext('2d');
    pen.drawImage({VIEWER}.canvas, 0, 0);
    return [...pen.getImageData(0, 0, 1, 1).data].slice(0, 3);
}})()"""
"""What is seen in the corner of the scene: its ground."""
PANEL = "document.querySelector('[data-testid=floating-panel]')?.getBoundingClientRect()"


def ready(tab: Any, url: str) -> None:
    """Open the page of a session, and wait until its camera stands still."""
    tab.clear(1000, 560)
    tab.visit(url)
    tab.shows("ENABLED")
    tab.until("document.querySelector('#t-starting').hidden")
    tab.value(f"""new Promise((done) => {{  // until the camera has stood still for half a second
        let last = '', since = 0;
        const look = () => {{
            const now = performance.now(), seen = {VIEWER}.camera.matrixWorld.elements.join();
            if (seen !== last) [last, since] = [seen, now];
            now - since > 500 ? done() : setTimeout(look, 20);
        }};
        look();
    }})""")


@pytest.mark.parametrize(("axis", "by", "sign"), [(0, "mouse", 1), (1, "finger", -1)])
def test_stylus_that_is_pulled_by_an_arrow_is_wanted_along_it_and_let_go_with_the_button(
    tab: Any, axis: int, by: str, sign: int
) -> None:
    with shown(Desk()) as (server, desk):
        ready(tab, server.url)
        begin, end = arrow(tab, axis, sign * PULLED)
        if by == "mouse":
            tab.pull(begin, end)
            until(lambda: desk.poses, "it is held")
            assert desk.let_gos == 0
            tab.mouse("mouseReleased", *end)
        else:
            tab.swipe(begin, end)
        until(lambda: desk.let_gos, "it is let go")
        way = desk.poses[-1] - POSE
        assert sign * way[axis] == pytest.approx(PULLED, rel=0.5)  # as far as the screen tells
        assert np.abs(np.delete(way, axis)).max() < 1e-6  # along the arrow alone, and not turned
        assert not tab.faults()


def test_page_that_watches_has_no_handles_until_it_takes_control(tab: Any) -> None:
    seen = f"__viserSceneTree.getState()['{GRIP}']?.effectiveVisibility"
    with shown(Desk()) as (server, _), PageClient(server.port):
        until(lambda: server.drivers.driver is not None, "another page drives")
        ready(tab, server.url)
        tab.shows("you watch")
        tab.until(f"{seen} === false")
        tab.click("Take control")
        tab.until(f"{seen} === true")
        tab.until(
            "[...document.querySelectorAll('button')].some((b) => b.textContent === 'Take control' && b.disabled)"
        )


@pytest.mark.soak
def test_browser_that_is_closed_while_it_pulls_holds_the_stylus_no_longer(tab: Any, tmp_path: Path) -> None:
    with shown(Desk()) as (server, desk):
        with Tab(tmp_path, 1000, 560) as other:
            ready(other, server.url)

            def is_held() -> bool:
                """Whether a pull takes it: where the camera has moved, one aims again, as a person does."""
                begin, end = arrow(other, 0)
                other.pull(begin, end)
                with suppress(AssertionError):
                    return until(lambda: desk.poses, "a pull", 5.0)
                other.mouse("mouseReleased", *end)
                return False

            until(is_held, "it is held")
            let_gos = desk.let_gos
        until(lambda: desk.let_gos > let_gos, "it is let go")
        count, looks = len(desk.poses), desk.looks
        until(lambda: desk.looks > looks + 30, "the page is drawn on")
        assert len(desk.poses) == count
        ready(tab, server.url)  # who comes then drives
        tab.shows("you have control")


def test_recording_that_was_saved_is_scored_by_a_button(tab: Any) -> None:
    desk, verdict = Desk(), tc.open_recording(EXAMPLE).score().verdict.text
    desk.saved = EXAMPLE
    with shown(desk) as (server, _):
        ready(tab, server.url)
        assert not tab.value(f"document.body.innerText.includes({verdict!r})")
        tab.click("Save as")
        tab.shows("saved: ")
        tab.click("Scores")
        tab.click("Score the last saved recording")
        tab.shows(verdict, 120)


def test_fixed_setting_begins_a_new_session_and_an_impossible_one_is_refused_with_its_reason(tab: Any) -> None:
    desk, begun = Desk(), list[tuple[str, ...]]()
    desk.known = {("teleop", "delays"): ParameterInfo("teleop", "delays", ("a=0.1",), is_fixed=True)}

    def renew(texts: tuple[str, ...]) -> str:
        try:
            api.configuration(None, texts=texts)
        except TeleopError as error:
            return str(error)
        begun.append(texts)
        return ""

    with shown(desk, renew) as (server, _):
        ready(tab, server.url)
        tab.click("Settings")
        tab.fill("delays ↻", "[nowhere=0.02]")
        tab.shows("= [nowhere=0.02]")  # the list above the button: it moves the button
        tab.click("New session with these")
        tab.shows("⚠")
        assert not begun
        tab.fill("delays ↻", "[slave/servo_jp=0.02]")
        tab.shows("= [slave/servo_jp=0.02]")
        tab.click("New session with these")
        until(lambda: begun, "a new session")
        assert begun == [("teleop.delays=[slave/servo_jp=0.02]",)]


def test_panel_has_its_width_where_the_form_was_seen_on_a_phone_and_the_session_on_a_desk(tab: Any) -> None:
    with ConsoleServer(0, token=TOKEN) as server:
        server.answers.situation = Situation(chooses=True)
        tab.visit(server.url)
        for width in (1400, 390, 1400):
            tab.resize(width, 900)
            tab.until(f"innerWidth === {width} && document.documentElement.classList.contains('t-choosing')")
            tab.until(f"Boolean({PANEL}) === {str(width > 390).lower()}")  # a sheet at the foot takes its place
        console = Console(server, Desk())
        console.draw()
        tab.shows("ENABLED")
        tab.until(f"{PANEL}?.width > 300 && {PANEL}.right <= innerWidth")


def test_scene_that_software_draws_has_few_pixels_and_other_ones_where_the_address_asks_for_them(tab: Any) -> None:
    canvas = f"{VIEWER}.canvas"
    with shown(Desk()) as (server, _):
        ready(tab, server.url)
        for width, height in ((390, 844), (1400, 900)):
            tab.resize(width, height)
            tab.until(f"innerWidth === {width} && {canvas}.width * {canvas}.height <= 320000")
        told = tab.value(f"{canvas}.getContext('webgl2').getContextAttributes()")
        assert (told["antialias"], told["alpha"]) == (False, False)
        for scheme, ground in (("light", LIGHT), ("dark", DARK)):
            if scheme == "dark":
                tab.click("View")
                tab.click("dark")
            tab.until(f"({PIXEL}).join() === '{','.join(map(str, ground))}'")
        ready(tab, f"{server.url}?fixedDpr=1")
        tab.until(f"{canvas}.width === {canvas}.clientWidth")


def test_strip_of_time_stays_where_its_requests_are_not_answered(tab: Any) -> None:
    shows = "document.querySelector('#t-strip')?.hidden === false"
    with shown(Desk()) as (server, _):
        ready(tab, server.url)
        tab.until(shows)
        tab.value("window.lost = 0; window.fetch = () => { lost += 1; return Promise.reject(new Error('lost')); }; 0")
        tab.shows("NO CONNECTION")
        tab.until("lost > 12")
        assert tab.value(shows)


def test_end_of_a_session_lies_beside_the_panel_of_a_phone_while_the_page_has_a_banner(tab: Any) -> None:
    over = """(() => {
        const end = document.querySelector('#t-end').getBoundingClientRect();
        const panel = [...document.querySelectorAll('#root .mantine-Paper-root')].find(
            (one) => getComputedStyle(one).position === 'fixed').getBoundingClientRect();
        return end.height > 0 && end.bottom <= panel.top + 1;
    })()"""
    with shown(Desk(is_stoppable=True), can_end=True) as (server, desk):
        ready(tab, server.url)
        tab.resize(390, 844)
        desk.press(is_pressed=True)
        tab.until("document.documentElement.classList.contains('t-says')")
        tab.until(over)
