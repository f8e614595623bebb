"""Hooks: everything that is changed in viser, and the only place that knows its inner names.

viser 1.1 opens its port itself, answers every request, counts ports up where one is taken, prints a
banner and offers to lead the page out through a tunnel. It has no settings for these. What it is
given here instead is the function with which it opens its server: ours hands a socket that listens
already to the same library, asks the guard before viser sees a request, and drops connections that
take nothing. The version bound in ``setup.py`` belongs to this module.
"""

import http
import logging
import threading
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from socket import socket
from types import SimpleNamespace
from typing import TypedDict, Unpack
from urllib.parse import parse_qs, urlsplit

import rich
import viser
import websockets
import websockets.asyncio.server as ws
from viser import _messages
from viser.infra import _infra
from websockets.datastructures import Headers
from websockets.http11 import Request, Response
from websockets.typing import DataLike, Subprotocol

from teleop_core.console.drivers import Drivers
from teleop_core.console.guard import HEADERS, Guard
from teleop_core.console.guard import Request as Asked
from teleop_core.errors import SessionError

LARGEST = 8 * 1024 * 1024
"""Largest message of a page [bytes]; a large rendered view is the largest that is meant."""
STUCK = 10.0
"""Time in which a page must have taken something of what waits for it [s]."""
_ALIVE = "/alive"
_HEARTBEAT = (
    "window.teleopPage = {page}; window.teleopAlive ??= setInterval(() => "
    "fetch('" + _ALIVE + "?page=' + window.teleopPage).catch(() => null), 1000);"
)
_STARTING = threading.Lock()

Answer = Callable[[ws.ServerConnection, Request], Response | None]


class ServeOptions(TypedDict, total=False):
    """What viser asks of its server beside the port and the answers."""

    max_size: int
    compression: str | None
    subprotocols: list[Subprotocol] | None
    select_subprotocol: Callable[[ws.ServerConnection, Sequence[Subprotocol]], Subprotocol | None]


class Connection(ws.ServerConnection):
    """A connection that ends when the other side takes nothing for :data:`STUCK` seconds.

    Of each of viser's two queues one message can wait here, and the newest of each kind wait in the
    queues: so what a slow page costs is bounded, and what a dead one costs ends.
    """

    async def send(self, message: DataLike, text: bool | None = None) -> None:  # type: ignore[override]
        """Send, and wait until the other side has taken most of it."""
        watch = _Watch(self)
        try:
            await super().send(message, text)
        finally:
            watch.end()


class _Watch:
    """Looks whether what waits in a connection becomes less."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._waited = connection, float("inf")
        self._again()

    def end(self) -> None:
        self._timer.cancel()

    def _again(self) -> None:
        self._timer = self._connection.loop.call_later(STUCK, self._look)

    def _look(self) -> None:
        waits = self._connection.transport.get_write_buffer_size()
        if waits >= self._waited:
            self._connection.transport.abort()
            return
        self._waited = waits
        self._again()


class Server(viser.ViserServer):
    """viser's server behind a guard, at a socket that listens already, without a way out.

    Args:
        opened: Listening socket; it is closed with the server.
        guard: Decides about requests.
        drivers: Hears which pages are open and alive, and which hold a gizmo.
        label: Heading of the panel.
    """

    def __init__(self, opened: socket, guard: Guard, drivers: Drivers, label: str) -> None:
        host, port = opened.getsockname()[:2]
        rich.get_console().quiet = True  # which viser alone writes to here
        with _STARTING, _opening(_server_at(opened, guard, drivers)):
            super().__init__(host=host, port=port, label=label, verbose=False)
        for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
            self._websock_server.unregister_handler(message)
        self.gui.configure_theme(show_logo=False, show_share_button=False)
        self._tell(drivers)

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Never: it would lead whoever knows the address around the guard."""
        raise SessionError("the console is not led out of this machine by others")

    def _tell(self, drivers: Drivers) -> None:
        """Let the drivers hear of pages: in the order of events, hence on the server's loop."""

        async def come(client: viser.ClientHandle) -> None:
            script = _HEARTBEAT.format(page=client.client_id)
            client._websock_connection.queue_message(_messages.RunJavascriptMessage(script))
            drivers.join(client.client_id)

        async def go(client: viser.ClientHandle) -> None:
            drivers.leave(client.client_id)

        self.on_client_connect(come)
        self.on_client_disconnect(go)
        for message, tell in (
            (_messages.TransformControlsDragStartMessage, drivers.hold),
            (_messages.TransformControlsUpdateMessage, drivers.heard),
            (_messages.TransformControlsDragEndMessage, drivers.let_go),
        ):
            self._websock_server.register_handler(message, _telling(tell))

    def forget(self) -> None:
        """Drop what is kept of removed elements; viser does so only when a page comes."""
        self._run_garbage_collector()

    def connections(self) -> int:
        """Number of pages that are connected, those that have not come up yet included."""
        return len(self._states())

    def kept(self) -> int:
        """Number of messages that are kept for pages: what may grow if something is wrong."""
        buffers = [state.message_buffer for state in self._states()]
        buffers.append(self._websock_server.get_message_buffer())
        return sum(len(buffer.message_from_id) for buffer in buffers)

    def _states(self) -> list[_infra._ClientHandleState]:
        return list(self._websock_server._client_state_from_id.values())


