"""Hooks: all changes of viser's behaviour; the only module that uses viser's private names.

viser 1.1 opens its port itself, answers every request, tries the next port if one is taken, prints a banner and offers
a public tunnel to the page. No settings change this behaviour. So this module replaces the function with which viser
opens its server. Our function passes an already listening socket to the websockets library. It asks the guard before
viser gets a request, and the filter before viser gets a message. The message buffers of this module wake their readers
in the right thread. This module needs the bound on viser's version in ``setup.py``.
"""

import asyncio
import http
import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from socket import socket
from types import SimpleNamespace
from typing import Any

import rich
import viser
import websockets
import websockets.asyncio.server as ws
from viser import _messages
from viser.infra import _async_message_buffer, _infra
from websockets.datastructures import Headers
from websockets.http11 import Request, Response
from websockets.typing import Data

from teleop_console.answers import Answers, answer_of
from teleop_console.connection import Connection, Crowd, Gate
from teleop_console.drivers import Drivers
from teleop_console.filter import FLOOD, LARGEST, NO_VALUE, WATCHES, Filter, Sets, decode
from teleop_console.front import Body, Front
from teleop_console.guard import HEADERS, Guard
from teleop_console.guard import Request as Asked
from teleop_core.base.errors import SessionError

PAGES = 16
"""Largest number of open pages; if there are more, the newest page that does not drive is closed."""
_NOTICE = 5.0  # time for which a page receives only its last message [s]
_STARTING = threading.Lock()

Answer = Callable[[ws.ServerConnection, Request], Response | None]


class Wake(asyncio.Event):
    """Event that is set only in the thread of its event loop.

    viser sets its event in the drawing thread, and then asks the loop to set it again. A reader that has checked the
    event but does not wait yet misses the first call. The second call and all later calls have no effect, because the
    event is already set. Then the page is never updated again.
    """

    def set(self) -> None:
        """Wake the waiting task if this is the loop's own thread; calls in other threads are ignored."""
        with suppress(RuntimeError):  # viser calls this also in a thread without a loop
            asyncio.get_running_loop()
            super().set()


class _Buffer(_async_message_buffer.AsyncMessageBuffer):
    """Queue of messages that are sent to pages."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.message_event = Wake()


setattr(_infra, "AsyncMessageBuffer", _Buffer)  # noqa: B010


class Server(viser.ViserServer):
    """viser's server behind a guard and a filter, on a socket that is already listening.

    Args:
        opened: Listening socket; it is closed with the server.
        guard: Decides about requests.
        drivers: Object that is informed about open pages, their signs of life, and pages that drag a gizmo.
        answers: Object that answers requests that are not for viser's page.
        label: Heading of the panel.

    Attributes:
        filter: Object that decides about messages.
    """

    def __init__(self, opened: socket, guard: Guard, drivers: Drivers, answers: Answers, label: str) -> None:
        host, port = opened.getsockname()[:2]
        answer = partial(_answered, guard, answers)
        self._front = Front(opened, answers.paths, answer, answers.slow_paths)
        self._drivers, self._public = drivers, set[str]()
        self.filter = Filter(self, drivers.may_drive, _logger().warning)
        rich.get_console().quiet = True  # only viser writes to this console
        with _STARTING, _opening(_server_at(self._front.passed_on, guard, answers, self)):
            super().__init__(host=host, port=port, label=label, verbose=False)
        for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
            self._websock_server.unregister_handler(message)
        self.gui.configure_theme(show_logo=False, show_share_button=False)
        self._tell(answers)

    def stop(self) -> None:
        """End the server."""
        self._front.close()
        super().stop()

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Refuse the request, because a public address would bypass the guard."""
        raise SessionError(
            "the console does not listen on public addresses; use `ssh -L` to reach it from another machine"
        )

    def _tell(self, answers: Answers) -> None:
        """Report opened and closed pages to the drivers in the order of events, in the server's loop."""
        drivers = self._drivers

        async def come(client: viser.ClientHandle) -> None:
            script = f"window.teleopPage = '{answers.name(client.client_id)}';"
            client._websock_connection.queue_message(_messages.RunJavascriptMessage(script))
            drivers.join(client.client_id)

        async def go(client: viser.ClientHandle) -> None:
            answers.forget(client.client_id)
            drivers.leave(client.client_id)

        self.on_client_connect(come)
        self.on_client_disconnect(go)
        for message, tell in (
            (_messages.TransformControlsDragStartMessage, drivers.hold),
            (_messages.TransformControlsUpdateMessage, drivers.heard),
            (_messages.TransformControlsDragEndMessage, drivers.let_go),
        ):
            self._websock_server.register_handler(message, lambda page, _, tell=tell: tell(page))  # type: ignore[misc]

    def show_on(self, page: int, name: str, *, is_shown: bool) -> None:
        """Show or hide a visible node of the scene on one page, until its visibility is sent to all pages."""
        client, node = self._connected_clients.get(page), self.scene.get_handle_by_name(name)
        if client is not None and node is not None:
            message = _messages.SetSceneNodeVisibilityMessage(name, node.visible and is_shown)
            client._websock_connection.queue_message(message)

    # -- what the filter asks ----------------------------------------------------------------------

    def make_public(self, handle: viser.GuiButtonHandle) -> None:
        """Allow pages that do not drive to use an element."""
        self._public.add(handle._impl.uuid)

    def is_public(self, uuid: str) -> bool:
        """Whether pages that do not drive may use an element."""
        return uuid in self._public

    def control(self, page: int, uuid: str) -> Any | None:
        """Handle of an input that a page shows; None if there is none."""
        handle = self.gui._gui_input_handle_from_uuid.get(uuid)
        return None if handle is None or handle._impl.removed else handle

    def has_command(self, uuid: str) -> bool:
        """Whether a command with this identifier exists."""
        return uuid in self.gui._command_handle_from_uuid

    def has_gizmo(self, name: str) -> bool:
        """Whether a gizmo with this name exists; a gizmo that is hidden now may still be released."""
        return name in self.scene._handle_from_transform_controls_name

    def is_asked(self, page: int) -> bool:
        """Whether the console has requested a picture from a page."""
        client, answer = self._connected_clients.get(page), _messages.GetRenderResponseMessage
        return client is not None and bool(client._websock_connection._incoming_handlers.get(answer))

    # -- what connections ask ----------------------------------------------------------------------

    def passed(self, connection: Connection, data: Data) -> bytes:
        """Part of a message that is passed on to viser. If a change is refused, the page shows the old value again."""
        page = self._page(connection)
        passed, reason = self.filter.judge(page, data)
        if reason in {WATCHES, NO_VALUE}:
            self._put_back(page, data)
        if reason == WATCHES and connection.loop.time() > connection.silent_until:
            connection.silent_until = connection.loop.time() + _NOTICE
            self._notify(page, "You watch. Take control first.")
        return passed

    def cut(self, connection: Connection) -> None:
        """Record that a connection was closed because it sent too much."""
        self.filter.refuse(self._page(connection), FLOOD)

    def come(self, connection: Connection) -> None:
        """If there are too many pages, close the newest one that does not drive."""
        live = self._websock_server._live_connections
        watchers = [page for page in live if not self._drivers.may_drive(page)]
        if len(live) >= PAGES and watchers:
            live[watchers[-1]].transport.abort()

    def _page(self, connection: Connection) -> int:
        live = self._websock_server._live_connections
        return next((page for page, known in live.items() if known is connection), -1)

    def _notify(self, page: int, text: str) -> None:
        if (client := self._connected_clients.get(page)) is not None:
            client.add_notification("Not done", text, auto_close_seconds=_NOTICE, color="yellow")

    def _put_back(self, page: int, data: Data) -> None:
        """Show the old value of an element again after a refused change."""
        client, sets = self._connected_clients.get(page), decode(data)
        if client is None or not isinstance(sets, Sets):
            return
        handle = self.control(page, sets.uuid)
        if handle is not None and not handle._impl.is_button:
            message = _messages.GuiUpdateMessage(sets.uuid, {"value": handle.value})
            client._websock_connection.queue_message(message)

    def forget(self) -> None:
        """Delete the messages of removed elements; viser itself deletes them only when a page opens."""
        self._run_garbage_collector()


