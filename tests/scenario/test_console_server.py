"""Console's server: used by real browsers, refused to pages from elsewhere."""

import asyncio
import re
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from headless import Headless
from present import present
from teleop_core.kernels.geometry import Array

pytest.importorskip("viser")

import viser
from viser import _messages
from viser.infra import _infra

from browser import Tab, handshake, until
from desk import connected
from page_client import TOKEN, ask
from teleop_console import connection
from teleop_console.server import ConsoleServer
from teleop_core.base.errors import SessionError

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SPOKEN = f"viser-v{viser.__version__}"
CENTER = (700, 450)
"""Of the window of a tab [px]; there the scene's origin is."""


class Answer(BaseHTTPRequestHandler):
    """A harmless page."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b"<body>somewhere else</body>")

    def log_message(self, *told: object) -> None:
        pass


@contextmanager
def elsewhere() -> Iterator[str]:
    """Address of the page that another server of this machine has."""
    with ThreadingHTTPServer(("127.0.0.1", 0), Answer) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def is_driven(server: ConsoleServer) -> bool:
    return server.drivers.driver is not None


def test_page_opens_without_errors_asks_no_other_host_and_is_used(tab: Any, capfd: pytest.CaptureFixture[str]) -> None:
    with ConsoleServer(0, token="secret", label="arm") as server:
        clicks = []
        server.viser.gui.add_button("Start").on_click(lambda event: clicks.append(event.client_id))
        name = server.viser.gui.add_text("name", "")
        tab.visit(server.url)
        tab.click("Start")
        until(lambda: clicks, "the click arrives")
        assert clicks == [server.drivers.driver]
        tab.fill("name", "run 1")
        until(lambda: name.value == "run 1", "what was typed arrives")
        until(lambda: tab.hosts() and any("/alive" in url for url in tab.asked), "it is alive")
        assert tab.hosts() == {f"127.0.0.1:{server.port}"}
        assert not tab.faults()
    assert capfd.readouterr() == ("", "")


def test_page_without_the_token_is_refused_until_it_has_shown_it_once(tab: Any) -> None:
    with ConsoleServer(0, token="secret") as server:
        address = server.url.split("?", maxsplit=1)[0]
        for wrong in (address, address + "?token=guess"):
            tab.call("Page.navigate", url=wrong)
            tab.shows("token is missing or wrong")
            assert tab.answers[wrong] == 403
        tab.visit(server.url)
        until(lambda: is_driven(server), "the page is there")
        tab.visit(address)  # the browser keeps it
        until(lambda: server.drivers.driver == 1, "the page is there again")
        assert tab.value("document.cookie") == ""  # no script can read it


def test_page_of_another_origin_gets_no_connection_no_frame_and_no_answer(tab: Any) -> None:
    with ConsoleServer(0, token=TOKEN) as server, elsewhere() as foreign:
        tab.call("Page.navigate", url=foreign)
        tab.until("document.body")
        opened = tab.value(f"""new Promise((done) => {{
            const socket = new WebSocket('ws://127.0.0.1:{server.port}/', '{SPOKEN}');
            socket.onopen = () => done('open'); socket.onerror = () => done('refused'); }})""")
        assert opened == "refused"
        read = tab.value(f"fetch('{server.url}').then(() => 'read', () => 'refused')")
        assert read == "refused"
        tab.value(f"""new Promise((done) => {{ const frame = document.createElement('iframe');
            frame.onload = done; frame.src = '{server.url}'; document.body.append(frame); }})""")
        assert tab.value("document.querySelector('iframe').contentDocument") is None
        tab.visit(server.url)  # its own page is served all the while, as the only one
        until(lambda: is_driven(server), "the page is there")
        assert server.drivers.pages == (0,)


def test_of_two_browsers_one_drives_and_a_reload_in_the_middle_keeps_it_so(tab: Any, tmp_path: Path) -> None:
    with ConsoleServer(0, token=TOKEN) as server, Tab(tmp_path) as other:
        take = server.viser.gui.add_button("Take control")
        take.on_click(lambda event: server.drivers.take(present(event.client_id)))
        server.viser.make_public(take)
        tab.visit(server.url)
        until(lambda: is_driven(server), "the first page is there")
        other.visit(server.url)
        until(lambda: len(server.drivers.pages) == 2, "the second page is there")
        first, second = server.drivers.pages
        assert server.drivers.driver == first
        other.click("Take control")
        until(lambda: server.drivers.driver == second, "the second page drives")
        other.reload()
        until(lambda: server.drivers.driver not in {None, first, second}, "it drives again")
        other.call("Page.navigate", url="about:blank")
        until(lambda: server.drivers.pages == (first,), "the second page has gone")
        assert server.drivers.driver is None
        assert not tab.faults()


def test_browser_that_stands_still_while_it_holds_the_stylus_loses_control(tab: Any) -> None:
    with ConsoleServer(0, token=TOKEN, patience=2.5) as server:
        held = []
        gizmo = server.viser.scene.add_transform_controls("/stylus", scale=2.0)
        gizmo.on_update(lambda _: held.append(gizmo.position))
        tab.visit(server.url)
        until(lambda: is_driven(server), "the page is there")
        page = server.drivers.driver
        grip = gizmo_tip(tab)
        tab.pull(grip, (grip[0], grip[1] - 60))
        until(lambda: held, "the stylus moves")
        tab.value("new Promise((done) => setTimeout(done, 3000))")  # held still, but alive
        assert server.drivers.driver == page
        tab.value("setTimeout(() => { const end = performance.now() + 4500; while (performance.now() < end); }, 0); 0")
        until(lambda: not is_driven(server), "control is lost")
        tab.mouse("mouseReleased", *grip)
        assert server.drivers.pages == (page,)  # its connection is well: a worker answers


def gizmo_tip(tab: Headless) -> Any:
    """A point of the upward arrow of a gizmo at the origin [px]: where the cursor grabs it."""
    tab.value("new Promise((done) => setTimeout(done, 500))")
    return (CENTER[0], CENTER[1] - 40)


def test_client_that_never_reads_costs_little_and_is_dropped_while_others_are_served(
    tab: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "STUCK", 1.0)
    with ConsoleServer(0, token=TOKEN) as server:
        scene = server.viser.scene
        body = scene.add_frame("/body")
        mesh = scene.add_point_cloud("/cloud", **cloud(0))
        told, dead = handshake(
            server.port, f"/?token={TOKEN}", Origin=f"http://127.0.0.1:{server.port}", Sec_WebSocket_Protocol=SPOKEN
        )
        assert "101" in told
        until(lambda: len(connected(server)) == 1, "the page that never reads")
        tab.visit(server.url)
        until(lambda: is_driven(server), "the page is there")
        kept: list[Any] = []

        def went() -> bool:
            for _ in range(20):
                body.position = (0.001 * len(kept), 0.0, 0.0)
                mesh.points = cloud(len(kept))["points"]
            buffers = [
                server.viser._websock_server.get_message_buffer(),
                *(s.message_buffer for s in connected(server)),
            ]
            kept.append(sum(len(buffer.message_from_id) for buffer in buffers))
            return len(connected(server)) == 1 and len(kept) > 100

        until(went, "the one that never reads is dropped")
        assert max(kept[50:]) <= max(kept[:50]) + 5  # of 40 updates each, the newest are kept
        assert is_driven(server)
        assert not tab.faults()
        dead.close()


def cloud(seed: int) -> dict[Any, Any]:
    points = np.random.default_rng(seed).normal(size=(20_000, 3)).astype(np.float32)
    return {"points": points, "colors": np.zeros((20_000, 3), np.uint8)}


def test_page_is_led_out_of_the_machine_by_nobody(tab: Any) -> None:
    with ConsoleServer(0, token=TOKEN) as server:
        tab.visit(server.url)
        until(lambda: is_driven(server), "the page is there")
        icons = "document.querySelectorAll('.tabler-icon-share').length"
        until(lambda: tab.value(icons) == 0, "no button to share the page")
        handlers = server.viser._websock_server._incoming_handlers
        assert not {_messages.ShareUrlRequest, _messages.ShareUrlDisconnect} & set(handlers)
        with pytest.raises(SessionError):
            server.viser.request_share_url()


def test_port_of_another_console_is_refused_and_not_counted_up() -> None:
    with ConsoleServer(0, token=TOKEN) as server, pytest.raises(SessionError, match="taken by"):
        ConsoleServer(server.port)


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_every_address_is_served_with_the_token_alone(host: str) -> None:
    with ConsoleServer(0, host) as server:
        assert len(server.token) >= 32
        shown = "localhost" if host == "0.0.0.0" else host
        assert server.url == f"http://{shown}:{server.port}/?token={server.token}"
        origin = f"http://127.0.0.1:{server.port}"
        for path, first in (("/", "403"), ("/?token=guess", "403"), (f"/?token={server.token}", "101")):
            told, opened = handshake(server.port, path, Origin=origin)
            opened.close()
            assert first in told
        for path in ("/", "/stop", "/alive", "/strip?begin=0&end=1&pixels=9", "/teleop/page.js"):
            assert ask(server.port, path, token="guess", Teleop_Page="new")[0] == 403


def test_address_for_a_phone_is_that_of_the_network_and_has_the_token() -> None:
    with ConsoleServer(0, "0.0.0.0", token=TOKEN) as server:
        assert re.fullmatch(rf"http://\d+(\.\d+){{3}}:{server.port}/\?token={TOKEN}", server.url_elsewhere)
        assert "0.0.0.0" not in server.url_elsewhere


def test_message_that_is_drawn_just_before_its_reader_waits_is_sent() -> None:
    async def read() -> bool:
        # As viser makes its buffers, once the console's hooks are in place.
        infra: Any = _infra
        buffer = infra.AsyncMessageBuffer(asyncio.get_running_loop(), persistent_messages=True)
        message = _messages.RunJavascriptMessage("drawn")
        buffer.message_event._waiters = AfterDrawing(partial(buffer.push, message))
        return await asyncio.wait_for(anext(buffer.window_generator(0)), 20) == [message]

    assert asyncio.run(read())


class AfterDrawing(deque[Any]):
    """Who waits for an event; each comes only after another thread has drawn once."""

    def __init__(self, draw: partial[None]) -> None:
        super().__init__()
        self._draw = draw

    def append(self, waiter: int | Array | None) -> None:
        drawing = threading.Thread(target=self._draw)
        drawing.start()
        drawing.join()
        super().append(waiter)
