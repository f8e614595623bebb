"""Hostile pages: nothing that they send moves an arm that they do not drive, or stops the stop."""

import gc
import logging
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import pytest

from present import present

pytest.importorskip("viser")

import hostile
from browser import until
from desk import Desk, connected, shown
from page_client import TOKEN, PageClient, ask
from teleop_console.connection import Crowd
from teleop_console.filter import BURST, FLOOD, Budget
from teleop_console.front import WAITING
from teleop_console.server import ConsoleServer

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
    attack: Callable[[PageClient, PageClient], None], served: Any, caplog: pytest.LogCaptureFixture
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
        assert stops(server, desk)
        assert driver.ask("/alive")[1]["drives"] is True
        assert not driver.is_cut
    assert not [r for r in caplog.records if r.levelno >= logging.ERROR and "teleop" in r.name]
    until(lambda: len(connected(server)) == 1, "the page has gone")


def stops(server: ConsoleServer, desk: Desk) -> bool:
    """Whether a stop that a new page asks for is sent, once."""
    pressed = desk.stops
    return ask(server.port, "/stop", Teleop_Page="new")[0] == 204 and desk.stops == pressed + 1


def handle_state(server: ConsoleServer, uuid: str) -> tuple[str | bool, str, bool, bool, int, bool] | None:
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
    with ConsoleServer(0, token=TOKEN) as server, PageClient(server.port, comes_up=False) as page:
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


def test_a_stop_before_there_is_a_session_is_told_so_and_stays_on_offer() -> None:
    with ConsoleServer(0, token=TOKEN) as server:
        assert ask(server.port, "/stop", Teleop_Page="new")[0] == 409
        assert ask(server.port, "/alive", Teleop_Page="new")[1]["can_stop"] is True


def test_stop_is_sent_while_the_loop_that_serves_the_pages_is_busy(
    served: tuple[ConsoleServer, Desk, PageClient],
) -> None:
    server, desk, _ = served
    loop: Any = server.viser._websock_server._background_event_loop
    is_busy, goes_on = threading.Event(), threading.Event()

    def work() -> None:
        is_busy.set()
        goes_on.wait(60)

    loop.call_soon_threadsafe(work)
    assert is_busy.wait(60)
    try:
        assert stops(server, desk)
        assert ask(server.port, "/alive", Teleop_Page="new")[0] == 200
    finally:
        goes_on.set()


def test_stop_is_sent_beside_requests_that_begin_and_never_end(served: tuple[ConsoleServer, Desk, PageClient]) -> None:
    server, desk, _ = served
    with ExitStack() as guests:
        for begun in (b"", b"GET /st", b"GET /stop HTTP/1.1\r\nHost: ") * (WAITING // 2):
            guest = guests.enter_context(socket.create_connection(("127.0.0.1", server.port)))
            guest.sendall(begun)
        assert stops(server, desk)
    with PageClient(server.port) as page:
        page.sync()


@pytest.mark.parametrize("line", [b"GET /stop HTTP/1.0", b"POST /stop HTTP/1.1", b"GET  /stop"])
def test_malformed_request_for_the_stop_is_none_and_ends_nothing(
    served: tuple[ConsoleServer, Desk, PageClient], line: bytes
) -> None:
    server, desk, _ = served
    pressed = desk.stops
    with socket.create_connection(("127.0.0.1", server.port), timeout=30) as guest:
        host = f"Host: 127.0.0.1:{server.port}\r\nCookie: teleop_console_{server.port}={TOKEN}\r\n"
        guest.sendall(line + b"\r\nTeleop-Page: new\r\n" + host.encode() + b"\r\n")
        guest.shutdown(socket.SHUT_WR)
        while guest.recv(4096):
            pass
    assert desk.stops == pressed
    assert stops(server, desk)


def test_pages_that_send_too_much_together_lose_the_one_that_sends_most() -> None:
    crowd = Crowd()
    pages = [Talker(crowd) for _ in range(16)]
    for count in range(200):
        for one in pages[1:]:
            one.say(2)
        pages[0].say(1 if count % 2 else 0)
    assert not pages[0].is_cut
    assert any(one.is_cut for one in pages)


class Talker:
    """A page that is heard until it is cut."""

    def __init__(self, crowd: Any) -> None:
        self.budget, self.is_cut, self.said = Budget(clock=lambda: 0.0), False, 0
        self._crowd = crowd
        self._crowd.pages.add(self)

    def say(self, frames: int) -> None:
        if not self.is_cut:
            self.said += frames
            self.budget.spend(frames, 0)
            self._crowd.spend(frames, 0)

    def cut(self) -> None:
        self.is_cut = True
        self._crowd.pages.discard(self)


PRIORITIES = """
import os, threading
from teleop_console import app
from teleop_console.server import ConsoleServer
app._NICE = 19
with ConsoleServer(0):
    before = os.getpriority(os.PRIO_PROCESS, 0)
    app.give_way()
    found = {thread.name: os.getpriority(os.PRIO_PROCESS, thread.native_id) for thread in threading.enumerate()}
print(found.pop("console front") == before, set(found.values()))
"""


def test_thread_that_answers_the_stop_keeps_its_priority_where_the_page_gives_way_to_the_session() -> None:
    done = subprocess.run([sys.executable, "-c", PRIORITIES], capture_output=True, text=True, check=False)
    assert done.stdout == "True {19}\n", done.stderr


def test_no_search_for_garbage_through_all_of_a_page_keeps_its_stop_waiting() -> None:
    before, thresholds = gc.get_freeze_count(), gc.get_threshold()
    with shown(Desk()) as (_, desk):
        until(lambda: desk.looks > 1, "the page's first drawing")
        frozen, left = gc.get_freeze_count(), len(gc.get_objects())
    assert frozen > before + 1000
    assert frozen > 50_000 > left
    assert (gc.get_freeze_count(), gc.get_threshold()) == (0, thresholds)