def _server_at(opened: socket, guard: Guard, answers: Answers, gate: Gate) -> Callable[..., ws.serve]:
    """Return a function that opens a server on the given socket and ignores its address argument."""

    def serve(handler: Any, host: str, port: int, *, process_request: Answer, **options: Any) -> ws.serve:
        return _Serving(
            handler,
            sock=opened,
            process_request=_guarded(process_request, guard, answers),
            create_connection=partial(Connection, gate=gate, crowd=Crowd()),  # type: ignore[arg-type]
            logger=_logger(),
            **options | {"max_size": LARGEST},
        )

    return serve


class _Serving(ws.serve):
    """A server that stops to accept connections one turn of the event loop before it ends.

    asyncio needs two turns to accept a connection, but the library waits for only one. A connection that began in the
    last turn would never be closed.
    """

    async def __aexit__(self, *error: Any) -> None:
        for listens in self.server.sockets:
            asyncio.get_running_loop().remove_reader(listens.fileno())
        await super().__aexit__(*error)


def _answered(guard: Guard, answers: Answers, request: Request, body: Body) -> Response:
    """Return our own answer to a request, or a refusal."""
    asked = Asked(request.path, False, request.headers.get_all, body)
    if reason := guard.refusal(asked):
        return answer_of(http.HTTPStatus.FORBIDDEN, f"{reason}\n".encode())
    response = answers.to(asked)
    _harden(response.headers, request.headers["Host"], guard)
    return response


def _guarded(answer: Answer, guard: Guard, answers: Answers) -> Answer:
    """Return viser's answer to a request, or a refusal."""

    def guarded(connection: ws.ServerConnection, request: Request) -> Response | None:
        headers = request.headers
        asked = Asked(request.path, bool(headers.get_all("Upgrade")), headers.get_all)
        if reason := guard.refusal(asked):
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{reason}\n")
        response = answer(connection, request)
        if response is not None:
            answers.furnish(asked, response)
            _harden(response.headers, headers["Host"], guard)
        return response

    return guarded


def _harden(headers: Headers, host: str, guard: Guard) -> None:
    """Add the headers of every page, and the cookie of this server."""
    for name, value in HEADERS.items():
        headers[name] = value.format(socket=f"ws://{host}")
    headers["Set-Cookie"] = guard.cookie()


@contextmanager
def _opening(serve: Callable[..., ws.serve]) -> Iterator[None]:
    """Let viser open servers with the given function."""
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
    """Logger of the server; it ignores connections with another protocol."""
    logger = logging.getLogger("teleop_console")
    if not logger.filters:
        logger.addFilter(lambda record: record.getMessage() != "opening handshake failed")
    return logger
