"""The page's emergency stop: in view at any scroll, and seen by all pages when pressed."""

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from headless import Headless
from page_client import TOKEN
from teleop_console.answers import Situation
from teleop_console.app import splash
from teleop_console.server import ConsoleServer

pytest.importorskip("viser")

from browser import both, opened, until
from desk import Desk, shown

pytestmark = [pytest.mark.browser, pytest.mark.slow]

STOP = """(() => {
    const box = document.querySelector('#t-stop').getBoundingClientRect();
    const at = (x, y) => document.elementFromPoint(x, y)?.id === 't-stop';
    return box.height >= 44 && box.left >= 0 && box.right <= innerWidth && box.top >= 0
        && box.bottom <= innerHeight && at(box.x + 5, box.y + 5)
        && at(box.right - 5, box.bottom - 5);
})()"""
SCROLL = """document.querySelectorAll('*').forEach((e) => { e.scrollTop = SHARE * e.scrollHeight; })"""
STOPPED = "document.documentElement.classList.contains('t-stopped')"
DEAD = """[...document.querySelectorAll('button')].filter((b) =>
    ['Start', 'Pause', 'Home'].includes(b.innerText)).every((b) => b.disabled)"""


@pytest.fixture(scope="module", params=both())
def tab(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Headless]:
    if request.param == "Tab":  # the browser that tests of pages share
        shared = request.getfixturevalue("_browser")
        shared.clear(390, 780)
        shared.call("Emulation.setEmulatedMedia", features=[])
        yield shared
        return
    with opened(request.param, tmp_path_factory.mktemp("stop"), 390, 780) as browser:
        yield browser


@pytest.fixture(autouse=True)
def _clean(tab: Any) -> Iterator[None]:
    """Each test begins with an empty tab and with no memory of errors."""
    yield
    tab.clear()


@pytest.mark.parametrize("size", [(390, 780), (780, 390), (1400, 900)])
def test_stop_is_in_view_at_any_scroll_and_the_page_looks_stopped_when_it_was_pressed(
    tab: Any, size: tuple[int, int]
) -> None:
    tab.resize(*size)
    with shown(Desk(is_stoppable=True)) as (server, desk):
        tab.visit(server.url)
        tab.shows("ENABLED")
        for share in (0.0, 0.5, 1.0):
            tab.value(SCROLL.replace("SHARE", str(share)) + "; 0")
            tab.until(STOP)
        assert not tab.value(STOPPED)
        tab.click("EMERGENCY STOP")
        tab.until(STOPPED)
        until(lambda: desk.stops == 1, "the stop is heard")
        tab.shows("press Initialize")  # what to do next
        tab.until(DEAD)
        assert all(not handle.visible for handle in gizmos(server))
        assert tab.value(STOP)  # it may be pressed again
        tab.click("Release")
        until(lambda: "release" in desk.asked, "it is released")
        tab.shows("Released; the arms stay in FAULT")
        assert not tab.faults()


def test_press_that_takes_a_while_is_one_press(tab: Any) -> None:
    with shown(Desk(is_stoppable=True)) as (server, desk):
        tab.visit(server.url)
        tab.shows("ENABLED")
        press = "document.querySelector('#t-stop').dispatchEvent(new {}('{}', {{ detail: 1 }})); 0"
        tab.value(press.format("PointerEvent", "pointerdown"))
        tab.shows("press Initialize")
        tab.until(DEAD)  # it is confirmed: the next press would be another one
        tab.value(press.format("MouseEvent", "click"))
        tab.value("fetch('alive').then((answer) => answer.status)")  # behind all that was asked before
        assert desk.stops == 1
        tab.value("document.querySelector('#t-stop').click()")  # as a screen reader does it
        until(lambda: desk.stops == 2, "the second press")


def gizmos(server: ConsoleServer) -> list[Any]:
    """All styli's handles that the server shows."""
    return list(server.viser.scene._handle_from_transform_controls_name.values())


@pytest.mark.parametrize("size", [(390, 780), (780, 390), (1400, 900)])
def test_nothing_that_a_session_offers_lies_over_the_stop(tab: Any, size: tuple[int, int]) -> None:
    tab.resize(*size)
    with ConsoleServer(0, token=TOKEN) as server:
        server.answers.situation = Situation(can_end=True, can_press=True, state="ENABLED, homed")
        tab.visit(server.url)
        for name in ("#t-end", "#t-press"):
            tab.until(f"document.querySelector('{name}').getClientRects().length")
        tab.until(STOP)
        assert tab.value("document.querySelector('[role=status].t-spoken').textContent") == "ENABLED, homed"


def test_space_stops_from_anywhere_but_a_field_in_which_it_is_typed(tab: Any) -> None:
    with shown(Desk(is_stoppable=True)) as (server, desk):
        tab.visit(server.url)
        tab.shows("ENABLED")
        tab.fill("name", "a")
        tab.key(" ")
        tab.value("document.activeElement.blur()")
        assert desk.stops == 0
        tab.click("Settings")  # the focus is on a button now, which space would press
        tab.key(" ")
        tab.until(STOPPED)
        until(lambda: desk.stops == 1, "the stop is heard")


def test_every_page_looks_stopped_whoever_pressed_and_says_when_the_console_is_gone(tab: Any) -> None:
    with shown(Desk(is_stoppable=True)) as (server, desk):
        tab.visit(server.url)
        tab.shows("ENABLED")
        desk.press(is_pressed=True)
        tab.until(STOPPED)
        desk.press(is_pressed=False)
    tab.shows("NO CONNECTION")


def test_stop_is_in_the_page_before_there_is_an_arm_and_stops_it_as_soon_as_there_is(tab: Any) -> None:
    pressed = threading.Event()
    with ConsoleServer(0, token=TOKEN) as server, splash(server) as say:
        tab.visit(server.url)
        tab.until(STOP)
        say("looks for an arm …")
        tab.shows("looks for an arm …")
        tab.click("EMERGENCY STOP")
        tab.shows("No arm is there yet")
        assert not pressed.is_set()
        server.answers.stop = pressed.set
        assert pressed.wait(60)
        assert all("409" in fault for fault in tab.faults())  # what it was answered before
