"""Hostile pages: nothing that they send moves an arm that they do not drive, or stops the stop."""

import logging
from collections.abc import Callable
from typing import Any

import pytest

from present import present

pytest.importorskip("viser")

import hostile
from browser import until
from desk import Desk, shown
from page_client import PageClient, ask
from teleop_core.console.filter import BURST, FLOOD
from teleop_core.console.server import ConsoleServer

# viser warns of what is queued for a page that leaves at this moment.
pytestmark = pytest.mark.filterwarnings("ignore:Queued a")


@pytest.fixture(scope="module")
def served() -> Any:
    """A page of a desk, drawn as the command draws it, and whoever drives it."""
    with shown(Desk()) as (server, desk), PageClient(server.port) as driver:
        until(lambda: server.drivers.driver is not None, "it drives")
        yield server, desk, driver


@pytest.mark.parametrize("attack", hostile.HOSTILE, ids=lambda attack: attack.__name__)
def test_page_that(
    attack: Callable[[PageClient, PageClient], None],
    served: Any,
    caplog: pytest.LogCaptureFixture,
) -> None:
    server, desk, driver = served
    with PageClient(server.port) as watcher:
        desk.asked.clear()
        before = {name: handle_state(server, uuid) for name, uuid in driver.elements.items()}
        attack(watcher, driver)
        watcher.sync()
        driver.sync()
        assert desk.asked == []
        assert {n: handle_state(server, u) for n, u in driver.elements.items()} == before
        pressed = desk.stops
        assert ask(server.port, "/stop", Teleop_Page="new")[0] == 204
        assert desk.stops == pressed + 1
        assert driver.ask("/alive")[1]["drives"] is True
        assert not driver.is_cut
    assert not [r for r in caplog.records if r.levelno >= logging.ERROR and "teleop" in r.name]
    until(lambda: server.viser.connections() == 1, "the page has gone")


def handle_state(
    server: ConsoleServer, uuid: str
) -> tuple[str | bool, str, bool, bool, int, bool] | None:
    """What viser keeps of an element that pages could change."""
    handle = server.viser.gui._gui_input_handle_from_uuid.get(uuid)
    if handle is None:
        return None
    state = handle._impl
    callbacks = len(state.update_cb)
    return handle.value, handle.label, handle.visible, handle.disabled, callbacks, state.removed


def test_driver_is_heard_all_the_same(served: tuple[ConsoleServer, Desk, PageClient]) -> None:
    server, desk, driver = served
    desk.asked.clear()
    driver.say({"type": "TransformControlsDragStartMessage", "name": driver.gizmos[0], "owner": ""})
    driver.drag()
    until(lambda: "hold" in desk.asked, "the stylus is held")
    driver.say({"type": "TransformControlsDragEndMessage", "name": driver.gizmos[0], "owner": ""})
    driver.click("Home")
    until(lambda: "home" in desk.asked, "it goes home")
    driver.set(driver.elements["dark"], value=True)
    until(lambda: present(handle_state(server, driver.elements["dark"]))[0], "it is dark")


def test_stop_is_sent_while_every_press_of_a_button_waits_for_an_arm_that_does_not_answer(
    served: tuple[ConsoleServer, Desk, PageClient],
) -> None:
    _, desk, driver = served
    desk.obeys.clear()
    try:
        for _ in range(3):
            for label in ("Initialize", "Home", "Pause"):
                driver.click(label)
        driver.sync()
        pressed = desk.stops
        assert driver.ask("/stop")[0] == 204
        assert desk.stops == pressed + 1
    finally:
        desk.obeys.set()


def test_what_a_watching_page_changed_on_its_own_screen_is_put_back(
    served: tuple[ConsoleServer, Desk, PageClient],
) -> None:
    server, _, _ = served
    with PageClient(server.port) as watcher:
        uuid = watcher.elements["paths"]
        watcher.set(uuid, value=False)
        until(lambda: watcher.values.get(uuid, [])[-1:] == [True], "it is shown as it is")


def test_refusals_are_counted_and_each_kind_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    with ConsoleServer(0) as server, PageClient(server.port, comes_up=False) as page:
        for _ in range(50):
            page.raw(b"nothing")
        page.sync()
        for _ in range(int(2 * BURST)):
            page.raw(b"nothing")
        until(lambda: FLOOD in server.viser.filter.refused, "the flood is cut off")
    counts = server.viser.filter.refused
    assert counts[FLOOD] == 1
    assert 50 <= sum(counts.values()) <= BURST + 50
    said = [record.getMessage() for record in caplog.records if "refused" in record.getMessage()]
    assert len(said) == len(counts)


def test_the_stop_is_nobodys_where_there_is_no_session() -> None:
    with ConsoleServer(0) as server:
        assert ask(server.port, "/stop", Teleop_Page="new")[0] == 409
        assert ask(server.port, "/alive", Teleop_Page="new")[1]["can_stop"] is False