def _telling(tell: Callable[[int], object]) -> Callable[[int, _messages.Message], None]:
    """Tells which page a message is from."""

    def handler(page: int, message: _messages.Message) -> None:
        tell(page)

    return handler


def _server_at(opened: socket, guard: Guard, drivers: Drivers) -> Callable[..., ws.serve]:
    """A function that opens a server at the socket, whatever address it is told."""

    def serve(
        handler: Callable[[ws.ServerConnection], Awaitable[None]],
        host: str,
        port: int,
        *,
        process_request: Answer,
        **options: Unpack[ServeOptions],
    ) -> ws.serve:
        options["max_size"] = LARGEST
        return ws.serve(
            handler,
            sock=opened,
            process_request=_guarded(process_request, guard, drivers),
            create_connection=Connection,
            logger=_logger(),
            **options,
        )

    return serve


def _guarded(answer: Answer, guard: Guard, drivers: Drivers) -> Answer:
    """Answer of viser to a request, or a refusal."""

    def guarded(connection: ws.ServerConnection, request: Request) -> Response | None:
        headers = request.headers
        is_socket = bool(headers.get_all("Upgrade"))
        if reason := guard.refusal(Asked(request.path, is_socket, headers.get_all)):
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{reason}\n")
        if urlsplit(request.path).path == _ALIVE:
            _hear(request.path, drivers)
            return Response(http.HTTPStatus.NO_CONTENT, "No Content", Headers())
        response = answer(connection, request)
        if response is not None:
            _harden(response.headers, headers["Host"], guard)
        return response

    return guarded


def _hear(path: str, drivers: Drivers) -> None:
    page = parse_qs(urlsplit(path).query).get("page", [""])[0]
    if page.isascii() and page.isdecimal():
        drivers.heard(int(page[:9]))


def _harden(headers: Headers, host: str, guard: Guard) -> None:
    """Add what binds the page to this server."""
    for name, value in HEADERS.items():
        headers[name] = value.format(socket=f"ws://{host}")
    if cookie := guard.cookie():
        headers["Set-Cookie"] = cookie


@contextmanager
def _opening(serve: Callable[..., ws.serve]) -> Iterator[None]:
    """Let viser open servers by another function."""
    real = websockets
    server = SimpleNamespace(**{**vars(real.asyncio.server), "serve": serve})
    library = SimpleNamespace(**{**vars(real.asyncio), "server": server})
    patched = SimpleNamespace(**{**vars(real), "asyncio": library})
    setattr(_infra, "websockets", patched)  # noqa: B010
    try:
        yield
    finally:
        setattr(_infra, "websockets", real)  # noqa: B010


def _logger() -> logging.Logger:
    """Where the server tells what went wrong; that strangers speak something else is nothing."""
    logger = logging.getLogger("teleop_core.console")
    if not logger.filters:
        logger.addFilter(lambda record: record.getMessage() != "opening handshake failed")
    return logger
